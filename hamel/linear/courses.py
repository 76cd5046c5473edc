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
from hamel.linear.limits import INSIDE
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
        return tuple(zip(ends[::2], ends[1::2]))

    def _edge(self, k: int) -> float:
        """The critical value between two rows at which stability changes."""
        a, b = sorted((float(self.values[k]), float(self.values[k + 1])))
        inside = [c for c in self.critical if a <= c.value <= b]
        marginal = [c for c in inside if abs(c.eigenvalue.real) <= 1e-6 * (1 + abs(c.eigenvalue))]
        return (marginal or inside)[0].value if inside else (a + b) / 2


def spectra_of(study: Study, motions: Steady) -> np.ndarray:
    """N × k; not numbers where there is no motion."""
    A = study.matrices(motions)
    there = np.setdiff1d(np.arange(len(A)), motions.absent)
    spectra = np.full(A.shape[:2], complex(np.nan, np.nan))
    spectra[there] = eigenvalues(A[there])
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
    first, end = run
    values, spectra = along.values[first:end], spectra[first:end]
    matrix = _matrix(study, along.name, places[first:end], values, away(spectra))
    critical = list(critical_values(matrix, values, spectra))
    edges = [float(values[0]), float(values[-1])]
    for side, own, beyond in ((0, first, first - 1), (-1, end - 1, end)):
        if not 0 <= beyond < len(places):
            continue
        way = turn(study.problem, places[own], places[beyond].p, places[beyond].s)
        with suppress(AssumptionError):
            if way is None:
                continue
            tail = _tail(study, along.name, way, spectra[side])
            critical += tail.critical
            edges[side] = study.value(along.name, way.fold)
            place = 0 if side == 0 else len(values)
            values = np.insert(values, place, tail.value)
            spectra = np.insert(spectra, place, tail.spectrum, axis=0)
    rising = 1 if along.values[-1] >= along.values[0] else -1
    ordered = sorted(critical, key=lambda c: rising * c.value)
    return Course(values, spectra, edges[0], edges[1], tuple(ordered))


@dataclass(frozen=True)
class _Tail:
    """From a row to a fold: eigenvalues just before it, at a value, and what happens on the way."""

    value: float
    spectrum: np.ndarray
    critical: list[Critical]


def _tail(study: Study, name: str, way: Turn, spectrum: np.ndarray) -> _Tail:
    """What happens is located along the branch. Raises AssumptionError where that has a gap."""

    def matrix(part: float) -> np.ndarray:
        """A part of the way along the branch."""
        return study.matrices(_motion(study, way.at(part)))[0]

    inside = eigenvalues(matrix(INSIDE)[np.newaxis])[0]
    found = critical_values(matrix, np.array([0.0, INSIDE]), np.vstack([spectrum, inside]))
    critical = [replace(c, value=study.value(name, way.at(c.value))) for c in found]
    critical.append(turning(study.value(name, way.fold), eigenvalues(matrix(1.0)[np.newaxis])[0]))
    return _Tail(study.value(name, way.at(INSIDE)), inside, critical)


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
