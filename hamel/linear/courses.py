"""The rows of a range in courses: each follows one branch of steady motions, from where that begins
to where it ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from derive.diagnostics import AssumptionError
from derive.linearize.branch import Place
from derive.linearize.critical import Critical, critical_values, turning
from derive.linearize.fold import Turn, turn
from derive.linearize.records import Steady
from derive.linearize.spectrum import eigenvalues, is_unstable
from derive.linearize.study import Study
from hamel.linear.limits import INSIDE, ON_ROW, SAME_PLACE
from hamel.linear.ranges import Range


@dataclass(frozen=True)
class Course:
    """Rows that follow each other on one branch. Where it turns back beyond a row, there is one row
    more, just before that. `first` and `last` are the values at which it begins and ends; in
    `critical` is what happens in between, and at its folds."""

    values: np.ndarray
    spectra: np.ndarray
    first: float
    last: float
    critical: tuple[Critical, ...]

    def intervals(self, grows: bool) -> tuple[tuple[float, float], ...]:
        """Those in which some mode grows, or in which none does."""
        flags = np.any(is_unstable(self.spectra), axis=1) == grows
        edges = [self._edge(k) for k in range(len(flags) - 1) if flags[k] != flags[k + 1]]
        ends = [*([self.first] if flags[0] else []), *edges, *([self.last] if flags[-1] else [])]
        alone = len(flags) == 1
        return tuple((a, b) for a, b in zip(ends[::2], ends[1::2]) if alone or a != b)

    def _edge(self, k: int) -> float:
        """The critical value between two rows at which stability changes."""
        a, b = sorted((float(self.values[k]), float(self.values[k + 1])))
        inside = [c for c in self.critical if a <= c.value <= b]
        marginal = [c for c in inside if abs(c.eigenvalue.real) <= 1e-6 * (1 + abs(c.eigenvalue))]
        return (marginal or inside)[0].value if inside else (a + b) / 2


def spectra_of(study: Study, motions: Steady) -> np.ndarray:
    """N × k; not numbers where there is no motion."""
    there = np.setdiff1d(np.arange(len(motions.p)), motions.absent)
    spectra = np.full((len(motions.p), len(study.reduced)), complex(np.nan, np.nan))
    if len(there):
        x, u, p = motions.x[there], motions.u[there], motions.p[there]
        spectra[there] = eigenvalues(study.matrices(Steady(x, u, p, motions.residual[there])))
    return spectra


def away(spectra: np.ndarray) -> np.ndarray:
    """How far each row is from where branches meet; −1 where there is none."""
    return np.nan_to_num(np.min(np.abs(spectra), axis=1, initial=np.inf), nan=-1.0, posinf=np.inf)


def runs(motions: Steady) -> list[tuple[int, int]]:
    """The rows of each course: the first, and the one after the last."""
    many, absent = len(motions.p), {*motions.absent}
    ends = sorted({0, many, *motions.breaks, *absent, *(k + 1 for k in absent)})
    return [(i, j) for i, j in pairwise(ends) if i not in absent]


def courses(study: Study, along: Range, motions: Steady, spectra: np.ndarray) -> list[Course]:
    """One for each run of rows."""
    p, s = study.values({along.name: along.values})
    y = np.hstack([motions.x, motions.u])
    places = [Place(*at) for at in zip(p, s, y)]
    return [_course(study, along, places, spectra, run) for run in runs(motions)]


def _course(
    study: Study,
    along: Range,
    places: Sequence[Place],
    spectra: np.ndarray,
    run: tuple[int, int],
) -> Course:
    """Where the branch turns back the last row is left out if it lies on the fold, or nearly."""
    first, end = run
    tails: dict[int, _Tail] = {}
    for side in (0, -1):
        with suppress(AssumptionError):
            if (found := _turning(study, along, places, (first, end), side)) is None:
                continue
            row, way = found
            tails[side] = _tail(study, along.name, way, spectra[row])
            first, end = (row, end) if side == 0 else (first, row + 1)
    values, own = along.values[first:end], spectra[first:end]
    matrix = _matrix(study, along.name, places[first:end], values, away(own))
    critical = list(critical_values(matrix, values, own))
    edges = [float(values[0]), float(values[-1])]
    for side, tail in tails.items():
        critical += tail.critical
        edges[side] = tail.fold
        place = 0 if side == 0 else len(values)
        values = np.insert(values, place, tail.value)
        own = np.insert(own, place, tail.spectrum, axis=0)
    rising = 1 if along.values[-1] >= along.values[0] else -1
    ordered = sorted(_told_once(critical), key=lambda c: rising * c.value)
    return Course(values, own, edges[0], edges[1], tuple(ordered))


def _turning(
    study: Study, along: Range, places: Sequence[Place], run: tuple[int, int], side: int
) -> tuple[int, Turn] | None:
    """The way to where a branch turns back beyond its first or last row, and the row from which it
    leads there: the one before, where that row is on the fold."""
    first, end = run
    own, out = (first, -1) if side == 0 else (end - 1, 1)
    beyond, inner = own + out, own - out
    if not 0 <= beyond < len(places):
        return None

    def way_from(row: int) -> Turn | None:
        """To the fold, on the way to the row beyond."""
        return turn(study.problem, places[row], places[beyond].p, places[beyond].s)

    def is_on(way: Turn) -> bool:
        """Whether the last row is on this fold."""
        apart = abs(study.value(along.name, way.fold) - along.values[own])
        return bool(apart <= ON_ROW * abs(along.values[beyond] - along.values[own]))

    way = way_from(own)
    if (way is None or is_on(way)) and first <= inner < end:
        other = way_from(inner)
        if other is not None and is_on(other):
            return inner, other
    return None if way is None else (own, way)


def _told_once(critical: Sequence[Critical]) -> list[Critical]:
    """Without the zero eigenvalue of a fold that a row lies on, where rounding makes its sign."""
    folds = [c.value for c in critical if c.kind == "fold"]
    return [
        c
        for c in critical
        if c.kind != "zero" or all(abs(c.value - f) > SAME_PLACE * abs(f) for f in folds)
    ]


@dataclass(frozen=True)
class _Tail:
    """From a row to a fold: eigenvalues just before it, at a value, and what happens on the way."""

    value: float
    spectrum: np.ndarray
    critical: list[Critical]
    fold: float


def _tail(study: Study, name: str, way: Turn, spectrum: np.ndarray) -> _Tail:
    """What happens is located along the branch. Raises AssumptionError where that has a gap."""

    def matrix(part: float) -> np.ndarray:
        """A part of the way along the branch."""
        return study.matrices(_motion(study, way.at(part)))[0]

    inside = eigenvalues(matrix(INSIDE)[np.newaxis])[0]
    found = critical_values(matrix, np.array([0.0, INSIDE]), np.vstack([spectrum, inside]))
    critical = [replace(c, value=study.value(name, way.at(c.value))) for c in found]
    critical.append(turning(study.value(name, way.fold), eigenvalues(matrix(1.0)[np.newaxis])[0]))
    return _Tail(study.value(name, way.at(INSIDE)), inside, critical, critical[-1].value)


def _motion(study: Study, place: Place) -> Steady:
    nx = study.equations.arguments[1].symbols.numel()
    x, u = np.split(place.y[np.newaxis], [nx], axis=1)
    return Steady(x, u, place.p[np.newaxis], np.zeros(1))


def _matrix(
    study: Study,
    name: str,
    places: Sequence[Place],
    values: np.ndarray,
    away: np.ndarray,
) -> Callable[[float], np.ndarray]:
    def matrix(value: float) -> np.ndarray:
        """From the row beside that is further from where branches meet: from others, Newton's
        method may come to another branch."""
        beside = np.argsort(np.abs(values - value), kind="stable")[:2]
        k = int(beside[np.argmax(away[beside])])
        return study.matrices(study.motions({name: [value]}, places[k]))[0]

    return matrix
