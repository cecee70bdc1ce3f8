"""Parameters of a mechanism and what follows from them: tree, shapes, bounds, choices."""

import math

import numpy as np
import pytest

from models import mjcf, read
from monodyn.errors import MechanismError, SettingsError
from monodyn.mechanism import Measured, Mechanism, load
from support import refuses

BOX = '<geom type="box" size="0.05 0.0025 0.01" pos="0.05 0 0" density="2700"/>'
HINGE = '<joint name="{}" axis="0 -1 0" damping="0.001"/>'


def _names(mechanism: Mechanism, kind: str) -> list[str]:
    return [p.name for p in mechanism.parameters if getattr(p, kind)]


def test_parameters_of_the_double_pendulum() -> None:
    mechanism = load("double")
    assert mechanism.bodies == ("link1", "link2")
    assert [(j.name, j.body, j.kind, j.sign) for j in mechanism.joints] == [
        ("joint1", "link1", "hinge", 1),
        ("joint2", "link2", "hinge", 1),
    ]
    assert _names(mechanism, "free") == [
        "link1.length", "link1.tail", "link1.tip", "link1.width", "link1.thickness",
        "link2.length", "link2.tail", "link2.width", "link2.offset", "link2.thickness",
        "joint1.damping", "joint2.damping",
    ]  # fmt: skip
    assert _names(mechanism, "follows") == [
        f"{body}.{what}" for body in mechanism.bodies for what in ("mass", "com_x", "com_y", "inertia")
    ]
    length = mechanism.parameter("link1.length")
    # The file's numbers are decimal, so the sums of two of them may differ in the last place.
    assert length.value == pytest.approx(0.2, rel=1e-12)
    assert (length.lower, length.upper, length.unit) == pytest.approx((0.0002, 200.0, "m"))
    assert mechanism.parameter("link1.tip").value == pytest.approx(0.015, rel=1e-12)
    assert mechanism.parameter("link1.mass").value == pytest.approx(2700 * 0.23 * 0.03 * 0.006, rel=1e-12)


def test_a_longer_link_moves_what_hangs_on_it() -> None:
    before = load("double")
    after = before.with_values({"link1.length": 0.3})
    assert after.tree.links[1, 0] == pytest.approx(0.3, rel=1e-12)
    # Its box reaches from the tail to the tip beyond the hinge; the other link's box is where its hinge is.
    box = after.shapes.points[:8, 0]
    assert (box.min(), box.max()) == pytest.approx((-0.015, 0.315), rel=1e-12)
    assert np.array_equal(after.shapes.points[8:], before.shapes.points[8:])
    assert after.values["link1.com_x"] == pytest.approx(0.15, rel=1e-12)
    assert after.values["link1.mass"] == pytest.approx(2700 * 0.33 * 0.03 * 0.006, rel=1e-12)
    assert before.values["link1.length"] == pytest.approx(0.2, rel=1e-12)


def test_which_joints_slide() -> None:
    assert load("cartpole").slides.tolist() == [True, False]
    assert load("double").slides.tolist() == [False, False]


def test_values_by_row_are_those_by_name() -> None:
    mechanism = load("double").with_torque("fourier", terms=1, period=0.5)
    named = {"link1.length": 0.3, "joint2.damping": 1e-4, "torque.period": 0.7}
    rows = mechanism.rows(tuple(named))
    moved, expected = mechanism.at_rows(rows, np.array([*named.values()])), mechanism.with_values(named)
    assert moved.values == expected.values
    assert np.array_equal(moved.tree.links, expected.tree.links)
    with refuses(MechanismError, "parameter 'torque.period': expected a value above 0 s, got -1."):
        mechanism.at_rows(rows, np.array([0.3, 1e-4, -1.0]))
    with refuses(MechanismError, "parameter 'link1.length': expected a number, got inf."):
        mechanism.at_rows(rows, np.array([np.inf, 1e-4, 0.7]))


def test_tail_tip_width_thickness_and_offset_change_only_the_box() -> None:
    mechanism = load("double").with_values(
        {
            "link1.tail": 0.02,
            "link1.tip": 0.0,
            "link1.width": 0.05,
            "link1.thickness": 0.01,
            "link2.offset": -0.02,
        }
    )
    points = mechanism.shapes.points
    assert points[:8].min(axis=0) == pytest.approx((-0.02, -0.025, -0.005), rel=1e-12)
    assert points[:8].max(axis=0) == pytest.approx((0.2, 0.025, 0.005), rel=1e-12)
    assert points[8:, 2].mean() == pytest.approx(-0.02, rel=1e-12)
    assert mechanism.tree.links[1, :2] == pytest.approx((0.2, 0.0))


def test_inertia_is_that_of_the_paper() -> None:
    """I = m (l^2 + w^2) / 12, l_c = l / 2 for a box from its hinge."""
    value = load("single").with_values({"link1.tail": 0.0, "link1.length": 0.25, "link1.width": 0.04}).values
    mass = 2700 * 0.25 * 0.04 * 0.006
    assert value["link1.mass"] == pytest.approx(mass, rel=1e-12)
    assert value["link1.com_x"] == pytest.approx(0.125, rel=1e-12)
    assert value["link1.inertia"] == pytest.approx(mass * (0.25**2 + 0.04**2) / 12, rel=1e-12)


def test_the_ball_of_bob_hangs_at_the_length() -> None:
    mechanism = load("bob").with_values(
        {"link1.length": 0.26, "link1.sphere.width": 0.06, "link1.width": 0.008}
    )
    shapes = mechanism.shapes
    assert shapes.radius == pytest.approx([0.004, 0.03], rel=1e-12)
    assert shapes.points == pytest.approx(np.array([[0, 0, 0], [0.26, 0, 0], [0.26, 0, 0]]), abs=1e-15)
    rod = 2700 * math.pi * (0.004**2 * 0.26 + 4 / 3 * 0.004**3)
    ball = 2700 * math.pi * 4 / 3 * 0.03**3
    assert mechanism.values["link1.mass"] == pytest.approx(rod + ball, rel=1e-12)
    assert mechanism.values["link1.com_x"] == pytest.approx(
        (rod * 0.13 + ball * 0.26) / (rod + ball), rel=1e-12
    )


def test_the_cart_grows_about_its_origin() -> None:
    mechanism = load("cartpole").with_values({"cart.length": 0.2, "cart.width": 0.1})
    cart = mechanism.shapes.points[:8]
    assert cart.min(axis=0)[:2] == pytest.approx((-0.1, -0.05), rel=1e-12)
    assert cart.max(axis=0)[:2] == pytest.approx((0.1, 0.05), rel=1e-12)
    assert mechanism.parameter("cart.mass").free
    assert not mechanism.parameter("cart.thickness").free


def test_a_hinge_on_the_rim_of_the_cart_moves_with_its_height(tmp_path) -> None:
    mechanism = read(
        tmp_path,
        mjcf(
            '<body name="cart"><joint name="s" type="slide" axis="1 0 0"/><geom type="box" '
            'size=".06 .01 .03"/>'
            f'<body name="pole" pos="0 -.02 .03">{HINGE.format("h")}{BOX}</body></body>'
        ),
    )
    taller = mechanism.with_values({"cart.width": 0.1})
    assert taller.tree.links[1, :2] == pytest.approx((0.0, 0.05), abs=1e-12)


def test_scaling_every_size_scales_the_picture() -> None:
    """What the lengths have in common is one scale: no point may be left behind."""
    for name in ("double", "bob", "cartpole", "chain:4"):
        mechanism = load(name)
        sizes = {p.name: 3 * p.value for p in mechanism.parameters if p.unit == "m" and not p.follows}
        grown = mechanism.with_values(sizes)
        assert grown.shapes.points == pytest.approx(3 * mechanism.shapes.points, rel=1e-12, abs=1e-15)
        assert grown.shapes.radius == pytest.approx(3 * mechanism.shapes.radius, rel=1e-12)
        assert grown.tree.links[:, :2] == pytest.approx(3 * mechanism.tree.links[:, :2], rel=1e-12, abs=1e-15)


def test_a_given_inertial_scales_with_the_link(tmp_path) -> None:
    mechanism = read(
        tmp_path,
        mjcf(
            f'<body name="a">{HINGE.format("j")}<inertial pos=".04 0 .01" mass=".2" diaginertia="1e-4 2e-4 '
            f'1e-4"/>'
            '<geom type="box" size="0.05 0.0025 0.01" pos="0.05 0 0"/></body>'
        ),
    )
    assert mechanism.parameter("a.mass").free
    assert not mechanism.parameter("a.mass").follows
    assert "a.density" not in mechanism.values
    value = mechanism.with_values({"a.length": 0.2, "a.mass": 0.3}).values
    # Across, a place inside the box goes with the width.
    expected = {"a.com_x": 0.08, "a.com_y": 0.01, "a.inertia": 2e-4 * 1.5 * 4}
    assert {name: value[name] for name in expected} == pytest.approx(expected, rel=1e-12)


def test_a_mass_that_is_fixed_no_longer_follows() -> None:
    mechanism = load("double").with_choices(fix={"link1.mass": 0.2}, free=["link2.com_x"])
    mass, com = mechanism.parameter("link1.mass"), mechanism.parameter("link2.com_x")
    assert (mass.value, mass.free, mass.follows) == (0.2, False, False)
    assert (com.value, com.free, com.follows) == (pytest.approx(0.0925), True, False)
    uniform = load("double").values
    # The shape of the body stays, so its inertia goes with its mass.
    ratio = 0.2 / uniform["link1.mass"]
    assert mechanism.values["link1.inertia"] == pytest.approx(ratio * uniform["link1.inertia"], rel=1e-12)
    assert mechanism.with_values({"link1.length": 0.3}).values["link1.mass"] == 0.2


def test_free_bodies_start_from_the_uniform_ones() -> None:
    uniform = load("cartpole").with_choices(fix={"link1.com_y": 0.0})
    free = uniform.with_bodies("free")
    assert free.values == pytest.approx(uniform.values, rel=1e-12)
    assert np.allclose(free.tree.links, uniform.tree.links, rtol=1e-12, atol=0)
    freed = set(_names(free, "free")) - set(_names(uniform, "free"))
    assert freed == {"cart.com_x", "cart.com_y", "cart.inertia", "link1.mass", "link1.com_x", "link1.inertia"}
    assert set(_names(uniform, "free")) - set(_names(free, "free")) == {"link1.thickness"}
    assert free.with_values({"link1.length": 0.4}).values["link1.mass"] == uniform.values["link1.mass"]
    assert free.with_bodies("uniform").values == pytest.approx(uniform.values, rel=1e-12)


def test_directions_are_derivatives_of_the_tree() -> None:
    for mechanism in (
        load("bob"),
        load("triple").with_bodies("free"),
        load("cartpole").with_values({"gravity": 3.7}),
    ):
        names = [p.name for p in mechanism.parameters if not p.follows and p.value > 0]
        directions = mechanism.directions(names)
        for k, name in enumerate(names):
            value = mechanism.parameter(name).value
            step = 1e-4 * value
            high, low = (mechanism.with_values({name: value + s}).tree for s in (step, -step))
            # Central differences of a cubic: relative truncation 1e-8, rounding 1e-12.
            slope = (high.links - low.links) / (2 * step)
            assert np.allclose(directions.links[:, :, k], slope, rtol=1e-7, atol=1e-9)
            fall = (high.gravity - low.gravity) / (2 * step)
            assert np.allclose(directions.gravity[:, k], fall, rtol=1e-9, atol=1e-9)


def test_branches_tail_and_parts_of_a_body(tmp_path) -> None:
    mechanism = read(
        tmp_path,
        mjcf(
            f'<body name="a">{HINGE.format("ja")}<geom type="box" size="0.08 0.0025 0.01" pos="0.05 0 0"/>'
            '<geom name="bar" type="box" size=".04 .002 .005" pos=".1 0 0" euler="0 90 0" density="7800"/>'
            '<geom type="sphere" size=".01" pos=".05 0 0" mass=".1"/><geom type="sphere" size=".01" '
            'pos=".02 0 0"/>'
            f'<body name="far" pos=".1 0 0">{HINGE.format("jf")}{BOX}</body>'
            f'<body name="back" pos="-.02 0 0">{HINGE.format("jb")}{BOX}</body></body>'
        ),
    )
    sizes = [p.name for p in mechanism.parameters if p.name.startswith("a.") and not p.follows]
    assert sizes == [
        "a.length", "a.tail", "a.tip", "a.width", "a.thickness", "a.density", "a.bar.width",
        "a.bar.length", "a.bar.thickness", "a.bar.density", "a.sphere.width", "a.sphere.along",
        "a.sphere.mass", "a.sphere2.width", "a.sphere2.along", "a.sphere2.density",
    ]  # fmt: skip
    changed = mechanism.with_values({"a.length": 0.2, "a.tail": 0.06})
    assert changed.tree.links[1, :2] == pytest.approx((0.2, 0.0), abs=1e-12)
    assert changed.tree.links[2, :2] == pytest.approx((-0.04, 0.0), abs=1e-12)
    assert changed.shapes.points[:8, 0].min() == pytest.approx(-0.06, rel=1e-12)
    assert changed.shapes.points[:8, 0].max() == pytest.approx(0.23, rel=1e-12)


def test_values_take_little_time_to_change() -> None:
    """Not a clock: the tree of a changed copy is made without reading the file again."""
    mechanism = load("triple")
    assert mechanism.with_values({"link1.length": 0.3}).plan is mechanism.plan


def test_measured_is_carried() -> None:
    measured = Measured(("link1.length", "link1.width"), np.eye(2))
    mechanism = load("single").with_measured(measured)
    assert mechanism.with_values({"link1.width": 0.05}).measured is measured
    with pytest.raises(MechanismError):
        load("single").with_measured(Measured(("link9.length",), np.eye(1)))


FIRST_NAMES = (
    "'link1.length', 'link1.tail', 'link1.width', 'link1.thickness', 'link1.density', 'link1.mass', "
    "'link1.com_x', 'link1.com_y', 'link1.inertia', 'joint1.damping'"
)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda m: m.parameter("volume"),
            f"parameter 'volume' is not in the mechanism; parameters: {FIRST_NAMES} and 10 more.",
        ),
        (
            lambda m: m.with_values({"link1.length": math.nan}),
            "parameter 'link1.length': expected a number, got nan.",
        ),
        (
            lambda m: m.with_values({"link1.length": 0.0}),
            "parameter 'link1.length': expected a value above 0 m, got 0.",
        ),
        (
            lambda m: m.with_values({"joint1.damping": -1e-4}),
            "parameter 'joint1.damping': expected a value not below 0 N m s/rad, got -0.0001.",
        ),
        (
            lambda m: m.with_values({"link1.mass": 0.1}),
            "parameter 'link1.mass': follows from the sizes of its body; fix or free it to give it a value.",
        ),
        (
            lambda m: m.directions(["link1.mass"]),
            "parameter 'link1.mass': follows from the sizes of its body; fix or free it first.",
        ),
        (
            lambda m: m.with_choices(fix={"link1.width": 100.0}),
            "parameter 'link1.width': expected a value between 3e-05 and 30 m, got 100; change the value or "
            "the "
            "bounds.",
        ),
        (
            lambda m: m.with_choices(bounds={"link1.width": (0.1, 0.2)}),
            "parameter 'link1.width': expected a value between 0.1 and 0.2 m, got 0.03; change the value or "
            "the "
            "bounds.",
        ),
        (
            lambda m: m.with_choices(bounds={"link1.width": (0.2, 0.1)}),
            "bounds of 'link1.width': expected the lower bound first, got 0.2 and 0.1.",
        ),
        (
            lambda m: m.with_choices(bounds={"link1.width": (math.nan, 0.1)}),
            "bounds of 'link1.width': expected the lower bound first, got nan and 0.1.",
        ),
        (
            lambda m: m.with_choices(fix={"link1.width": math.inf}),
            "parameter 'link1.width': expected a number, got inf.",
        ),
        (
            lambda m: m.with_choices(fix={"gravity": 9.8}, free=["gravity"]),
            "parameter 'gravity': is both fixed and freed; choose one of them.",
        ),
        (
            lambda m: m.with_bodies("rigid"),
            "bodies: expected 'uniform' or 'free', got 'rigid'; choose one of them.",
        ),
    ],
)
def test_refusals_of_parameters(change, message: str) -> None:
    with pytest.raises(MechanismError) as caught:
        change(load("single"))
    assert str(caught.value) == message


def test_a_mechanism_says_in_one_line_what_it_is() -> None:
    assert repr(load("cartpole")) == (
        "<Mechanism 'cartpole': slide (slide), joint1 (hinge); 10 of 36 parameters free>"
    )
    assert repr(load("chain:6")).startswith("<Mechanism 'chain:6': 6 joints; ")
    single = load("single")
    found = single._repr_html_()
    assert ">link1.length</td>" in found
    assert ">follows</td>" in found
    # what is zero and held has no effect
    assert "joint1.stiffness" not in found
    listed = sum(p.free or p.value != 0.0 for p in single.parameters)
    assert found.count("<tr>") == 1 + listed
    assert f"{len(single.parameters) - listed} parameters of value 0 not listed." in found


@pytest.mark.parametrize(
    ("wrong", "got"),
    [
        ("x", "'x'"), (b"", "a value of type bytes"), (None, "None"), ([], "a value of type list"),
        (np.array([1.0]), "an array of shape (1,) and type float64"), (True, "True"),
    ],
)  # fmt: skip
def test_a_value_is_a_number(wrong: object, got: str) -> None:
    with refuses(
        SettingsError, f"with_values: expected values['gravity'] to be a number, got {got}; give another."
    ):
        load("single").with_values({"gravity": wrong})  # type: ignore[dict-item]


@pytest.mark.parametrize("wrong", [None, -1, 0.5])
def test_a_name_is_a_text(wrong: object) -> None:
    with refuses(SettingsError, f"parameter: expected name to be a text, got {wrong}; give another."):
        load("single").parameter(wrong)  # type: ignore[arg-type]


def test_a_value_beyond_its_bounds_is_not_computed_with() -> None:
    with refuses(
        MechanismError,
        "parameter 'link1.length': expected a value between 0.0002 and 200 m, got 1e+308; change the value "
        "or the bounds.",
    ):
        load("bob").with_choices(fix={"link1.length": 1e308})
