"""With the true sizes the mechanism moves as the rendered clips' truth says (``MONODYN_DATA``)."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from monodyn.mechanism import Mechanism, load
from monodyn.mechanism.simulate import rollout

DATA = os.environ.get("MONODYN_DATA")
CLIPS = ("single", "double_a", "double_b", "triple", "bob", "cartpole")

pytestmark = pytest.mark.skipif(DATA is None, reason="MONODYN_DATA is not set: no recordings to compare with")


def _true(clip: str) -> tuple[Mechanism, dict]:
    """Return the user's model with the true sizes in it, and the truth."""
    folder = Path(DATA or "") / "rendered"
    record = json.loads((folder / f"{clip}.json").read_text())
    truth = record["truth"]
    mechanism = load(folder / f"{clip}.xml")
    values: dict[str, float] = {}
    for k, (length, width, thickness) in enumerate(truth["links"], start=1):
        sizes = {"length": length, "width": width, "thickness": thickness, "density": truth["density"]}
        values |= {f"link{k}.{what}": value for what, value in sizes.items()}
        values[f"joint{k}.damping"] = truth["damping"][k - 1]
    if truth["bob"]:
        values |= {
            "link1.sphere.width": 2 * truth["bob"]["radius"],
            "link1.sphere.density": truth["bob"]["density"],
        }
    if truth["cart"]:
        values |= dict(zip(("cart.length", "cart.width"), truth["cart"]["size"], strict=True))
        values |= {"cart.mass": truth["cart"]["mass"], "slide.damping": truth["cart"]["damping"]}
    known = {p.name for p in mechanism.parameters}
    return mechanism.with_values({name: value for name, value in values.items() if name in known}), record


@pytest.mark.parametrize("clip", CLIPS)
def test_the_true_sizes_move_as_the_truth(clip: str) -> None:
    mechanism, record = _true(clip)
    tree = mechanism.tree
    q, v = np.array(record["q"]), np.array(record["v"])
    # The truth was written at whole steps of half a millisecond, the nearest to each time stamp.
    times = np.round(np.array(record["times"]) * 2000) / 2000
    ours, rates = rollout(tree, times, q[0], v[0], substeps=64)
    # Truth and rollout are both Runge-Kutta at half a millisecond; double_b is chaotic and multiplies by 1e3.
    assert np.abs(ours - q).max() < 1e-7
    assert np.abs(rates - v).max() < 1e-5
