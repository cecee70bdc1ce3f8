"""Make the page on how to film: good and bad clips side by side, with what the program says of each.

Run: ``python benchmarks/filming.py [--only NAME ...] [--write FOLDER]``. Each clip is drawn, run with default
settings and compared with its truth; ``--write docs`` writes ``filming.md`` and its pictures.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

import monodyn
from cases import chain
from clips import wrong
from effects import EFFECTS, held
from figures import say
from filmed import MECHANISMS, WIDE, Take, angle_error, filmed, length_error
from monodyn.vision.clip.video import read
from spec import mjcf

WIDTH, HEIGHT = 460, 307
"""Size of a picture of the page [px]."""
QUALITY = 82
"""Of its JPEG file, 0 to 100."""
SHOWN = 0.35
"""Which picture of a clip is shown, as a share of its length."""
MOST_NOTES = 2
"""Sentences of a run that the page quotes, after the status."""


@dataclass(frozen=True)
class Lesson:
    """One thing to know about filming.

    Attributes:
        title: Heading.
        rule: What to do and why, in plain words.
        good: A clip that follows it, and a caption.
        bad: A clip that does not, and a caption.
    """

    title: str
    rule: str
    good: tuple[Take, str]
    bad: tuple[Take, str]


_DOUBLE = replace(MECHANISMS["double"], wall="room", fill=0.8)
_LOW = replace(_DOUBLE, pivot=(0.5, 0.3), fill=1.2)
_BOB, _TRIPLE = replace(MECHANISMS["bob"], wall="stripes"), MECHANISMS["triple"]
_CART = replace(MECHANISMS["cart"], wall="mottled")
_GREY = chain((0.22, 0.18), 0.012, ((118, 118, 117), (112, 112, 111)))
_FAINT = replace(_LOW, parts=_GREY, base=(124, 124, 122), wall="plain", noise=5.0)
LESSONS = {
    "large": Lesson(
        "Fill the picture",
        "Every pixel of the outline is a measurement: let the mechanism take most of the picture, rather "
        "from some distance and with zoom than with the wide end of the lens.",
        (Take(_LOW), "reaches over the whole height"),
        (Take(replace(_DOUBLE, wall="checker", fill=0.13, noise=4.0)), "reaches over 6 % of the height"),
    ),
    "whole": Lesson(
        "Keep all of it in the picture",
        "What is outside of the picture is not measured. The pivot may be outside; what swings should not "
        "leave. Watch one whole motion before filming it.",
        (Take(_CART), "all in the picture"),
        (Take(replace(_CART, fill=2.4, pivot=(0.8, 0.2))), "it leaves at the right and at the bottom"),
    ),
    "contrast": Lesson(
        "Stand out from the wall",
        "A colour that the wall does not have, each link its own, does more than a better camera. Coloured "
        "tape or paper is enough. Patterns on the wall do no harm.",
        (Take(replace(_LOW, wall="mottled", seed=3)), "a colour for each link"),
        (Take(_FAINT), "grey rods before a grey wall, little light"),
    ),
    "light": Lesson(
        "Light, a short exposure, many pictures a second",
        "A moving link is smeared over the way that it goes during the exposure. In daylight or with a lamp "
        "the camera exposes for a few milliseconds; 60 pictures a second are better than 30. Real slow "
        "motion is welcome: give the true rate with `--rate`.",
        (Take(replace(_LOW, rate=60, shutter=0.1, seed=4)), "60 pictures a second, 1.7 ms each"),
        (Take(replace(_LOW, rate=10, shutter=1.0, seed=4)), "10 pictures a second, 100 ms each"),
    ),
    "swing": Lesson(
        "Let it swing wide",
        "A small swing looks the same for many mechanisms: sizes and frictions show in large, lively motion. "
        "Lift it up, let it go from rest, and film until it has calmed down a little.",
        (Take(_BOB), "let go 50 degrees from hanging"),
        (Take(replace(_BOB, start=(-1.56,))), "swings by half a degree"),
    ),
    "still": Lesson(
        "Put the camera on something",
        "A camera that moves is followed by what stands still in the picture: a wall with posters, books or "
        "a pattern, away from the mechanism. Before a bare wall nothing shows how it moves.",
        (Take(replace(_DOUBLE, **WIDE), (held(1.0, 25.0, 0.5),)), "held by hand before a room"),
        (
            Take(replace(_DOUBLE, wall="plain", **WIDE), (held(1.0, 25.0, 0.5),)),
            "held by hand before a bare wall",
        ),
    ),
    "square": Lesson(
        "Look square at the motion",
        "From aside, lengths shrink and near parts look larger. A few degrees do no harm, and larger ones "
        "are estimated where the motion is large enough to show them; what is square needs no estimate.",
        (Take(replace(_DOUBLE, fill=1.0, turned=(3.0, 0.0, 0.0))), "square, three degrees out of level"),
        (Take(replace(_CART, turned=(0.0, 0.0, 30.0))), "from 30 degrees aside"),
    ),
    "alone": Lesson(
        "Nothing else that moves",
        "Other things that move are left out where they move apart from the mechanism, and a note says so. "
        "Nothing should pass before or right behind it.",
        (Take(_TRIPLE), "nothing else"),
        (Take(_TRIPLE, (EFFECTS["passer_by"],)), "somebody sways at the left edge"),
    ),
}
"""What the page shows, by name."""

_HEAD = """# How to film

What makes a clip good, with good and bad ones side by side. `python benchmarks/filming.py --write docs`
draws every clip with known truth, runs the program on it with default settings and writes this page:
what stands under a picture is what the program said, and by how much it was off. The outline over a
picture is the identified motion; where there is none the run was refused or not to be trusted.

In short: a tripod, square to the plane of the motion, a few metres away; the mechanism large and whole
in the picture; colours that the wall does not have; light, and as many pictures a second as the camera
gives; a wide swing from rest, nothing else that moves, a few seconds. Nothing has to be measured or
calibrated: the scale comes from gravity, which needs true time (`--rate` for slow motion).
"""


def main() -> int:
    """Run what was asked for, print the page or write it.

    Returns:
        The exit code.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=tuple(LESSONS), metavar="NAME")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write filming.md and pictures there")
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="keep clips and run folders there")
    options = parser.parse_args()
    text = [_HEAD]
    with tempfile.TemporaryDirectory() as temporary:
        pictures = (options.write or Path(temporary)) / "filming"
        pictures.mkdir(parents=True, exist_ok=True)
        for name in options.only or LESSONS:
            text.append(section(name, LESSONS[name], options.runs or Path(temporary), pictures))
    page = "\n".join(text)
    if options.write is None:
        print(page)
    else:
        (options.write / "filming.md").write_text(page, encoding="utf-8")
    return 0


def section(name: str, lesson: Lesson, runs: Path, pictures: Path) -> str:
    """Return the part of the page about a lesson, whose clips are run and whose pictures are written.

    Args:
        name: Of the lesson; its pictures are called so.
        lesson: The lesson.
        runs: Where clips and run folders go.
        pictures: Where the pictures go.
    """
    cells = []
    for kind, (take, caption) in (("good", lesson.good), ("bad", lesson.bad)):
        picture, said = shown(take, runs / f"{name}_{kind}")
        path = pictures / f"{name}_{kind}.jpg"
        cv2.imwrite(str(path), picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        cells.append((f"![{caption}](filming/{path.name})", caption, said))
    rows = ["| " + " | ".join(row) + " |" for row in zip(*cells, strict=True)]
    return "\n".join([f"## {lesson.title}\n", lesson.rule, "", rows[0], "|---|---|", *rows[1:], ""])


def shown(take: Take, folder: Path) -> tuple[np.ndarray, str]:
    """Run one clip.

    Args:
        take: What it shows.
        folder: Where clip and run folder go.

    Returns:
        A picture of it, BGR (height, width, 3), and what the program said.
    """
    folder.mkdir(parents=True, exist_ok=True)
    clip, truth = folder / "clip.mp4", filmed(take, folder / "clip.mp4")
    (folder / "model.xml").write_text(mjcf(tuple(wrong(part) for part in take.case.parts)))
    try:
        outcome = monodyn.run(clip, folder / "model.xml", folder / "run", force=True)
    except monodyn.MonodynError as error:
        say(f"{folder.name}: {error}")
        return _picture(clip), f"**Refused.** {_plain(error)}"
    document = outcome.document
    angle, length = angle_error(take, outcome.poses, truth)[0], length_error(take, document)[0]
    verdict = f"**{document['status']}**" if document["ok"] else f"**Refused.** {document['status']}"
    notes = [note for note in outcome.notes if "clip k times slower" not in note][:MOST_NOTES]
    off = f"*Off by {_amount(angle, 'deg')} and {_amount(length, '% of a length')}.*"
    say(f"{folder.name}: {document['status']} {off}")
    return _picture(folder / "run" / "overlay.mp4"), " ".join([verdict, *notes, off])


def _amount(value: float, unit: str) -> str:
    """Return an error in words: two digits, no power of ten."""
    if not np.isfinite(value):
        return f"an unknown number of {unit}"
    return f"{float(f'{value:.2g}'):g} {unit}"


def _plain(error: Exception) -> str:
    """Return a message without the path of the clip."""
    text = str(error)
    return text.split("': ", 1)[1] if text.startswith("clip '") else text


def _picture(path: Path) -> np.ndarray:
    """Return the picture of a clip that the page shows, BGR (height, width, 3)."""
    video = read(path)
    capture = cv2.VideoCapture(str(path))
    capture.set(cv2.CAP_PROP_POS_FRAMES, round(SHOWN * video.count))
    good, picture = capture.read()
    capture.release()
    if not good:
        raise SystemExit(f"{path}: expected {video.count} frames, could not read one in the middle.")
    return cv2.resize(picture, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)


if __name__ == "__main__":
    sys.exit(main())
