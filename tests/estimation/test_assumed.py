"""Sentences about what a fit took from the file."""

from __future__ import annotations

from monodyn.estimation.verdict import assumed


def test_proportions_that_nothing_determines(double):
    sizes = [double.parameter(name) for name in ("link1.tail", "link2.width")]
    assert assumed.proportions(sizes) == [
        "Neither a picture nor this motion determines link1.tail and link2.width: within a factor of 1.6 "
        "(one standard deviation) they are "
        "taken in proportion to the length of their body, as in the file, and the intervals contain "
        "that; measured values, given with --fix, would make them narrower."
    ]
    assert assumed.proportions(sizes[:1]) == [
        "Neither a picture nor this motion determines link1.tail: within a factor of 1.6 (one "
        "standard deviation) it is taken in "
        "proportion to the length of its body, as in the file, and the intervals contain that; a measured "
        "value, given with --fix, would make them narrower."
    ]
    assert assumed.proportions([]) == []


def test_thicknesses_that_the_motion_hardly_determines(double):
    both = [double.parameter(f"link{k}.thickness") for k in (1, 2)]
    assert assumed.thicknesses(both) == [
        "No picture shows a thickness along the line of sight, and the motion hardly determines "
        "link1.thickness and link2.thickness: within a factor of 2 they are taken in proportion to the main "
        "geom of their body, as in the file; the lengths depend on it, so give measured values with --fix."
    ]
    assert assumed.thicknesses(both[:1]) == [
        "No picture shows a thickness along the line of sight, and the motion hardly determines "
        "link1.thickness: within a factor of 2 it is taken in proportion to the main geom of its body, as in "
        "the file; the lengths depend on it, so give a measured value with --fix."
    ]
    assert assumed.thicknesses([]) == []
