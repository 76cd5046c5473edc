"""Scenes of `derivatives` and `contraction`: v̇, ∂v̇/∂q, ∂v̇/∂v and M⁻¹ of trees against Pinocchio's
`computeABADerivatives`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from peers import ours, pinocchio
from peers.contest import Contender


@dataclass(frozen=True)
class Slopes:
    """A tree in Pinocchio's order: `columns` of its velocities among ours, its own (q, v, forces)
    as `inputs`."""

    of: ours.Subject
    text: Path
    columns: np.ndarray
    inputs: np.ndarray

    def own(self, batch: bool = False) -> list[Contender]:
        return [ours.contender(self.of, "derivatives", batch=batch, read=self._read_ours)]

    def theirs(self) -> list[Contender]:
        nv = len(self.columns)
        size = nv + 3 * nv * nv
        return [pinocchio.derivatives(self.text, self.inputs, size, self._read_theirs)]

    def through_casadi(self) -> list[Contender]:
        """CasADi's Jacobians of Pinocchio's own recursion, as C; of joints with one velocity."""
        nv = len(self.columns)
        return pinocchio.generated_derivatives(self.text, self.inputs, nv, self._read_casadi)

    def contraction(self) -> list[Contender]:
        """At random y and (dx, du)."""
        x = self.of.x
        seeds = np.random.default_rng(3).normal(
            size=(len(x), 2 * x.shape[1] + self.of.states.u.shape[1])
        )
        rows = np.hstack([x, seeds])
        return [ours.contender(self.of, "contraction", rows=rows, read=_nothing)]

    def beside(self) -> list[Contender]:
        """`derivatives` as a measure: nothing is compared."""
        return [ours.contender(self.of, "derivatives", read=_nothing)]

    def _read_ours(self, rows: np.ndarray) -> np.ndarray:
        system = self.of.equations.system
        nq, nx = system.q.numel(), system.q.numel() + system.v.numel()
        parts = rows.reshape(len(rows), nx, -1)[:, nq:][:, self.columns]
        N = ca.Function("N", [system.q], [ca.densify(system.N)])
        over_v = np.array([np.asarray(N(q)) for q in self.of.states.q])
        by_q = (parts[:, :, 1 : 1 + nq] @ over_v)[:, :, self.columns]
        by_v = parts[:, :, 1 + nq : 1 + nx][:, :, self.columns]
        return _flat(parts[:, :, 0], by_q, by_v, parts[:, :, 1 + nx :])

    def _read_theirs(self, rows: np.ndarray) -> np.ndarray:
        nv = len(self.columns)
        vdot, matrices = rows[:, :nv], rows[:, nv:].reshape(len(rows), 3, nv, nv)
        by_q, by_v, upper = (matrices[:, k].swapaxes(1, 2) for k in range(3))
        inverse = np.triu(upper) + np.triu(upper, 1).swapaxes(1, 2)
        return _flat(vdot, by_q, by_v, inverse[:, :, self._driven()])

    def _read_casadi(self, rows: np.ndarray) -> np.ndarray:
        nv = len(self.columns)
        by_q, by_v, inverse = rows[:, nv:].reshape(len(rows), 3, nv, nv).swapaxes(0, 1)
        return _flat(rows[:, :nv], by_q, by_v, inverse[:, :, self._driven()])

    def _driven(self) -> list[int]:
        """Where inputs act, in Pinocchio's order."""
        model = self.of.equations.system.model
        at = {velocity.name: i for i, velocity in enumerate(model.velocities)}
        places = {int(column): k for k, column in enumerate(self.columns)}
        return [places[at[given.velocity]] for given in model.inputs]


def _flat(*parts: np.ndarray) -> np.ndarray:
    return np.hstack([part.reshape(len(part), -1) for part in parts])


def _nothing(rows: np.ndarray) -> np.ndarray:
    return np.ones((len(rows), 1))
