"""A clip of the user's in place of the made one: opened, with its mechanism and, where it is known, its
truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from monodyn.errors import SettingsError, VideoError
from monodyn.mechanism import Mechanism, load
from monodyn.reproduce.plans import LEAST_FRAMES
from monodyn.reproduce.truth import Truth, read_truth
from monodyn.vision.clip.video import Video, read


@dataclass(frozen=True)
class GivenClip:
    """A clip of the user's.

    Attributes:
        clip: Video file or folder of pictures.
        model: Mechanism file or bundled name.
        truth: File with the true motion, or None.
    """

    clip: str | Path
    model: str | Path
    truth: str | Path | None = None

    @classmethod
    def of(
        cls, clip: str | Path | None, model: str | Path | None, truth: str | Path | None
    ) -> GivenClip | None:
        """Return the clip that was given, or None where one is to be made.

        Args:
            clip: Video file or folder of pictures, or None.
            model: Mechanism file or bundled name, or None.
            truth: File with the true motion, or None.

        Raises:
            SettingsError: only one of clip and model is given, or a truth without them.
        """
        if (clip is None) != (model is None):
            given, other = ("clip", "model") if model is None else ("model", "clip")
            raise SettingsError(
                f"reproduce: expected --clip and --model together, got --{given} alone; add --{other}."
            )
        if clip is None or model is None:
            if truth is not None:
                raise SettingsError(
                    "reproduce: expected --truth with --clip, got it alone; the made clip has its own, "
                    "leave it out."
                )
            return None
        return cls(clip, model, truth)


def opened(clip: str | Path, model: str | Path) -> tuple[Video, Mechanism]:
    """Return the opened clip and the mechanism.

    Args:
        clip: Video file or folder of pictures.
        model: Mechanism file or bundled name.

    Raises:
        MechanismError: the model cannot be used.
        VideoError: the clip cannot be used, or has too few frames.
    """
    mechanism, video = load(model), read(clip)
    if video.count < LEAST_FRAMES:
        raise VideoError(
            f"clip '{clip}': expected at least {LEAST_FRAMES} frames, got {video.count}; give a longer clip."
        )
    return video, mechanism


def given_truth(given: GivenClip) -> Truth | None:
    """Return the truth of a clip at its stamps, or None where it is not known.

    Args:
        given: The clip.

    Raises:
        MechanismError: the model cannot be used.
        VideoError: clip or truth cannot be used.
    """
    video, mechanism = opened(given.clip, given.model)
    return None if given.truth is None else read_truth(given.truth, mechanism, video.times)
