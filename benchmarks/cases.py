"""The clips of the robustness benchmark: one thing is unusual in each.

Sizes, frictions and cameras are those of desk-top mechanisms; nothing here was chosen for how it turns out.
"""

from __future__ import annotations

from dataclasses import replace

from spec import Case, Colour, Part

DARK, RED, BLUE, WHITE = (45, 44, 60), (205, 60, 40), (40, 90, 190), (236, 234, 228)
GREY_WALL = (124, 124, 124)
RED_AS_GREY = (206, 86, 103)
"""A red of the same luma as ``GREY_WALL``."""


def chain(
    lengths: tuple[float, ...],
    widths: tuple[float, ...] | float = 0.028,
    colours: tuple[Colour, ...] = (DARK,),
    **more: float | str,
) -> tuple[Part, ...]:
    """Return links hinged one before the other.

    Args:
        lengths: Of the links [m].
        widths: Of the links [m].
        colours: Of the links; the last holds for those that follow.
        more: Fields that all links share.
    """
    wide = widths if isinstance(widths, tuple) else (widths,) * len(lengths)
    return tuple(
        Part(length, wide[i], colour=colours[min(i, len(colours) - 1)], parent=i - 1, **more)  # pyright: ignore
        for i, length in enumerate(lengths)
    )


def _bob(length: float, width: float, ball: float, colour: Colour = DARK) -> tuple[Part, ...]:
    return (Part(length, width, shape="capsule", ball=ball, colour=colour, damping=1e-3),)


def _cartpole(
    cart: tuple[float, float, float], pole: tuple[float, float], colours: tuple[Colour, Colour]
) -> tuple[Part, ...]:
    wide, high, mass = cart
    return (
        Part(wide, high, 0.02, colours[0], kind="slide", mass=mass, damping=0.06),
        Part(*pole, 0.008, colours[1], parent=0, layer=0.02),
    )


_TWO = chain((0.22, 0.18), (0.03, 0.027))
_SWING = (-0.6, 0.5)
_SINGLE = [
    Case("single_short_thick", chain((0.12,), 0.04), (-0.4,)),
    Case("single_long_thin", chain((0.45,), 0.012), (-0.7,), fill=0.9),
    Case("single_small_swing", chain((0.27,), 0.03), (-1.4,)),
    Case("single_early_rest", chain((0.27,), 0.03, damping=0.012), (-0.6,), seconds=10.0),
    Case("single_full_turns", chain((0.25,), 0.028, (RED,)), (1.2,), (9.0,), seconds=5.0, wall="mottled"),
    Case("single_cylinder", chain((0.25,), 0.02, (BLUE,), shape="cylinder"), (-0.3,)),
    Case("single_ellipsoid", chain((0.25,), 0.035, (BLUE,), shape="ellipsoid"), (-0.3,)),
    Case("single_capsule", chain((0.25,), 0.03, shape="capsule"), (-2.6,), wall="room"),
]
_DOUBLE = [
    Case("double_second_twice", chain((0.13, 0.26), (0.028, 0.024)), _SWING),
    Case("double_first_twice", chain((0.26, 0.13), (0.03, 0.026)), _SWING),
    Case("double_two_colours", chain((0.22, 0.18), 0.03, (RED, BLUE)), _SWING, wall="mottled"),
    Case("double_low_contrast", chain((0.22, 0.18), 0.03, ((150, 146, 136),)), _SWING, wall="plain"),
    Case(
        "double_equal_luma", chain((0.22, 0.18), 0.03, (RED_AS_GREY,)), _SWING, wall="plain", base=GREY_WALL
    ),
    Case("double_light_on_dark", chain((0.22, 0.18), 0.03, (WHITE,)), _SWING, base=(52, 54, 60)),
    Case("double_one_low", chain((0.22, 0.18), 0.03, (DARK, (165, 160, 150))), _SWING, wall="plain"),
    Case("double_overhang", chain((0.2, 0.17), 0.03, (RED, BLUE), tail=0.016, tip=0.014), _SWING, stand=True),
    Case("double_bolts", chain((0.22, 0.18), 0.034, (BLUE, RED)), _SWING, bolts=(225, 222, 215)),
    Case("double_shiny", chain((0.22, 0.18), 0.03, ((90, 88, 100),)), _SWING, shine=0.6),
    Case("double_inverted", _TWO, (1.3, 0.4), seconds=6.0),
    Case("double_wild", _TWO, (2.4, 0.6), (4.0, 6.0), wall="mottled"),
    Case("double_small_swing", _TWO, (-1.35, -0.15)),
    Case("double_early_rest", chain((0.22, 0.18), 0.03, damping=0.006), _SWING, seconds=8.0),
    Case("double_wide", chain((0.2, 0.16), 0.06, (RED, BLUE)), _SWING),
]
_PICTURE = [
    Case("picture_portrait", _TWO, _SWING, size=(480, 854), pivot=(0.5, 0.4)),
    Case("picture_full_hd", chain((0.22, 0.18), 0.03, (RED, BLUE)), _SWING, size=(1920, 1080), seconds=4.0),
    Case("picture_320x240", _TWO, _SWING, size=(320, 240)),
    Case("picture_60_fps", _TWO, _SWING, rate=60, seconds=4.0),
    Case("picture_24_fps", _TWO, _SWING, rate=24),
    Case("picture_small", _TWO, _SWING, fill=0.3, wall="room"),
    Case("picture_filling", _TWO, _SWING, fill=1.15, pivot=(0.5, 0.3)),
    Case("picture_leaving", _TWO, (0.3, 0.6), fill=1.1, pivot=(0.5, 0.25)),
    Case("picture_pivot_at_border", _TWO, (-1.0, 0.5), fill=1.0, pivot=(0.5, 0.04)),
    Case("picture_corner", _TWO, _SWING, fill=0.7, pivot=(0.2, 0.4)),
    Case("picture_wide_angle", _TWO, _SWING, fovy=75.0),
    Case("picture_tele", _TWO, _SWING, fovy=12.0),
    Case("picture_blur", _TWO, _SWING, shutter=0.5),
    Case("picture_noise", _TWO, _SWING, noise=7.0, crf=26),
    Case("picture_crf_32", _TWO, _SWING, crf=32, wall="mottled"),
    Case("wall_stripes", chain((0.22, 0.18), 0.03, (RED, BLUE)), _SWING, wall="stripes"),
    Case("wall_room_stand", chain((0.22, 0.18), 0.03, (RED, BLUE)), _SWING, wall="room", stand=True),
    Case("clutter_elsewhere", _TWO, _SWING, clutter="elsewhere", fill=0.6),
    Case("clutter_beside", chain((0.22, 0.18), 0.03, (RED, BLUE)), _SWING, clutter="beside", fill=0.6),
    Case("clutter_under", chain((0.22, 0.18), 0.03, (RED, BLUE)), _SWING, clutter="under"),
]
_OTHERS = [
    Case("triple", chain((0.14, 0.14, 0.11), (0.026, 0.024, 0.022), (RED, BLUE, DARK)), (-0.7, 0.3, 0.6)),
    Case("triple_one_colour", chain((0.12, 0.16, 0.10), 0.024), (-0.9, 0.5, -0.4), wall="mottled"),
    Case(
        "chain4", chain((0.1, 0.11, 0.1, 0.09), 0.02, (RED, BLUE, DARK, (30, 130, 70))), (-0.9, 0.3, 0.3, 0.3)
    ),
    Case("chain4_one_colour", chain((0.1, 0.11, 0.1, 0.09), 0.02, damping=3e-4), (-1.0, 0.3, -0.3, 0.4)),
    Case("bob_small_ball", _bob(0.28, 0.008, 0.014), (-0.9,)),
    Case("bob_large_ball", _bob(0.2, 0.012, 0.05, RED), (-0.6,), wall="mottled"),
    Case("bob_fat_rod", _bob(0.24, 0.022, 0.026, BLUE), (-2.5,), stand=True),
    Case(
        "cart_wide_heavy", _cartpole((0.22, 0.06, 0.9), (0.24, 0.024), (BLUE, BLUE)), (-0.08, -2.4), fill=0.9
    ),
    Case(
        "cart_narrow_light", _cartpole((0.07, 0.05, 0.12), (0.26, 0.02), (RED, DARK)), (0.05, -0.4), fill=0.9
    ),
    Case(
        "cart_off_centre",
        _cartpole((0.12, 0.06, 0.3), (0.25, 0.022), (DARK, DARK)),
        (-0.1, -2.3),
        pivot=(0.68, 0.35),
    ),
    Case(
        "cart_swing_up", _cartpole((0.12, 0.06, 0.4), (0.2, 0.022), (RED, BLUE)), (0.0, 1.3), pivot=(0.5, 0.5)
    ),
    Case(
        "slide_only",
        (Part(0.12, 0.06, 0.02, BLUE, kind="slide", slope=0.06, damping=0.02),),
        (-0.16,),
        (0.58,),
        rate=60,
        seconds=1.9,
        fill=0.3,
        pivot=(0.5, 0.5),
    ),
    Case(
        "tree_two_branches",
        (
            Part(0.2, 0.03, colour=DARK),
            Part(0.12, 0.024, colour=RED, parent=0, at=1.0),
            Part(0.13, 0.024, colour=BLUE, parent=0, at=0.5, layer=0.016),
        ),
        (-0.7, 0.9, -0.8),
    ),
    Case(
        "cart_two_poles",
        (
            Part(0.26, 0.05, 0.02, DARK, kind="slide", mass=0.5, damping=0.06),
            Part(0.2, 0.022, colour=RED, parent=0, at=1.4, layer=0.02),
            Part(0.15, 0.022, colour=BLUE, parent=0, at=0.6, layer=0.02),
        ),
        (0.0, -0.6, -2.2),
        fill=0.7,
    ),
]
_RENDERED = [
    replace(case, name=f"rendered_{case.name}", engine="mujoco")
    for case in [*_SINGLE[:1], *_SINGLE[5:8], *_DOUBLE, *_PICTURE[:3], *_OTHERS]
    if case.name not in ("double_shiny", "double_early_rest", "double_low_contrast", "double_one_low")
]
"""The same mechanisms with lamps and highlights."""

_ALL = [*_SINGLE, *_DOUBLE, *_PICTURE, *_OTHERS, *_RENDERED]
CASES = {case.name: replace(case, seed=k + 1) for k, case in enumerate(_ALL)}
"""Every case by name, each with a seed of its own."""
