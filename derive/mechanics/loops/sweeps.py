"""Sweeps along a tree, kind by kind: what is known as a number is not stored and not handed on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca

from derive.expressions.scalars import Scalar, Vector
from derive.joints.rotations import is_zero
from derive.mechanics.loops.records import Joint, Sweep, Visit

SINE, COSINE = 0, 1  # where the angle's stand in the row of a link
TURNED = 80  # … and an orientation that is no single angle
PUSH = 89  # … and what acts on it by itself
MOST_KEPT = 95  # entries of a row


@dataclass
class Rows:
    """The values of a link, as later sweeps see them: symbols, or numbers where that is known."""

    symbols: ca.SX
    values: dict[int, Scalar] = field(default_factory=dict[int, Scalar])

    def __getitem__(self, place: int) -> Scalar:
        return self.values[place]

    def vector(self, place: int, size: int = 3) -> Vector:
        """Entries that stand side by side."""
        return [self.values[place + k] for k in range(size)]

    def keep(self, kept: dict[int, Scalar]) -> dict[int, Scalar]:
        """Numbers are known later, the rest is stored: what is left to store."""
        stored = {k: x for k, x in kept.items() if not _is_number(x)}
        self.values |= {k: self.symbols[k] if k in stored else x for k, x in kept.items()}
        return stored


Step = Callable[[Joint, Rows, Vector], Visit]


def rows_of(joints: Sequence[Joint]) -> list[Rows]:
    """A row for each kind, of the same symbols, with sine and cosine of the angle, or with the
    orientation, for the first sweep to keep."""
    symbols = ca.SX.sym("r", MOST_KEPT)
    rows = [Rows(symbols) for _ in joints]
    for joint, row in zip(joints, rows):
        if joint.turned is not None:
            row.values |= orientation(joint)
        elif joint.angle is not None:
            row.values |= {SINE: symbols[SINE], COSINE: symbols[COSINE]}
    return rows


def orientation(joint: Joint) -> dict[int, Scalar]:
    """What a row holds of an orientation that is no single angle."""
    return dict(enumerate((x for line in joint.turned or [] for x in line), TURNED))


def rising(
    title: str, joints: Sequence[Joint], rows: Sequence[Rows], step: Step, start: Vector
) -> Sweep:
    """From base to tip. Entries are zero everywhere where the ground's are and no link makes them
    otherwise."""
    alive = {k for k, x in enumerate(start) if not is_zero(x)}
    return _settled(title, True, joints, rows, step, start, alive)


def falling(
    title: str, joints: Sequence[Joint], rows: Sequence[Rows], step: Step, size: int
) -> Sweep:
    """From tip to base, `size` numbers."""
    return _settled(title, False, joints, rows, step, [0.0] * size, set())


def _settled(
    title: str,
    rising: bool,
    joints: Sequence[Joint],
    rows: Sequence[Rows],
    step: Step,
    start: Vector,
    alive: set[int],
) -> Sweep:
    symbols = ca.SX.sym("e", len(start))
    while True:
        received: Vector = [symbols[k] if k in alive else 0.0 for k in range(len(start))]
        visits = [step(joint, row, received) for joint, row in zip(joints, rows)]
        more = {k for visit in visits for k, x in enumerate(visit.handed) if not is_zero(x)}
        if more <= alive:
            break
        alive |= more
    order = sorted(alive)
    stores = [row.keep(visit.kept) for row, visit in zip(rows, visits)]
    return Sweep(
        title,
        rising,
        symbols[order],
        [start[k] for k in order],
        tuple(
            replace(visit, kept=stored, handed=[visit.handed[k] for k in order])
            for visit, stored in zip(visits, stores)
        ),
    )


def _is_number(x: Scalar) -> bool:
    return not isinstance(x, ca.SX) or x.is_constant()
