"""Outlines of bodies in the picture."""

from __future__ import annotations

import cv2
import numpy as np

from monodyn.mechanism import load
from monodyn.types import Camera
from monodyn.vision.drawing.outline import covered_pixels, outline
from pictures import CAMERA


def test_covered_pixels_grow() -> None:
    mechanism = load("single")
    inner = covered_pixels(mechanism, CAMERA, np.array([0.3]), margin=0.0)
    outer = covered_pixels(mechanism, CAMERA, np.array([0.3]), margin=3.0)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    assert (cv2.dilate(inner.astype(np.uint8), kernel) <= outer).all()
    assert outer.sum() < 2.0 * inner.sum()


def test_outline_behind_the_camera_is_empty() -> None:
    assert outline(load("single"), Camera(320, 240, 300.0, depth=-1.0), np.array([0.0])) == []
