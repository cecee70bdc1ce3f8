"""A run on pictures of two equal dots: from the clip to the run folder."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

import monodyn
from dotted import BALLS, coverage
from monodyn.mechanism import load
from monodyn.types import FULL, Camera
from tracked import apart, seen, swing

COUNT = 100


@pytest.mark.slow
def test_dots_are_followed_identified_and_shown(tmp_path: Path) -> None:
    model, pictures = tmp_path / "balls.xml", tmp_path / "film"
    model.write_text(BALLS, encoding="utf-8")
    pictures.mkdir()
    file = load(model)
    truth = file.with_values({"link1.length": 0.22, "link2.length": 0.17}).with_bodies("free")
    truth = truth.with_values({f"link{i}.com_x": 0.1 for i in (1, 2)})
    truth = truth.with_values({"link1.inertia": 2e-5, "link2.inertia": 2e-5})
    position = swing(truth, COUNT, (-0.6, 0.8))
    px = seen(truth, position, ("link1_dot", "tip"), camera=Camera(1280, 720, 1280.0, 0.0, -0.1, 1.3))
    draw = np.random.default_rng(1)
    for i, places in enumerate(px):
        share = coverage(places) / FULL
        picture = 90.0 + 120.0 * share + draw.normal(scale=1.5, size=share.shape)
        cv2.imwrite(str(pictures / f"{i:03d}.png"), np.round(np.clip(picture, 0, 255)).astype(np.uint8))
    outcome = monodyn.run(pictures, model, tmp_path / "run", monodyn.RunSettings(rate=30.0))
    assert outcome.fit is not None
    assert outcome.fit.ok
    values = outcome.fit.mechanism.values
    assert values["link1.length"] == pytest.approx(0.22, rel=0.01)
    assert values["link2.length"] == pytest.approx(0.17, rel=0.015)
    # where the mass is cannot be told, and is not
    assert not outcome.fit.parameter("link1.com_x").identifiable
    poses = outcome.poses
    off = apart(poses.position[poses.seen], position[poses.frame[poses.seen]])
    assert np.sqrt(np.mean(off**2)) < np.deg2rad(0.15)
    written = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"overlay.mp4", "diagnosis.png", "report.html", "poses.csv", "model.xml"} <= written
    seconds = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))["seconds"]
    assert {"segment", "dots", "locate", "track"} <= set(seconds)
