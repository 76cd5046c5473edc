"""What one of every quantity is, in SI, when the model is told in its own units
(derive.states.scales).

Errors are compared with these where a quantity vanishes, and disturbances are so large: a verdict
does not depend on the metre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from derive.formulations.records import Function
from derive.mechanics.records import System
from derive.states.scales import Scales, scales, typical
from hamel.verify.reference.vectors import Array

LEFT_OVER = 1e-12  # of what a velocity is: a speed below that is roundoff


@dataclass(frozen=True)
class Units:
    """Arrays over the entries of q, v, w, z and over the rows of A v = c; `positions` over φ."""

    own: Scales
    q: Array
    v: Array
    w: Array
    z: Array
    rows: Array
    positions: Array
    lengths: Array  # ones, of the lengths of quaternions

    @property
    def time(self) -> float:
        """In s."""
        return self.own.time

    @property
    def x(self) -> Array:
        """Of the state (q, w, z)."""
        return np.concatenate([self.q, self.w, self.z])

    @property
    def both(self) -> Array:
        """Of (q, v)."""
        return np.concatenate([self.q, self.v])

    @property
    def whole(self) -> Array:
        """Of (q, v, z)."""
        return np.concatenate([self.q, self.v, self.z])

    @property
    def qdot(self) -> Array:
        """Of q̇."""
        return self.q / self.time

    @property
    def vdot(self) -> Array:
        """Of v̇."""
        return self.v / self.time

    @property
    def zdot(self) -> Array:
        """Of ż."""
        return self.z / self.time

    @property
    def N(self) -> Array:
        """nq × nv, of N in q̇ = N v."""
        return np.outer(self.qdot, 1.0 / self.v)

    @property
    def M(self) -> Array:
        """nv × nv, such that ½ vᵀ M v is an energy."""
        return self.own.energy * np.outer(1.0 / self.v, 1.0 / self.v)

    @property
    def force(self) -> Array:
        """Conjugate to v."""
        return self.own.power / self.v

    @property
    def A(self) -> Array:
        """nc × nv, of A in A v = c."""
        return np.outer(self.rows, 1.0 / self.v)

    @property
    def beta(self) -> Array:
        """Of β in A v̇ = β."""
        return self.rows / self.time

    @property
    def lam(self) -> Array:
        """Of λ: a multiplier times its row A v is a power."""
        return self.own.power / self.rows

    @property
    def energy(self) -> float:
        """In J."""
        return self.own.energy

    @property
    def power(self) -> float:
        """In W."""
        return self.own.power

    def taken(self, name: str, count: int) -> Array:
        """The entries of what a function takes as x; zero for what is none of the state."""
        own = {
            "state": [self.whole],
            "qdot": [self.both],
            "integrate": [self.q, self.v * self.time],
            "inverse_dynamics": [self.whole, self.vdot],
            "difference": [self.q, self.q],
            "normalise": [self.q],
        }
        values = np.concatenate(own.get(name, [self.x]))
        return np.append(values, np.zeros(count - len(values)))

    def of(self, function: Function) -> Array:
        """The entries of a function's result; one where it does not say."""
        own = {
            "mass": self.M,
            "bias": self.force,
            "inverse_dynamics": self.force,
            "constraints": np.concatenate([self.positions, self.lengths, self.rows]),
            "reactions": self.lam,
            "project": self.x,
        }
        count, result = function.result.size, function.result
        values = own.get(
            function.name,
            self.own.all_of(result.units) if len(result.units) == count else np.ones(count),
        )
        return np.ravel(values)


def units(system: System, A: Sequence[Array], w: Sequence[Array]) -> Units:
    """`A` and w at some states say how large each row and each speed is; one that says nothing
    counts as one."""
    own, model = scales(system.model), system.model
    q, v, z = (
        own.all_of(item.unit for item in items)
        for items in (model.coordinates, model.velocities, model.states)
    )
    rows = typical([np.max(np.abs(each) * v, axis=1, initial=0.0) for each in A])
    largest = np.max(rows, initial=0.0)
    # the constraints leave nothing but roundoff of it
    rows[rows < LEFT_OVER * largest] = largest
    order = sorted((row.position, i) for i, row in enumerate(system.rows) if row.position >= 0)
    positions = np.array([rows[i] for _, i in order if i < len(rows)]) * own.time
    speeds = typical(np.abs(w))
    speeds[speeds < LEFT_OVER * np.max(v, initial=0.0)] = (
        1.0  # the constraints leave nothing but roundoff of it
    )
    return Units(own, q, v, speeds, z, rows, positions, np.ones(len(system.quaternions)))
