"""Scene of a frame: pose and geometric Jacobian of a hand in one call, against Pinocchio's
`computeFrameJacobian`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from peers import ours, pinocchio
from peers.contest import Contender


@dataclass(frozen=True)
class Hand:
    """A frame of a robot file by its `name`: Pinocchio's `joint` that carries it, and where it sits
    on it as 3 × 4. `columns`: Pinocchio's velocities among ours; `q`: its coordinates."""

    of: ours.Subject
    text: Path
    name: str
    joint: int
    placement: np.ndarray
    columns: np.ndarray
    q: np.ndarray

    @property
    def function(self) -> str:
        return f"pose_jacobian_{self.name}"

    def own(self) -> list[Contender]:
        return [ours.contender(self.of, self.function, read=self._read)]

    def theirs(self) -> list[Contender]:
        size = 12 + 6 * len(self.columns)
        numbers = [*self.placement[:, :3].ravel(), *self.placement[:, 3]]
        said = " ".join(
            [str(self.text.resolve()), str(self.joint), *map(repr, map(float, numbers))]
        )
        return [pinocchio.frames(said, self.q, size)]

    def _read(self, rows: np.ndarray) -> np.ndarray:
        J = rows[:, 12:].reshape(len(rows), 6, -1)[:, :, self.columns]
        return np.hstack([rows[:, :12], J.reshape(len(rows), -1)])
