"""From frame to frame: where the scene appears, against key pictures and not against the frame before.

The first key picture defines the scene. Another one is taken only where the view has moved far from all of
them, so that errors add up over the few key pictures of a way and not over its frames, and a view that comes
back meets the same key picture again.
"""

from __future__ import annotations

import numpy as np

from monodyn.types import Frame
from monodyn.vision.clip.homography import Homography, at_rest
from monodyn.vision.registration.align import Alignment, align
from monodyn.vision.registration.keypicture import Key, key_of, pyramid

LEAST_WITHIN = 0.6
"""Share of a key picture's points that must be in view; else the frame becomes another one."""
LEAST_LIKE = 0.5
"""Share of them that must agree; else the frame becomes another one."""
PATIENCE = 5
"""Frames that find no key picture after which another scene begins."""


class Registrar:
    """Takes the frames of a clip one by one; what it keeps are key pictures and the last place.

    Args:
        size: Width and height of the pictures [px].
        first: Key picture of the scene; None takes the first frame that shows enough, and another after a
            cut.

    Attributes:
        scene: Number of the scene so far; a cut begins another one.
    """

    def __init__(self, size: tuple[int, int], first: Key | None = None) -> None:
        self.scene = -1 if first is None else 0
        self._size = size
        self._keys: list[Key] = [] if first is None else [first]
        self._open = first is None
        self._last = at_rest(size)
        self._before: np.ndarray | None = None
        self._missed = 0

    def add(self, frame: Frame, likely: Homography | None = None) -> Alignment | None:
        """Register the next frame.

        Args:
            frame: The frame.
            likely: Where the scene may appear in it, if it is not near the place in the frame before.

        Returns:
            Where the scene appears in it, its map from the scene's first key picture; None where it does not
            appear.
        """
        pictures = pyramid(frame.luma)
        found = self._found(pictures, likely) if self._keys else None
        self._before = pictures[0]
        if found is not None:
            self._missed, self._last = 0, found.at
            return found
        self._missed += 1
        if not self._open or (self._keys and self._missed <= PATIENCE):
            return None
        # nothing known shows any more, or nothing was known yet
        key = key_of(pictures, at_rest(self._size))
        if not key.holds:
            return None
        self.scene, self._keys, self._missed, self._last = self.scene + 1, [key], 0, key.at
        return align(pictures, key, key.at)

    def _found(self, pictures: list[np.ndarray], likely: Homography | None) -> Alignment | None:
        """Align a frame with the nearest key picture; make it one where that is far."""
        key = self._keys[0]
        if len(self._keys) > 1:
            key = min(self._keys, key=lambda key: key.at.apart(self._last))
        found = self._aligned(pictures, key, self._last)
        if not found.known:
            found = self._aligned(pictures, key, self._leapt(pictures[0]))
        if not found.known and likely is not None:
            found = self._aligned(pictures, key, likely)
        if not found.known:
            return None
        if found.within < LEAST_WITHIN or found.agreeing < LEAST_LIKE:
            another = key_of(pictures, found.at)
            near = min(known.at.apart(found.at) for known in self._keys)
            # where the scene itself changes, more key pictures would only drift
            if another.holds and near > NEW_KEY * max(self._size):
                self._keys.append(another)
        return found

    def _aligned(self, pictures: list[np.ndarray], key: Key, start: Homography) -> Alignment:
        """Align a frame, in which the scene should appear at ``start``; its map is from the scene."""
        found = align(pictures, key, start.after(key.at.inverse))
        return found._replace(at=found.at.after(key.at))

    def _leapt(self, coarse: np.ndarray) -> Homography:
        """Return where the scene should appear if the whole picture was displaced since the last frame."""
        import cv2

        if self._before is None or self._before.shape != coarse.shape:
            return self._last
        window = cv2.createHanningWindow(coarse.shape[::-1], cv2.CV_32F)
        (right, down), _ = cv2.phaseCorrelate(
            self._before.astype(np.float32), coarse.astype(np.float32), window
        )
        by = self._size[0] / coarse.shape[1]
        leap = np.eye(3)
        leap[:2, 2] = right * by, down * by
        return Homography(leap, self._size).after(self._last)


NEW_KEY = 0.1
"""Least way between two key pictures, as a share of the longer side of the picture."""
