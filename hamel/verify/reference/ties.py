"""What holds the branches of a tree together, without a matrix over all of it: rows of closures and
rods over the twists of the bodies they touch, forces along them, and accelerations that keep them.

Rows of A are found as forces: by virtual power the row over v of a unit force along a tie is what
each joint between its bodies and the ground feels of it. A Aᵀ is factored in an order that leaves
few entries, the row with the fewest neighbours first (H. M. Markowitz, Management Science 3 (1957)
255–269): time grows with the number of loops where each shares bodies with few others.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from derive.model.constraint_records import Distance
from derive.model.records import GROUND, Closure, Model
from hamel.verify.reference.balance import Balance, at_joint, moved, twist_rates
from hamel.verify.reference.closures import closure_rows
from hamel.verify.reference.layout import Layout, Rows
from hamel.verify.reference.rows import distance_row
from hamel.verify.reference.states import Seat, State
from hamel.verify.reference.vectors import Array

Sparse = dict[int, float]  # place → entry
DEPENDENT = 1e-11  # pivots of squares below this part of what they were: the row repeats others
REFINED = 2  # steps of refinement: squares lose digits


@dataclass(frozen=True)
class Tie:
    """The rows of one closure or rod over the twists of its bodies, six each."""

    bodies: tuple[str, ...]
    rows: Rows

    def at(self, twists: dict[str, Array]) -> Array:
        """Rows times twists, or twist rates."""
        return self.rows.coefficients @ np.concatenate([twists[body] for body in self.bodies])


def are_ties(model: Model) -> bool:
    """Whether all that holds the branches together are closures and rods."""
    return all(isinstance(item, Distance) for item in model.constraints)


def ties(model: Model, s: State) -> list[Tie]:
    """Of each closure, then of each rod, in the model's order."""
    return [_tie(model, s, item) for item in (*model.closures, *model.constraints)]


def _tie(model: Model, s: State, item: object) -> Tie:
    assert isinstance(item, Closure | Distance)
    bodies = tuple(dict.fromkeys(body for body in item.bodies if body != GROUND))
    place = Layout(0, bodies)
    if isinstance(item, Closure):
        return Tie(bodies, closure_rows(item, model.plane, place, s))
    return Tie(bodies, distance_row(item, place, s))


def rows_over_velocities(s: State, found: Sequence[Tie]) -> list[Sparse]:
    """A (nc × nv), row by row, without zeros."""
    seats = {seat.joint.child: seat for seat in s.seats}
    result: list[Sparse] = []
    for tie in found:
        for row in tie.rows.coefficients:
            own: Sparse = {}
            for k, body in enumerate(tie.bodies):
                _felt(own, seats, body, row[6 * k : 6 * k + 6])
            result.append({j: x for j, x in own.items() if x != 0.0})
    return result


def _felt(row: Sparse, seats: dict[str, Seat], body: str, wrench: Array) -> None:
    """What the joints that carry a body feel of a wrench about its origin."""
    while body != GROUND:
        seat = seats[body]
        there = at_joint(seat, wrench)
        columns = range(seat.columns.start, seat.columns.stop)
        for j, x in zip(columns, seat.twists.T @ there):
            row[j] = row.get(j, 0.0) + float(x)
        wrench, body = moved(there, seat.arm_parent), seat.joint.parent


@dataclass(frozen=True)
class Violation:
    """φ, A v − c and what they are sums of; zero at an admissible state."""

    phi: Array
    rate: Array
    size: Array  # of the rates


def violation(s: State, found: Sequence[Tie]) -> Violation:
    """Of all ties, one after the other."""
    twists = {body: np.concatenate([x.omega, x.velocity]) for body, x in s.frames.items()}
    sizes = {body: np.abs(x) for body, x in twists.items()}
    rates = [tie.at(twists) - tie.rows.c for tie in found]
    parts = [
        np.abs(tie.rows.coefficients) @ np.concatenate([sizes[body] for body in tie.bodies])
        for tie in found
    ]
    return Violation(_joined(tie.rows.phi for tie in found), _joined(rates), _joined(parts))


def _joined(parts: Iterable[Array]) -> Array:
    return np.concatenate([np.zeros(0), *parts])


def accelerations(
    s: State, found: Sequence[Tie], A: Sequence[Sparse], given: dict[int, float]
) -> tuple[Array, float]:
    """v̇ with A v̇ = β and the `given` entries; and what is left of the rows, of the sizes of what
    they sum. With as many entries given as there are degrees of freedom it is the only one."""
    vdot = np.zeros(len(s.v))
    for j, x in given.items():
        vdot[j] = x
    others = [{j: x for j, x in row.items() if j not in given} for row in A]
    factors = factored(others)
    left, size = _left(s, found, vdot)
    for _ in range(1 + REFINED):
        for row, y in zip(others, factors.solution(left)):
            for j, x in row.items():
                vdot[j] += x * y
        left, size = _left(s, found, vdot)
    return vdot, float(np.max(np.abs(left) / np.maximum(size, np.max(size, initial=1e-300))))


def _left(s: State, found: Sequence[Tie], vdot: Array) -> tuple[Array, Array]:
    rates = twist_rates(s, vdot)
    sizes = {body: np.abs(x) for body, x in rates.items()}
    left = [tie.rows.gamma - tie.at(rates) for tie in found]
    size = [
        np.abs(tie.rows.gamma)
        + np.abs(tie.rows.coefficients) @ np.concatenate([sizes[body] for body in tie.bodies])
        for tie in found
    ]
    return _joined(left), _joined(size)


def forces(A: Sequence[Sparse], wanted: Balance) -> Array:
    """λ for which Aᵀ λ is nearest to M v̇ + h − Q, each joint's in the sizes of what it sums."""
    scale = 1.0 / np.maximum(wanted.size, 1e-300)
    scaled = [{j: x * float(scale[j]) for j, x in row.items()} for row in A]
    side, lam = wanted.left * scale, np.zeros(len(A))
    factors = factored(scaled)
    for _ in range(1 + REFINED):
        left = side - carried_back(scaled, lam, len(side))
        lam = lam + factors.solution(np.array([_dot(row, left) for row in scaled]))
    return lam


def _dot(row: Sparse, x: Array) -> float:
    return sum(value * float(x[j]) for j, value in row.items())


def carried_back(A: Sequence[Sparse], lam: Array, n: int) -> Array:
    """Aᵀ λ."""
    result = np.zeros(n)
    for row, y in zip(A, lam):
        for j, x in row.items():
            result[j] += x * y
    return result


@dataclass(frozen=True)
class Factors:
    """A Aᵀ = L D Lᵀ: for each row in its turn the row, its pivot, and the factors of those it
    couples to. A row without a pivot repeats others."""

    steps: tuple[tuple[int, float, Sparse], ...]

    def solution(self, b: Array) -> Array:
        """y of A Aᵀ y = b; zero for rows that repeat others."""
        y = np.array(b, dtype=float)
        for k, _, below in self.steps:
            for i, factor in below.items():
                y[i] -= factor * y[k]
        for k, pivot, below in reversed(self.steps):
            rest = sum(factor * y[i] for i, factor in below.items())
            y[k] = y[k] / pivot - rest if pivot else 0.0
        return y


def factored(A: Sequence[Sparse]) -> Factors:
    """The row with the fewest neighbours first."""
    G = _squares(A)
    first = [row.get(i, 0.0) for i, row in enumerate(G)]
    heap = [(len(row), i) for i, row in enumerate(G)]
    heapq.heapify(heap)
    done: set[int] = set()
    steps: list[tuple[int, float, Sparse]] = []
    while heap:
        degree, k = heapq.heappop(heap)
        if k in done or degree != len(G[k]):
            continue
        done.add(k)
        pivot = G[k].pop(k, 0.0)
        own, G[k] = G[k], {}
        repeats = pivot <= DEPENDENT * first[k]
        factors = {} if repeats else {i: x / pivot for i, x in own.items()}
        for i in own:
            row = G[i]
            row.pop(k)
            for j, x in own.items() if factors else ():
                row[j] = row.get(j, 0.0) - factors[i] * x
            heapq.heappush(heap, (len(row), i))
        steps.append((k, 0.0 if repeats else pivot, factors))
    return Factors(tuple(steps))


def _squares(A: Sequence[Sparse]) -> list[Sparse]:
    """A Aᵀ without zeros."""
    columns: dict[int, list[tuple[int, float]]] = {}
    for i, row in enumerate(A):
        for j, x in row.items():
            columns.setdefault(j, []).append((i, x))
    G: list[Sparse] = [{} for _ in A]
    for entries in columns.values():
        for i, x in entries:
            for k, y in entries:
                G[i][k] = G[i].get(k, 0.0) + x * y
    return G
