"""Good input to which one thing is done, drawn from a seed: clips, models, tables and folders of runs.

Every function takes a generator and what is good, and returns a file or a folder that a user might have.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

Change = Callable[[np.random.Generator, str], str]
"""Does something to a text."""
ODD_NUMBERS = (
    "nan", "inf", "-inf", "1e300", "-1e300", "1e-300", "0", "-0", "-1", "1e20", "0.1.2", "1,5", "abc", "",
    "٣", "0x10", "1e999", "99999999999999999999", "½", "--", "None",
)  # fmt: skip
"""What may stand in the place of a number."""
ODD_NAMES = (
    "a b.mp4", "ü-π-漢.mp4", "-dash.mp4", "quote'\".mp4", "percent%d.mp4", "[bold]x[red].mp4",
    "line\nbreak.mp4", "x" * 200 + ".mp4", "noextension", "clip.txt", "clip.MOV", "clip%03d.png",
)  # fmt: skip
"""Names of a file."""
SIZES = ((1, 1), (2, 2), (16, 2), (2, 16), (3, 5), (15, 15), (17, 33), (64, 48), (400, 10))
"""Sizes of pictures [px]."""
RATES = (Fraction(1, 100), Fraction(1), Fraction(30000, 1001), Fraction(240), Fraction(10000))
"""Frames a second."""


def damaged_bytes(rng: np.random.Generator, content: bytes) -> bytes:
    """Return content of which bytes were changed, lost, doubled or cut off.

    Args:
        rng: What is done, and where.
        content: The good one.
    """
    data, size = bytearray(content), len(content)
    at = int(rng.integers(0, max(size, 1)))
    length = int(rng.integers(1, max(size // 4, 2)))
    kind = rng.choice(["flip", "zero", "cut", "lose", "double", "noise", "head", "nothing"])
    if kind == "flip":
        for place in rng.integers(0, max(size, 1), int(rng.integers(1, 40))):
            data[int(place)] ^= 1 << int(rng.integers(0, 8))
    elif kind == "zero":
        data[at : at + length] = bytes(len(data[at : at + length]))
    elif kind == "cut":
        del data[at:]
    elif kind == "lose":
        del data[at : at + length]
    elif kind == "double":
        data[at:at] = data[at : at + length]
    elif kind == "noise":
        data[at : at + length] = rng.bytes(len(data[at : at + length]))
    elif kind == "head":
        for place in rng.integers(0, min(size, 200), 6):
            data[int(place)] = int(rng.integers(0, 256))
    else:
        data.clear()
    return bytes(data)


def clip(rng: np.random.Generator, good: Path, folder: Path) -> Path:
    """Return a clip that is left there, or something in the place of one.

    Args:
        rng: What is done.
        good: A good clip.
        folder: Where it goes.
    """
    kind = rng.choice(["bytes", "coded", "pictures", "named", "other"], p=[0.35, 0.3, 0.15, 0.1, 0.1])
    if kind == "bytes":
        return _written(folder / "clip.mp4", damaged_bytes(rng, good.read_bytes()))
    if kind == "coded":
        return _coded(rng, good, folder)
    if kind == "pictures":
        return _pictures(rng, good, folder)
    if kind == "named":
        return Path(shutil.copy(good, folder / str(rng.choice(ODD_NAMES))))
    other = str(rng.choice(["missing", "empty", "folder", "text", "model"]))
    if other == "missing":
        return folder / "missing.mp4"
    if other == "folder":
        (folder / "clip").mkdir()
        return folder / "clip"
    return _written(folder / "clip.mp4", {"empty": b"", "text": b"a,b\n1,2\n"}.get(other, b"<mujoco/>"))


def _written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def frames_of(good: Path) -> list[np.ndarray]:
    """Return the pictures of a clip, RGB, each (height, width, 3).

    Args:
        good: The clip.
    """
    import av

    with av.open(str(good)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def _coded(rng: np.random.Generator, good: Path, folder: Path) -> Path:
    """Code the clip again, in other ways than cameras do or as some do."""
    import av
    import av.error
    import cv2

    pictures = frames_of(good)
    kind = str(rng.choice(["size", "count", "rate", "stamps", "aspect", "picture", "format", "grey"]))
    rate, size, stretch, form = Fraction(30), None, None, "yuv420p"
    name = str(rng.choice(["clip.mp4", "clip.mkv", "clip.avi", "clip.mov"]))
    if kind == "size":
        size = SIZES[int(rng.integers(len(SIZES)))]
    elif kind == "count":
        pictures = pictures[: int(rng.choice([1, 2, 3, 8, 20]))]
    elif kind == "rate":
        rate = RATES[int(rng.integers(len(RATES)))]
    elif kind == "aspect":
        stretch = [Fraction(255), Fraction(1, 255), Fraction(2), Fraction(3, 4)][int(rng.integers(4))]
    elif kind == "picture":
        pictures = _other_pictures(rng, pictures)
    elif kind == "format":
        form = str(rng.choice(["yuv444p", "yuv422p", "yuvj420p", "gray"]))
    elif kind == "grey":
        pictures = [np.repeat(p.mean(axis=2, keepdims=True), 3, axis=2).astype(np.uint8) for p in pictures]
    path = folder / ("clip.mkv" if kind == "stamps" else name)
    name = path.name
    # a coder that cannot leaves a file that was begun
    with suppress(av.error.FFmpegError), av.open(str(path), "w") as container:
        # a lossless coder takes every size and format
        stream: Any = container.add_stream("ffv1" if name.endswith(("mkv", "avi")) else "mpeg4", rate=rate)
        height, width = pictures[0].shape[:2]
        stream.width, stream.height = size or (width, height)
        stream.pix_fmt = form if name.endswith(("mkv", "avi")) else "yuv420p"
        if stretch is not None:
            stream.codec_context.sample_aspect_ratio = stretch
        for k, picture in enumerate(pictures):
            shown = picture if size is None else cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(shown), format="rgb24")
            if kind == "stamps":
                frame.pts = 3 * k + int(rng.integers(0, 3)) + (10**6 if k > 50 and name == "clip.mkv" else 0)
                frame.time_base = Fraction(1, 90)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def _other_pictures(rng: np.random.Generator, pictures: list[np.ndarray]) -> list[np.ndarray]:
    """Show something else, at times or always."""
    kind = str(rng.choice(["still", "black", "noise", "dark", "flash", "frozen", "cut", "negative"]))
    first, count = pictures[0], len(pictures)
    if kind == "still":
        return [first] * count
    if kind == "black":
        return [np.zeros_like(first)] * count
    if kind == "noise":
        return [rng.integers(0, 256, first.shape, dtype=np.uint8) for _ in pictures]
    if kind == "dark":
        return [(p // 8).astype(np.uint8) for p in pictures]
    if kind == "negative":
        return [255 - p for p in pictures]
    at = int(rng.integers(5, count - 5))
    if kind == "flash":
        return [*pictures[:at], np.full_like(first, 255), *pictures[at + 1 :]]
    if kind == "frozen":
        return [*pictures[:at], *([pictures[at]] * (count - at))]
    return [*pictures[:at], *([np.ascontiguousarray(first[::-1])] * (count - at))]


def _pictures(rng: np.random.Generator, good: Path, folder: Path) -> Path:
    """Leave a folder of numbered pictures, one of which is not as the others."""
    import cv2

    home = folder / "pictures"
    home.mkdir()
    for k, picture in enumerate(frames_of(good)[:40]):
        cv2.imwrite(str(home / f"frame_{k:04d}.png"), picture[:, :, ::-1])
    kind, one = (
        str(rng.choice(["gap", "size", "bytes", "alpha", "deep", "extra", "good"])),
        home / "frame_0007.png",
    )
    picture = cv2.imread(str(one))
    assert picture is not None
    if kind == "gap":
        one.unlink()
    elif kind == "size":
        cv2.imwrite(str(one), picture[:-3, :-5])
    elif kind == "bytes":
        one.write_bytes(damaged_bytes(rng, one.read_bytes()))
    elif kind == "alpha":
        cv2.imwrite(str(one), np.dstack([picture, picture[:, :, :1]]))
    elif kind == "deep":
        cv2.imwrite(str(one), picture.astype(np.uint16) * 257)
    elif kind == "extra":
        (home / "notes.txt").write_text("nothing", encoding="utf-8")
        (home / "frame_0007.jpg").write_bytes(b"\xff\xd8\xff")
    return home


def model(rng: np.random.Generator, good: str, folder: Path) -> Path:
    """Return a mechanism file to which one to three things were done.

    Args:
        rng: What is done.
        good: Text of a good one.
        folder: Where it goes.
    """
    text = _changed(rng, good, _CHANGES, 3)
    path = folder / f"model{rng.choice(['.xml', '.urdf', ''])}"
    coding = str(rng.choice(["utf-8", "utf-16", "latin-1"], p=[0.9, 0.05, 0.05]))
    return _written(path, text.encode(coding, errors="replace"))


def _changed(rng: np.random.Generator, text: str, changes: Sequence[Change], most: int) -> str:
    """Return a text to which one to ``most`` of several changes were made."""
    for _ in range(int(rng.integers(1, most + 1))):
        text = changes[int(rng.integers(len(changes)))](rng, text)
    return text


def _number(rng: np.random.Generator, text: str) -> str:
    """Put something odd, or another size, in the place of one number."""
    found = list(re.finditer(r"-?\d+\.?\d*", text))
    if not found:
        return text
    one = found[int(rng.integers(len(found)))]
    other = rng.choice([*ODD_NUMBERS, f"{float(one[0]) * np.exp(rng.normal()):.6g}"])
    return f"{text[: one.start()]}{other}{text[one.end() :]}"


def _line(rng: np.random.Generator, text: str) -> str:
    """Lose, double or move one line."""
    lines = text.splitlines()
    if not lines:
        return text
    at, to = (int(k) for k in rng.integers(0, len(lines), 2))
    line = lines.pop(at)
    kind = rng.choice(["lose", "double", "move"])
    lines[to:to] = [] if kind == "lose" else [line] * (2 if kind == "double" else 1)
    return "\n".join(lines)


def _word(rng: np.random.Generator, text: str) -> str:
    """Exchange one word for another one of the file or of the field."""
    words = re.findall(r"[A-Za-z_]\w*", text)
    if not words:
        return text
    others = [*words, "hinge", "slide", "ball", "free", "capsule", "mesh", "include", "equality", "site", "π"]
    return text.replace(str(rng.choice(words)), str(rng.choice(others)), int(rng.integers(1, 3)))


def _attribute(rng: np.random.Generator, text: str) -> str:
    """Lose one attribute."""
    found = list(re.finditer(r' \w+="[^"]*"', text))
    if not found:
        return text
    one = found[int(rng.integers(len(found)))]
    return text[: one.start()] + text[one.end() :]


def _put_in(rng: np.random.Generator, text: str) -> str:
    """Put something into the file that may not be there."""
    pieces = (
        '<include file="/etc/passwd"/>', '<include file="../other.xml"/>', "<!DOCTYPE x [<!ENTITY a 'b'>]>",
        "&a;", '<body name="more"><freejoint/><geom size="1"/></body>', "\x00", "<" * 50,
        '<joint name="joint1"/>', '<body name="b"/>' * 300, '<geom type="mesh" mesh="none"/>',
        '<joint type="slide" axis="1 0 0"/>', '<compiler angle="degree"/>', '<joint type="ball"/>',
        '<geom size="1 1 1" pos="nan 0 0"/>', "]]>",
    )  # fmt: skip
    at = text.find(">", int(rng.integers(0, max(len(text), 1)))) + 1
    return text[:at] + pieces[int(rng.integers(len(pieces)))] + text[at:]


def _bytes(rng: np.random.Generator, text: str) -> str:
    return damaged_bytes(rng, text.encode()).decode("utf-8", errors="replace")


_CHANGES: Sequence[Change] = (
    _number, _number, _number, _line, _word, _attribute, _attribute, _put_in, _bytes,
)  # fmt: skip


def table(rng: np.random.Generator, good: str, folder: Path) -> Path:
    """Return a table of joint positions to which one or two things were done.

    Args:
        rng: What is done.
        good: Text of a good one.
        folder: Where it goes.
    """
    text = _changed(rng, good, _TABLES, 2)
    coding = str(rng.choice(["utf-8", "utf-8-sig", "utf-16", "latin-1"], p=[0.8, 0.08, 0.06, 0.06]))
    return _written(
        folder / f"poses{rng.choice(['.csv', '.txt', ''])}", text.encode(coding, errors="replace")
    )


def _cell(rng: np.random.Generator, text: str) -> str:
    """Put something odd into one cell, or a few of a column."""
    rows = [line.split(",") for line in text.splitlines()]
    if len(rows) < 3:
        return text
    column, odd = int(rng.integers(max(len(rows[1]), 1))), str(rng.choice(ODD_NUMBERS))
    for at in rng.integers(1, len(rows), int(rng.choice([1, 1, 5, 200]))):
        if column < len(rows[at]):
            rows[at][column] = odd
    return "\n".join(",".join(row) for row in rows)


def _columns(rng: np.random.Generator, text: str) -> str:
    """Lose, double, exchange or rename a column, or lose the header."""
    rows = [line.split(",") for line in text.splitlines()]
    kind = str(rng.choice(["lose", "double", "exchange", "rename", "header", "constant"]))
    if not rows or len(rows[0]) < 2:
        return text
    at = int(rng.integers(len(rows[0])))
    for k, row in enumerate(rows):
        if at >= len(row):
            continue
        if kind == "lose":
            del row[at]
        elif kind == "double":
            row.append(row[at])
        elif kind == "exchange":
            row[0], row[at] = row[at], row[0]
        elif kind == "constant" and k:
            row[at] = "0.5"
    if kind == "rename" and at < len(rows[0]):
        rows[0][at] = str(rng.choice(["", "Time", "joint 1", "joint1", "theta", "time_s", "frame", "ü"]))
    return "\n".join(",".join(row) for row in (rows[1:] if kind == "header" else rows))


def _rows(rng: np.random.Generator, text: str) -> str:
    """Lose, double, turn round or shuffle rows."""
    head, *rows = text.splitlines() or [""]
    kind = str(rng.choice(["few", "none", "double", "turn", "shuffle", "tear", "many", "blank"]))
    if kind == "few":
        rows = rows[: int(rng.choice([1, 2, 3, 5, 9, 15]))]
    elif kind == "none":
        rows = []
    elif kind == "double":
        rows = [row for row in rows for _ in range(2)]
    elif kind == "turn":
        rows = rows[::-1]
    elif kind == "shuffle":
        rng.shuffle(rows)
    elif kind == "tear" and rows:
        rows[-1] = rows[-1][: len(rows[-1]) // 2]
    elif kind == "many":
        rows = rows * 30
    elif kind == "blank":
        rows = [line for row in rows for line in (row, "")]
    return "\n".join([head, *rows])


def _written_otherwise(rng: np.random.Generator, text: str) -> str:
    """Write the same table as another program would."""
    kind = str(rng.choice(["semicolon", "tab", "comma", "quotes", "crlf", "comment", "blanks", "bytes"]))
    if kind == "comma":
        return text.replace(",", ";").replace(".", ",")
    if kind == "quotes":
        return "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in text.splitlines())
    if kind == "bytes":
        return _bytes(rng, text)
    changes = {
        "semicolon": (",", ";"),
        "tab": (",", "\t"),
        "crlf": ("\n", "\r\n"),
        "comment": ("\n", "\n# measured\n"),
        "blanks": (",", "  ,  "),
    }
    return text.replace(*changes[kind], 1 if kind == "comment" else -1)


_TABLES: Sequence[Change] = (
    _cell,
    _cell,
    _columns,
    _rows,
    _written_otherwise,
)


def run_folder(rng: np.random.Generator, good: Path, folder: Path) -> Path:
    """Return the folder of a run of which one file was changed or lost.

    Args:
        rng: What is done.
        good: A good one.
        folder: Where it goes.
    """
    home = folder / "run"
    shutil.copytree(good, home)
    files = sorted(path for path in home.iterdir() if path.suffix in (".json", ".xml", ".csv", ".urdf"))
    one = files[int(rng.integers(len(files)))]
    kind = str(rng.choice(["lose", "bytes", "number", "empty", "folder"]))
    text = one.read_text(encoding="utf-8")
    if kind in ("lose", "folder"):
        one.unlink()
    if kind == "folder":
        one.mkdir()
    elif kind == "bytes":
        one.write_bytes(damaged_bytes(rng, one.read_bytes()))
    elif kind == "number":
        one.write_text(_number(rng, text), encoding="utf-8")
    elif kind == "empty":
        one.write_text("", encoding="utf-8")
    return home
