"""Scene of `regressor`: Y(q, v, v̇) of a tree, ten columns for each moving body, against
Pinocchio's `computeJointTorqueRegressor`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from peers import ours, pinocchio
from peers.contest import Contender

from derive.mechanics.regression.regressor import groups

PARAMETERS = 10  # of each body, in the same order on both sides


@dataclass(frozen=True)
class Regressor:
    """A tree in Pinocchio's order: `columns` of its velocities among ours, its own (q, v, v̇) as
    `inputs`."""

    of: ours.Subject
    text: Path
    columns: np.ndarray
    inputs: np.ndarray

    def own(self) -> list[Contender]:
        states, nv = self.of.states, len(self.columns)
        rates = np.empty_like(states.v)
        rates[:, self.columns] = self.inputs[:, -nv:]
        rows = np.hstack([states.q, states.v, rates])
        return [ours.contender(self.of, "regressor", rows=rows, read=self._read_ours)]

    def theirs(self) -> list[Contender]:
        size = PARAMETERS * len(self._bodies()) * len(self.columns)
        return [pinocchio.regressor(self.text, self.inputs, size, self._read_theirs)]

    def _bodies(self) -> list[int]:
        """Where Pinocchio's bodies stand among ours."""
        mechanics = self.of.equations.system
        firsts = [mechanics.links[g.place.link].columns[0] for g in groups(mechanics)]
        return [firsts.index(int(j)) for j in self.columns if int(j) in firsts]

    def _read_ours(self, rows: np.ndarray) -> np.ndarray:
        blocks = rows.reshape(len(rows), len(self.columns), -1, PARAMETERS)
        ordered = blocks[:, self.columns][:, :, self._bodies()]
        return ordered.reshape(len(rows), -1)

    def _read_theirs(self, rows: np.ndarray) -> np.ndarray:
        """Theirs come column by column."""
        matrices = rows.reshape(len(rows), -1, len(self.columns)).swapaxes(1, 2)
        return matrices.reshape(len(rows), -1)
