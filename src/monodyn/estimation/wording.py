"""Numbers, shares and lists of names as the sentences of a fit write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from monodyn.mechanism import Mechanism


def listed(names: Sequence[str], most: int = 6) -> str:
    """Write names as a list: ``a, b and c``; a long one is cut short.

    Args:
        names: At least one name.
        most: Names that are written out; the rest are counted.

    Returns:
        The list as part of a sentence.
    """
    names = list(names)
    if len(names) > most:
        names = [*names[:most], f"{len(names) - most} more"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def amount(mechanism: Mechanism, joint: str, value: float) -> str:
    """Write a difference of joint positions: degrees for a hinge, millimetres for a slide.

    Args:
        mechanism: Gives the kind of the joint.
        joint: Name of the joint.
        value: The difference [rad or m].

    Returns:
        Number and unit.
    """
    kind = next(j.kind for j in mechanism.joints if j.name == joint)
    return f"{np.degrees(value):.3g} deg" if kind == "hinge" else f"{1000.0 * value:.3g} mm"


def amounts(mechanism: Mechanism, by_joint: Mapping[str, float]) -> str:
    """Write one difference for every joint, as ``amount`` does, each with the joint's name.

    Args:
        mechanism: Gives the kinds of the joints.
        by_joint: Difference by joint [rad or m].

    Returns:
        The list as part of a sentence.
    """
    return listed([f"{amount(mechanism, name, value)} ({name})" for name, value in by_joint.items()], 12)


def percent(share: float) -> str:
    """Write a share in per cent.

    Args:
        share: The share, 1 for all.

    Returns:
        Number and unit, two digits below ten per cent.
    """
    return f"{100 * share:.0f} %" if abs(share) >= 0.095 else f"{100 * share:.2g} %"


def two_digits(value: float) -> str:
    """Return a number with two digits, without an exponent.

    Args:
        value: The number.
    """
    return f"{float(f'{value:.2g}'):g}"
