"""The mechanisms that come with the package, by name."""

from __future__ import annotations

import re
from pathlib import Path

from monodyn.choices import BUNDLED_FILES
from monodyn.errors import MechanismError

LONGEST_CHAIN = 10
"""Links of a bundled chain, at most."""

_HEAD = """<mujoco>
  <option gravity="0 0 -9.81"/>
  <default>
    <joint type="hinge" axis="0 -1 0" damping="0.001"/>
    <geom type="box" density="2700"/>
  </default>
  <worldbody>
"""


def bundled(name: str) -> str | Path | None:
    """Return a bundled mechanism: the path of its file or the text of a chain; None if it is not bundled.

    Args:
        name: ``single``, ``double``, ``triple``, ``bob``, ``ball``, ``cartpole`` or ``chain:N``.

    Raises:
        MechanismError: The number of links of a chain is not a whole number from 1 to 10.
    """
    if name in BUNDLED_FILES:
        return Path(__file__).parent / "models" / f"{name}.xml"
    if not name.startswith("chain:"):
        return None
    count = name.removeprefix("chain:")
    if not re.fullmatch(r"\d{1,3}", count) or not 1 <= int(count) <= LONGEST_CHAIN:
        raise MechanismError(
            f"mechanism '{name}': expected 1 to {LONGEST_CHAIN} links, got '{count}'; write for example "
            f"'chain:4'."
        )
    return chain(int(count))


def chain(links: int) -> str:
    """Return the MJCF text of a chain of equal links, each hinged before the one above it.

    Args:
        links: Number of links.
    """
    lines = []
    for k in range(1, links + 1):
        pos = ' pos="0.2 -0.008 0"' if k > 1 else ""
        half, middle = (0.1075, 0.0925) if k == links else (0.115, 0.1)
        lines.append(f'<body name="link{k}"{pos}><joint name="joint{k}"/>')
        lines.append(f'<geom size="{half} 0.003 0.015" pos="{middle} 0 0"/>')
    return _HEAD + "\n".join(lines) + "</body>" * links + "\n  </worldbody>\n</mujoco>\n"
