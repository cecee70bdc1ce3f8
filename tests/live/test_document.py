"""A step as plain numbers: finite, in the form of its schema, in the units that it states."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from importlib.resources import files

import jsonschema
import numpy as np
import pytest

from fits import identified, made_fit
from lives import AHEAD, followed, scene, watched
from monodyn.estimation.fit import Doubt, Estimate
from monodyn.live.document import MOST_AHEAD, SCHEMA, hardly_known, step_document
from monodyn.types import Poses

LENGTH = Estimate("link1.length", 0.2, 0.01, 0.18, 0.22, "m", True, True, False)


def read_back(step):
    """Write a step as JSON that may hold no infinity, and read it."""
    return json.loads(json.dumps(step_document(step), allow_nan=False))


def tracked_alone():
    """Return a frame that is followed and of which nothing was identified yet."""
    step = followed()
    return replace(step, estimate=None, base=None, error=np.array([np.nan]), fresh=None)


def lost():
    """Return a frame in which the mechanism was not seen."""
    step = followed()
    pose = replace(step.pose, position=np.full((1, 1), np.nan), seen=np.zeros(1, bool))
    return replace(step, pose=pose, said="The mechanism is not in sight.")


def test_the_form_is_that_of_its_schema():
    """Against a validator of JSON Schema that we did not write, in every phase."""
    schema = json.loads(files("monodyn.live").joinpath("step.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["properties"]["schema"]["const"] == SCHEMA
    open_fit = followed(base=made_fit(), estimate=None)
    for step in (watched(), tracked_alone(), lost(), open_fit, followed()):
        jsonschema.validate(read_back(step), schema)
    for changed in ({"frame": -1}, {"phase": "asleep"}, {"verdict": "good"}, {"pose": 1.0}, {"more": 1}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**read_back(followed()), **changed}, schema)


def test_numbers_are_those_of_the_step():
    step = followed()
    row, fit = read_back(step), identified()
    assert (row["frame"], row["time"], row["skipped"], row["seen"]) == (45, 1.5, 2, True)
    assert row["pose"] == {"joint1": step.pose.position[0, 0]}
    assert row["std"] == {"joint1": pytest.approx(1e-3)}
    assert row["error"] == {"joint1": 0.01}
    assert (row["latency"], row["fresh"]) == (4.2e-3, 9.7e-3)
    assert (row["verdict"], row["said"]) == (fit.grade, fit.status)
    length = fit.parameter("link1.length")
    assert row["parameters"]["link1.length"] == {
        "value": length.value, "std": length.std, "lower": length.lower, "upper": length.upper, "unit": "m",
    }  # fmt: skip
    assert len(row["future"]) == MOST_AHEAD
    assert row["future"][0]["time"] == 1.5
    assert row["future"][-1]["time"] == pytest.approx(1.5 + AHEAD)
    assert row["future"][-1]["position"] == {"joint1": step.future.position[-1, 0]}
    assert row["future"][-1]["std"]["joint1"] == step.future.std[-1, 0]


def test_what_is_unknown_is_null():
    row = read_back(watched())
    assert (row["pose"], row["std"], row["error"], row["fresh"], row["verdict"]) == (None,) * 5
    assert (row["parameters"], row["future"], row["enough_motion"], row["seen"]) == ({}, [], None, False)
    assert read_back(lost())["pose"] == {"joint1": None}
    assert read_back(lost())["seen"] is False
    assert read_back(tracked_alone())["error"] == {"joint1": None}
    damping = read_back(followed(base=made_fit(), estimate=None))["parameters"]["joint1.damping"]
    assert (damping["std"], damping["lower"], damping["upper"]) == (None, 0.0, None)


def test_the_pose_is_in_metres_and_against_gravity_once_these_are_known():
    """A cart moves by the scale of the lengths; a picture that is turned turns the first hinge."""
    fit = identified()
    step = followed()
    turned = replace(fit, mechanism=fit.mechanism.with_values({"camera.roll": 0.1}))
    # the picture was taken as level, and is not
    pose = replace(step.pose, roll=0.0)
    row = read_back(replace(step, pose=pose, estimate=None, base=turned))
    sign = fit.mechanism.joints[0].sign
    assert row["pose"]["joint1"] == pytest.approx(step.pose.position[0, 0] + 0.1 * sign)

    import monodyn

    cart = monodyn.load("cartpole")
    joints = tuple(joint.name for joint in cart.joints)
    poses = Poses(
        joints, np.array([0]), np.zeros(1), np.array([[0.1, 0.2]]), 1e-4 * np.eye(2)[None],
        np.ones(1, bool), metric=False, roll=None,
    )  # fmt: skip
    rolling = replace(fit, mechanism=cart, scale=2.0)
    row = read_back(replace(step, pose=poses, scene=scene(rolling), estimate=None, base=rolling,
                            error=np.zeros(0)))  # fmt: skip
    assert row["pose"] == {joints[0]: pytest.approx(0.2), joints[1]: pytest.approx(0.2)}
    assert row["std"] == {joints[0]: pytest.approx(0.02), joints[1]: pytest.approx(0.01)}


def test_the_motion_was_enough_once_every_length_is_known():
    assert hardly_known(identified()) == ()
    wide = replace(identified(), parameters=(LENGTH,))
    assert hardly_known(wide) == (("link1.length", pytest.approx(0.1)),)
    narrow = replace(identified(), parameters=(replace(LENGTH, lower=0.195, upper=0.205),))
    assert hardly_known(narrow) == ()
    unknown = replace(LENGTH, std=math.inf, lower=0.0, upper=math.inf)
    assert hardly_known(replace(identified(), parameters=(unknown,))) == (("link1.length", math.inf),)
    given = replace(identified(), parameters=(replace(LENGTH, free=False, std=0.0),))
    assert hardly_known(given) == ()
    refused = given.doubted([Doubt("refused", "It is another mechanism.")])
    assert hardly_known(refused) == ((given.mechanism.name, math.inf),)
    assert hardly_known(narrow.doubted([Doubt("refused", "It is another mechanism.")])) != ()
