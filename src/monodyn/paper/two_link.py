"""Dynamics of the double pendulum in closed form, as the 2012 paper states them.

theta_1 counts from the horizontal axis on the right, theta_2 from the upper link, both counter-clockwise (its
Fig. 4). ``mechanism.simulate`` does the same for any mechanism; here each line is one of the paper.

Its eq. (8) is read so: H multiplies the second derivatives (one dot is printed), what is first printed as
H21 is H22, and "cos theta_1 + theta_2" is cos(theta_1 + theta_2). In eq. (9) a resisting torque is -b rate;
the minus sign is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monodyn.arrays import Frozen, frozen
from monodyn.errors import MechanismError


@dataclass(frozen=True, eq=False)
class TwoLink(Frozen):
    """Two bars of rectangular section, each uniform and as long as from hinge to hinge or end.

    m = rho l w h, w = alpha l, l_c = l / 2, I = m (l^2 + w^2) / 12.

    Attributes:
        length: l [m], (2,).
        aspect: Width over length, alpha, (2,).
        thickness: h [m], (2,).
        density: rho [kg/m^3], (2,).
        gravity: Acceleration of free fall g [m/s^2].

    Source: the 2012 paper, the equations after (8).
    """

    length: np.ndarray
    aspect: np.ndarray
    thickness: np.ndarray
    density: np.ndarray
    gravity: float = 9.81

    def __post_init__(self) -> None:
        for name in ("length", "aspect", "thickness", "density"):
            values = frozen(f"TwoLink.{name}", getattr(self, name), (2,), error=MechanismError)
            if not np.all((values > 0) & np.isfinite(values)):
                raise MechanismError(f"TwoLink.{name}: expected two values above 0, got {values.tolist()}.")
            object.__setattr__(self, name, values)

    @cached_property
    def width(self) -> np.ndarray:
        """Width w [m], (2,)."""
        return self.aspect * self.length

    @cached_property
    def mass(self) -> np.ndarray:
        """Mass m [kg], (2,)."""
        return self.density * self.length * self.width * self.thickness

    @cached_property
    def centre(self) -> np.ndarray:
        """Distance of the centre of mass from the hinge l_c [m], (2,)."""
        return self.length / 2

    @cached_property
    def inertia(self) -> np.ndarray:
        """Inertia about the centre of mass I [kg m^2], (2,)."""
        return self.mass / 12 * (self.length**2 + self.width**2)


def accelerations(pendulum: TwoLink, theta: np.ndarray, rate: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Solve H(theta) a = torque - C(theta, rate) rate - g(theta) for the accelerations.

    Args:
        pendulum: The pendulum.
        theta: Joint angles [rad], (..., 2).
        rate: Joint rates [rad/s], (..., 2).
        torque: Joint torques, friction among them [N m], (..., 2).

    Returns:
        Joint accelerations [rad/s^2], (..., 2).

    Source: the 2012 paper, eq. (8).
    """
    # stacked columns, because solve() takes a last axis of right sides
    right = torque - _times(coriolis(pendulum, theta, rate), rate) - gravity(pendulum, theta)
    return np.linalg.solve(inertia_matrix(pendulum, theta), right[..., None])[..., 0]


def inverse_dynamics(
    pendulum: TwoLink, theta: np.ndarray, rate: np.ndarray, acceleration: np.ndarray
) -> np.ndarray:
    """Compute the torques that a motion needs, H(theta) a + C(theta, rate) rate + g(theta).

    ``torque.inverse_dynamics`` does it for any mechanism, and is what the identification calls; this is the
    closed form of two links, to read and to check it by.

    Args:
        pendulum: The pendulum.
        theta: Joint angles [rad], (..., 2).
        rate: Joint rates [rad/s], (..., 2).
        acceleration: Joint accelerations [rad/s^2], (..., 2).

    Returns:
        Joint torques, friction among them [N m], (..., 2).

    Source: the 2012 paper, eq. (8) and (12).
    """
    moved = _times(inertia_matrix(pendulum, theta), acceleration)
    return moved + _times(coriolis(pendulum, theta, rate), rate) + gravity(pendulum, theta)


def inertia_matrix(pendulum: TwoLink, theta: np.ndarray) -> np.ndarray:
    """Compute H(theta).

    Args:
        pendulum: The pendulum.
        theta: Joint angles [rad], (..., 2).

    Returns:
        Joint-space inertia matrix [kg m^2], (..., 2, 2).

    Source: the 2012 paper, eq. (8).
    """
    (m1, m2), (i1, i2) = pendulum.mass, pendulum.inertia
    (l1, _), (lc1, lc2) = pendulum.length, pendulum.centre
    # all that depends on the pose is the angle between the links: turning both changes no inertia
    c2 = np.cos(np.asarray(theta)[..., 1])
    h11 = m1 * lc1**2 + i1 + m2 * (l1**2 + lc2**2 + 2 * l1 * lc2 * c2) + i2
    h12 = m2 * l1 * lc2 * c2 + m2 * lc2**2 + i2
    h22 = np.full_like(c2, m2 * lc2**2 + i2)
    return _matrix(h11, h12, h12, h22)


def coriolis(pendulum: TwoLink, theta: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Compute C(theta, rate), with h = m_2 l_1 l_c2 sin theta_2.

    Args:
        pendulum: The pendulum.
        theta: Joint angles [rad], (..., 2).
        rate: Joint rates [rad/s], (..., 2).

    Returns:
        The matrix that times the rates is the centrifugal and Coriolis torque [N m s], (..., 2, 2).

    Source: the 2012 paper, eq. (8).
    """
    h = pendulum.mass[1] * pendulum.length[0] * pendulum.centre[1] * np.sin(np.asarray(theta)[..., 1])
    r1, r2 = np.moveaxis(np.asarray(rate, dtype=np.float64), -1, 0)
    return _matrix(-h * r2, -h * (r1 + r2), h * r1, np.zeros_like(h * r1))


def gravity(pendulum: TwoLink, theta: np.ndarray) -> np.ndarray:
    """Compute g(theta), the torques that hold the pendulum still.

    Args:
        pendulum: The pendulum.
        theta: Joint angles [rad], (..., 2).

    Returns:
        Joint torques [N m], (..., 2).

    Source: the 2012 paper, eq. (8).
    """
    (m1, m2), (lc1, lc2), g = pendulum.mass, pendulum.centre, pendulum.gravity
    t1, t2 = np.moveaxis(np.asarray(theta, dtype=np.float64), -1, 0)
    # the second link's weight turns the first joint too, by its own arm and by that of joint 2
    g2 = m2 * lc2 * g * np.cos(t1 + t2)
    g1 = m1 * lc1 * g * np.cos(t1) + m2 * g * pendulum.length[0] * np.cos(t1) + g2
    return np.stack([g1, g2], axis=-1)


def friction(damping: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Compute the torque of viscous friction, -b_i rate_i.

    Args:
        damping: b [N m s/rad], (2,).
        rate: Joint rates [rad/s], (..., 2).

    Returns:
        Joint torques [N m], (..., 2).

    Source: the 2012 paper, eq. (9), with the sign of a torque that resists.
    """
    return -np.asarray(damping) * rate


def _matrix(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return matrices of two rows (a, b) and (c, d), (..., 2, 2)."""
    return np.stack([np.stack([a, b], axis=-1), np.stack([c, d], axis=-1)], axis=-2)


def _times(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return matrices (..., 2, 2) times vectors (..., 2)."""
    return (matrix @ np.asarray(vector, dtype=np.float64)[..., None])[..., 0]
