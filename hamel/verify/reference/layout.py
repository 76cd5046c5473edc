"""Maximal coordinates z = (v, twist of each body): where things stand in them, and what a set of
rows over them is.

A twist is (angular velocity, velocity of the body's origin) in the ground frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from derive.model.records import Model
from hamel.verify.reference.states import Frame
from hamel.verify.reference.vectors import Array, cross, skew


@dataclass(frozen=True)
class Rows:
    """k rows over z (nz): coefficients · ż = gamma, coefficients · z = c; phi of the holonomic
    ones, in order.

    The multipliers λ of the rows act on the system as coefficientsᵀ λ.
    """

    coefficients: Array
    gamma: Array
    c: Array
    phi: Array
    own_excess: Array | None = None

    @property
    def excess(self) -> Array:
        """What a step along the rows has to take away for all of phi to vanish; phi but for turns
        that may be large."""
        return self.phi if self.own_excess is None else self.own_excess


@dataclass(frozen=True)
class Layout:
    """Where things stand in z: the velocities first, then six per body."""

    nv: int
    bodies: tuple[str, ...]

    @property
    def size(self) -> int:
        """nz = nv + 6 nb."""
        return self.nv + 6 * len(self.bodies)

    def twist(self, body: str) -> slice:
        """Where (ω, velocity of the origin) of a body stands in z; the first three are ω."""
        start = self.nv + 6 * self._places[body]
        return slice(start, start + 6)

    def row(self, body: str) -> slice:
        """The same among the twists alone."""
        start = 6 * self._places[body]
        return slice(start, start + 6)

    @cached_property
    def _places(self) -> dict[str, int]:
        return {body: i for i, body in enumerate(self.bodies)}


def layout(model: Model) -> Layout:
    """Bodies in the order of the model; the ground has no place, for it does not move."""
    return Layout(len(model.velocities), tuple(body.name for body in model.bodies))


def stacked(parts: Sequence[Rows], size: int) -> Rows:
    """All rows below each other."""
    return Rows(
        np.vstack([np.zeros((0, size)), *(part.coefficients for part in parts)]),
        np.concatenate([np.zeros(0), *(part.gamma for part in parts)]),
        np.concatenate([np.zeros(0), *(part.c for part in parts)]),
        np.concatenate([np.zeros(0), *(part.phi for part in parts)]),
        np.concatenate([np.zeros(0), *(part.excess for part in parts)]),
    )


def point_velocity(arm: Array) -> Array:
    """3 × 6: twist of a body → velocity of its point at `arm` (ground axes) from the origin."""
    return np.hstack([-skew(arm), np.eye(3)])


def centripetal(frame: Frame, arm: Array) -> Array:
    """ω × (ω × arm): acceleration of the point less origin acceleration and α × arm."""
    return cross(frame.omega, cross(frame.omega, arm))
