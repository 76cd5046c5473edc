"""Whether positions that were found are regular ones, or singular ones that a mechanism has alone.

Let σ be the least singular value of the rows A of φ there, δ = A⁺φ Newton's step and κ the rate of
A along it. Newton's iteration leads to a regular position near by where

    h = κ |δ| / σ < 1/2.

At a regular position φ is rounding and h too. Where a mechanism is stretched to fit, φ leaves off
at a tolerance ε with σ² of the size of κ ε: h stays near 1/2 however long the iteration goes on.

Source: L. V. Kantorovich, G. P. Akilov, Functional analysis, 2nd ed., Pergamon 1982, ch. XVIII.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from derive.mechanics.records import System
from derive.states.closing import Kinematics, closed, nominal
from derive.states.sampling import States, row_lengths
from derive.states.scales import scaled, scales

STEP = 1e-3  # of the natural size of a velocity, along which A is seen to change
PATIENT = 300  # steps of Newton: where slopes vanish with φ each only halves what is left
ROUNDING = 2e-16  # of the length of its row: φ is no smaller


def kantorovich(
    system: System, solver: Kinematics, at: States, closing: Sequence[int]
) -> np.ndarray:
    """h at every state, of the rows `closing`, each divided by its length nearby."""
    columns = scales(system.model).all_of(velocity.unit for velocity in system.model.velocities)
    rates = solver.values(ca.jacobian(system.qdot, system.v), at.t, at.q, at.p)
    N = rates.reshape(len(at.t), at.q.shape[1], len(columns))

    def rows(along: np.ndarray) -> np.ndarray:
        moved = at.q + np.einsum("kij,kj->ki", N, columns * along)
        return solver.rows(at.t, moved, at.p)[0][:, closing] * columns

    still = np.zeros((len(at.t), len(columns)))
    lengths = row_lengths(rows(still + STEP))[:, None]
    A = rows(still) / lengths
    left, sizes, right = np.linalg.svd(A, full_matrices=False)
    sizes = np.maximum(sizes, ROUNDING)
    phi = solver.values(system.phi, at.t, at.q, at.p).reshape(len(at.t), -1)
    off = phi[:, [system.rows[i].position for i in closing]] / lengths[:, 0]
    parts = np.einsum("kij,ki->kj", left, off) / sizes
    parts[:, -1] += ROUNDING / sizes[:, -1]
    step = np.linalg.norm(parts, axis=1)
    along = np.einsum("kj,kji->ki", parts / step[:, None], right)
    change = np.linalg.norm(rows(STEP * along) / lengths - A, ord=2, axis=(1, 2))
    return change / STEP * step / sizes[:, -1]


def consistent_start(system: System) -> States | None:
    """The configuration that the initial values lead to at t = 0, singular or not, at rest: guesses
    move, else everything may. None where Newton's steps lead to none."""
    own, model = scales(system.model), system.model
    whole = system if own.plain else scaled(system, own)
    held = {x.name for x in model.initial if x.held}
    free = np.array([c.name not in held for c in model.coordinates])
    p = np.array(whole.parameters, dtype=float)
    for choice in (free, np.ones(len(free), dtype=bool)):
        q = closed(Kinematics(whole), 0.0, nominal(whole), p, choice, steps=PATIENT)
        if q is not None:
            q = q * own.all_of(c.unit for c in model.coordinates)
            v, u = (np.zeros((1, x.numel())) for x in (system.v, system.u))
            return States(np.zeros(1), q[None], v, u, np.array([system.parameters]))
    return None
