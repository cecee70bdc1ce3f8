"""A mechanism file in; named parameters, a joint tree for the dynamics and shapes for the picture out."""

from monodyn.choices import BUNDLED
from monodyn.mechanism.mjcf import write_mjcf
from monodyn.mechanism.model import Mechanism
from monodyn.mechanism.parts import Joint, Parameter
from monodyn.mechanism.read import load
from monodyn.mechanism.tree import Measured, Shapes, Tree
from monodyn.mechanism.urdf import write_urdf

__all__ = [
    "BUNDLED",
    "Joint",
    "Measured",
    "Mechanism",
    "Parameter",
    "Shapes",
    "Tree",
    "load",
    "write_mjcf",
    "write_urdf",
]
