"""The function `kinks` against the reference's forces: where formulas of the model and contacts go
on to another piece, and the forces have a jump or a bend there, some entry changes its sign.

Only where an entry changes its sign has a meaning: a factor, or the other sign, is no error, and a
change of sign where nothing happens costs a step and no more. What turns is read off the formulas
of the file; forces of paths and tyres have places of their own that no formula names, and these are
not looked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np

from derive.model.load_records import Contact
from hamel.verify.checks.check import Check
from hamel.verify.checks.evidence import Evidence, Row
from hamel.verify.checks.motion import sides
from hamel.verify.reference.contact import turning
from hamel.verify.reference.outcome import Reference, evaluate, state_of
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array

LINES = 3  # from state to state, along which kinks are looked for …
PARTS = 16  # … in so many parts, in each of which a side turns once or not at all
HALVINGS = 26  # of a part, to the place where it turns: a thousandth of NEAR
WORK = 2_000  # sides times turns that are looked at …
FEWEST = 4  # … but never fewer turns
NEAR = 1e-6  # of such a line: forces are looked at so far before and behind the place
FLAT = 1e-9  # of the largest force: rounding and curvature leave no larger jump
STRAIGHT = 1e-6  # … and of that per line, no larger bend
BENT = 1e-3  # of the slopes: a smaller difference of them is curvature
LASTS = 0.5  # of a jump or bend, at a tenth of the distance: of curvature a tenth is left
REACH = 2.0  # of a step: how far differences of five points look
SHORTER = (1.0, 1 / 4, 1 / 16, 1 / 64, 1 / 256)  # of it; what is nearer to a kink hardly ever is


def kinks(e: Evidence) -> float | None:
    """The share of the jumps and bends of the reference's forces, on lines between states, at which
    no entry of the function changes its sign; None where the lines meet none of them."""
    if not e.graph.has("kinks"):
        return None
    lines = [Line(e, k) for k in range(min(LINES, len(e.samples)))]
    turns = [(line, part, which) for line in lines for part, which in _turns(line)]
    seen = [*_seen(turns[:: _every(e, len(turns))])]
    return 1.0 - sum(seen) / len(seen) if seen else None


def _turns(line: Line) -> list[tuple[int, int]]:
    """In which part of the line which side turns."""
    grid = [line.sides(place) for place in np.linspace(0.0, 1.0, PARTS + 1)]
    return [
        (part, int(which))
        for part, (before, after) in enumerate(pairwise(grid))
        for which in np.flatnonzero(before * after < 0.0)
    ]


def _every(e: Evidence, turns: int) -> int:
    """Of many turns of many sides some are looked at: each takes as long as there are sides."""
    sides_of = len(Line(e, 0).sides(0.0)) if turns else 1
    looked_at = max(FEWEST, WORK // max(1, sides_of))
    return max(1, ceil(turns / looked_at))


def _seen(turns: Sequence[tuple[Line, int, int]]) -> Iterator[bool]:
    """Of every jump and bend at one of these whether the function has it."""
    for line, part, which in turns:
        place = line.turn(which, part / PARTS, (part + 1) / PARTS)
        if line.breaks(place):
            yield line.is_noticed(place)


class Break(NamedTuple):
    """How far forces before and behind a place are apart when both are carried on to it, and how
    far their slopes are; and the sizes of slopes and forces."""

    jump: Array
    bend: Array
    steep: Array
    size: float


@dataclass(frozen=True)
class Line:
    """From state k to the next, t, x and u in proportion; a place on it is between 0 and 1."""

    e: Evidence
    k: int

    def row(self, place: float) -> Row:
        """(t, x, u, p), with the parameters of the first state."""
        e, other = self.e, (self.k + 1) % len(self.e.samples)
        ends = [(e.samples[i].t, e.x[i], e.samples[i].u) for i in (self.k, other)]
        t, x, u = (a + place * (b - a) for a, b in zip(*ends))
        return float(t), x, u, e.samples[self.k].p

    def state(self, place: float) -> State:
        """The reference's state there, at the choice's own velocities."""
        e, s = self.e, self.e.samples[self.k]
        t, x, u, p = self.row(place)
        v, z = e.graph("velocity", t, x, u, p), x[e.graph.equations.speeds.stop :]
        return state_of(e.reference, t, x[: len(s.q)], v, u, s.full_with(z))

    def sides(self, place: float) -> Array:
        """What changes its sign where a formula or a contact goes on to another piece."""
        return _sides_at(self.e.reference, self.state(place))

    def turn(self, which: int, before: float, after: float) -> float:
        """The place where one of them does, between two places."""
        first = self.sides(before)[which]
        for _ in range(HALVINGS):
            middle = (before + after) / 2.0
            if self.sides(middle)[which] * first > 0.0:
                before = middle
            else:
                after = middle
        return after

    def forces(self, place: float) -> Array:
        """What the motion is made of, in the model's own units."""
        units, outcome = self.e.units, evaluate(self.e.reference, self.state(place))
        rows = outcome.kinematics
        terms = ((outcome.force, units.force), (outcome.zdot, units.zdot))
        tied = ((rows.c, units.rows), (rows.beta, units.beta))
        return np.concatenate([value / unit for value, unit in (*terms, *tied)])

    def breaks(self, place: float) -> bool:
        """Whether the reference's forces have a jump or a bend there."""
        far, near = self._break(place, NEAR), self._break(place, NEAR / 10.0)
        jumps = (far.jump > FLAT * far.size) & (near.jump > LASTS * far.jump)
        least = BENT * far.steep + STRAIGHT * far.size
        bends = (far.bend > least) & (near.bend > LASTS * far.bend)
        return bool(np.any(jumps | bends))

    def _break(self, place: float, step: float) -> Break:
        a, b, c, d = (self.forces(place + way * step) for way in (-2, -1, 1, 2))
        size = float(np.max(np.abs([a, b, c, d]), initial=0.0))
        slopes = (b - a) / step, (d - c) / step
        steep = np.abs(slopes[0]) + np.abs(slopes[1])
        return Break(np.abs((2 * c - d) - (2 * b - a)), np.abs(slopes[1] - slopes[0]), steep, size)

    def is_noticed(self, place: float) -> bool:
        """Whether some entry of the function changes its sign there."""
        before, after = (self.e.graph("kinks", *self.row(place + way)) for way in (-NEAR, NEAR))
        return bool(np.any(np.ravel(before) * np.ravel(after) < 0.0))


def _sides_at(ref: Reference, state: State) -> Array:
    contacts = [x for x in ref.model.loads if isinstance(x, Contact)]
    touching = [y for x in contacts for y in turning(x, ref.model.plane, state)]
    return np.array([*(state.value(side) for side in sides(ref.model)), *touching])


def step_within_piece(e: Evidence, at: Callable[[float], State], step: float) -> float:
    """The step of differences along `at`, shortened where they would look across a kink: there no
    order holds, and two steps may by chance agree on what is wrong."""

    def is_within(share: float) -> bool:
        ends = (_sides_at(e.reference, at(way * share * step)) for way in (-REACH, REACH))
        return all(np.array_equal(np.sign(end), here) for end in ends)

    here = np.sign(_sides_at(e.reference, at(0.0)))
    if not len(here):
        return step
    return step * next(filter(is_within, SHORTER), SHORTER[-1])


CHECKS = (
    Check(
        "kinks",
        0.0,
        "reference: jumps and bends of the forces where formulas and contacts turn",
        kinks,
    ),
)
