"""The text of a mechanism file and of the files it names, read before MuJoCo sees any of it.

A mechanism file may come from anywhere: it may only read files of its own folder, and may not declare
entities. What it names is read here; what MuJoCo receives is one text and the bytes of the meshes.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from xml.parsers import expat

from monodyn.errors import MechanismError
from monodyn.names import short

MAX_TEXT_BYTES = 4_000_000
MAX_ATTRIBUTES = 100
"""Of one element: the time in which MuJoCo reads them grows with their square."""
MAX_ELEMENTS = 5000
"""Of a mechanism, with all it includes and every copy: so does that of its elements."""
MAX_MESH_BYTES = 200_000_000
MAX_INCLUDES = 64
MAX_COPIES = 1000
MAX_DEPTH = 100

UNUSED = {
    "actuator", "sensor", "keyframe", "text", "tuple", "visual", "statistic", "size", "contact", "texture",
    "material",
    "transmission", "gazebo", "camera", "light",
}  # fmt: skip
"""Elements that cannot change the motion or the shapes; they are dropped, with the files they name."""

NAN = re.compile(r"[+-]?nan(\(\w*\))?", re.IGNORECASE)
"""How C writes what is no number."""

TEXTS = {"name", "class", "childclass", "mesh", "joint", "joint1", "joint2", "body1", "body2", "link", "file"}
"""Attributes that hold names, which may be anything."""

REFUSED = {
    "plugin": "plugins", "extension": "plugins", "composite": "composite bodies",
    "flexcomp": "flexible bodies",
    "flex": "flexible bodies", "deformable": "flexible bodies", "hfield": "height fields", "skin": "skins",
    "attach": "attached models", "model": "attached models",
}  # fmt: skip


def read_mechanism(path: Path) -> tuple[str, bool, dict[str, bytes]]:
    """Read a mechanism file with everything it includes.

    Args:
        path: The MJCF or URDF file.

    Returns:
        The text with includes put in place, True if it is URDF, and the bytes of its meshes by the name that
        the text now has for them.

    Raises:
        MechanismError: A file is missing, too big, not XML or outside the folder, or the text holds something
            that is not supported.
    """
    root = parse(path)
    if root.tag not in ("mujoco", "robot"):
        raise MechanismError(
            f"{path.name}: expected the root element <mujoco> (MJCF) or <robot> (URDF), got <{root.tag}>; "
            f"give an MJCF or URDF file."
        )
    folder = path.resolve().parent
    urdf = root.tag == "robot"
    _include(root, folder, [0])
    _drop(root, path.name, urdf, [0])
    if urdf:
        _keep_looks(root)
    meshes = _take_meshes(root, path.name, folder)
    return ET.tostring(root, encoding="unicode"), urdf, meshes


def _keep_looks(root: ET.Element) -> None:
    """Make MuJoCo keep a URDF's visual geometry and its fixed links."""
    extra = root.find("mujoco")
    extra = ET.SubElement(root, "mujoco") if extra is None else extra
    compiler = extra.find("compiler")
    compiler = ET.SubElement(extra, "compiler") if compiler is None else compiler
    compiler.attrib |= {"discardvisual": "false", "fusestatic": "false", "strippath": "false"}


def parse(path: Path) -> ET.Element:
    """Return the root element of one XML file.

    Args:
        path: The file.

    Raises:
        MechanismError: It is missing, unreadable, too big, too deep, not XML, or declares a document type, or
            an element has too many attributes.
    """
    text = read_bytes(path, MAX_TEXT_BYTES, path.name)

    def refuse(*_: object) -> None:
        raise MechanismError(
            f"{path.name}: document types and entities are not supported; remove <!DOCTYPE>."
        )

    # Expat reads it first, because ElementTree would resolve entities and recurse before anything can be
    # refused.
    depth = 0

    def enter(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        if len(attributes) > MAX_ATTRIBUTES:
            raise MechanismError(
                f"{path.name}: <{short(tag)}>: expected at most {MAX_ATTRIBUTES} attributes, got "
                f"{len(attributes)}; leave out what it does not need."
            )
        depth += 1
        if depth > MAX_DEPTH:
            raise MechanismError(
                f"{path.name}: expected at most {MAX_DEPTH} elements inside one another, got more; simplify "
                "the file."
            )

    def leave(*_: object) -> None:
        nonlocal depth
        depth -= 1

    scanner = expat.ParserCreate()
    scanner.StartDoctypeDeclHandler = refuse
    scanner.StartElementHandler, scanner.EndElementHandler = enter, leave
    try:
        scanner.Parse(text, True)
        return ET.fromstring(text)
    except (expat.ExpatError, ET.ParseError, ValueError, LookupError) as error:
        raise MechanismError(
            f"{path.name}: expected MJCF or URDF text, got text that is not XML ({error}); correct the file."
        ) from None


def read_bytes(path: Path, most: int, shown: str) -> bytes:
    """Return the content of a regular file of limited size.

    Args:
        path: The file.
        most: Largest size [byte].
        shown: Name for the message.

    Raises:
        MechanismError: It is missing, not a regular file, unreadable or too big.
    """
    try:
        if not path.is_file():
            what = "a folder" if path.is_dir() else "no such file"
            raise MechanismError(f"{shown}: expected a file, got {what}; check the path.")
        if path.stat().st_size > most:
            raise MechanismError(
                f"{shown}: expected at most {most / 1e6:g} MB, got {path.stat().st_size / 1e6:.0f} MB; "
                f"give a smaller file."
            )
        return path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise MechanismError(
            f"{shown}: expected a readable file, got '{reason}'; check the path and its permissions."
        ) from None


def inside(folder: Path, name: str, shown: str) -> Path:
    """Return the path of a file named by a mechanism file.

    Args:
        folder: The mechanism file's folder, resolved.
        name: The path that the file's name stands for.
        shown: The name as the file has it.

    Raises:
        MechanismError: The name leads out of the folder.
    """
    try:
        path = (folder / name).resolve()
    except (OSError, ValueError):
        path = folder.parent
    if not path.is_relative_to(folder):
        raise MechanismError(
            f"file '{shown}': expected a file in the mechanism's own folder, got a path that leads out of "
            "it; copy the file there."
        )
    return path


def _include(element: ET.Element, folder: Path, count: list[int], depth: int = 0) -> None:
    """Replace every <include> by the children of the file it names; ``count`` holds how many there were."""
    if depth > MAX_DEPTH:
        raise MechanismError(
            f"include: expected at most {MAX_DEPTH} elements inside one another, got more; simplify the "
            f"files."
        )
    place = 0
    while place < len(element):
        child = element[place]
        if child.tag != "include":
            _include(child, folder, count, depth + 1)
            place += 1
            continue
        count[0] += 1
        if count[0] > MAX_INCLUDES:
            raise MechanismError(
                f"include: expected at most {MAX_INCLUDES} included files, got more; check for a file that "
                f"includes itself."
            )
        included = parse(inside(folder, child.get("file", ""), child.get("file", "")))
        # ``place`` stays: what has been put in may be an include itself.
        element[place : place + 1] = list(included)


def _drop(element: ET.Element, where: str, urdf: bool, total: list[int], copies: int = 1) -> None:
    """Drop what cannot matter and refuse by name what could; ``total`` holds how many elements were kept,
    ``copies`` are those of replicates around it."""
    element[:] = [child for child in element if child.tag not in UNUSED or (urdf and child.tag == "visual")]
    for child in element:
        tag = child.tag
        if tag in REFUSED and not (urdf and tag == "model"):
            raise MechanismError(f"{where}: <{tag}>: {REFUSED[tag]} are not supported; remove them.")
        if tag == "tendon" and len(child):
            name = child[0].get("name", "")
            raise MechanismError(f"{where}: tendon '{name}': tendons are not supported; remove them.")
        if tag == "equality":
            _refuse_loops(child, where)
        # Replicates inside of replicates multiply. The compiler would make every copy before anything could
        # be refused, so that the product is bounded here.
        number = re.fullmatch(r"\s*\d{1,9}\s*", child.get("count", "0") if tag == "replicate" else "1")
        count = int(number[0]) if number else -1
        if not 1 <= count * copies <= MAX_COPIES:
            raise MechanismError(
                f"{where}: <replicate>: expected a count from 1 to {MAX_COPIES}, got '{child.get('count')}'; "
                f"correct it."
            )
        total[0] += copies
        if total[0] > MAX_ELEMENTS:
            raise MechanismError(
                f"{where}: expected at most {MAX_ELEMENTS} elements, those of every <replicate> and "
                "<include> counted, got more; leave out what does not move."
            )
        if urdf and tag == "joint" and child.get("type") in ("floating", "planar"):
            raise MechanismError(
                f"{where}: joint '{child.get('name', '')}': expected a revolute, continuous, prismatic or "
                f"fixed joint, got a {child.get('type')} one; replace it."
            )
        if tag == "mimic":
            raise MechanismError(
                f"{where}: joint '{element.get('name', '')}': mimic joints couple joints and are not "
                "supported; remove <mimic>."
            )
        # MuJoCo takes nan for a number; after compilation nothing shows which element it came from.
        for name, value in child.attrib.items():
            if name not in TEXTS and any(NAN.fullmatch(word) for word in value.split()):
                raise MechanismError(f"{where}: <{tag}>: expected numbers in '{name}', got nan; correct it.")
        child.attrib.pop("material", None)
        _drop(child, where, urdf, total, count * copies)


def _refuse_loops(equality: ET.Element, where: str) -> None:
    """Raise if an active equality constraint closes a loop or couples joints."""
    for k, child in enumerate(equality):
        if child.get("active", "true") == "false":
            continue
        name = child.get("name") or child.get("body1") or child.get("joint1") or f"number {k + 1}"
        raise MechanismError(
            f"{where}: equality <{child.tag}> '{name}': closed loops and coupled joints are not supported; "
            f"remove it."
        )


def _take_meshes(root: ET.Element, where: str, folder: Path) -> dict[str, bytes]:
    """Read every mesh that is named, and name it by what MuJoCo will be given."""
    meshdir = ""
    for compiler in root.iter("compiler"):
        meshdir = compiler.attrib.pop("meshdir", compiler.get("assetdir", meshdir))
        for name in ("assetdir", "texturedir"):
            compiler.attrib.pop(name, None)
    meshes: dict[str, bytes] = {}
    for element in root.iter():
        for attribute in [a for a in element.attrib if a.startswith("file")]:
            given = element.attrib[attribute]
            if element.tag != "mesh" or attribute not in ("file", "filename"):
                raise MechanismError(f"{where}: <{element.tag}>: files are read for meshes only; remove it.")
            plain = re.sub(r"^(package://[^/]*/|file://)", "", given)
            path = inside(folder, str(Path(meshdir) / plain) if root.tag == "mujoco" else plain, given)
            # MuJoCo sees neither paths nor folders, only these names and the bytes that go with them.
            key = f"mesh{len(meshes)}{path.suffix.lower()}"
            meshes[key] = read_bytes(path, MAX_MESH_BYTES, f"mesh '{given}'")
            if root.tag == "mujoco" and "name" not in element.attrib:
                element.set("name", Path(given).stem)
            element.set(attribute, key)
    return meshes
