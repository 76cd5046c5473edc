"""A study along one range or over two: rows of eigenvalues, critical values, and where the motion
is stable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from derive.linearize.branch import Place
from derive.linearize.critical import Critical, critical_values
from derive.linearize.records import Steady
from derive.linearize.spectrum import eigenvalues, is_unstable
from derive.linearize.study import Study
from hamel.linear.ranges import Range
from hamel.settings import units


@dataclass(frozen=True)
class Sweep:
    """`values`: one column per swept name, a row for each motion; `spectra`: N × k."""

    names: tuple[str, ...]
    values: np.ndarray
    spectra: np.ndarray
    critical: tuple[Critical, ...]  # along a single range
    labels: tuple[str, ...] = ()  # the names with their units, where these are known
    breaks: tuple[int, ...] = ()  # rows on another branch of motions than the row before

    @property
    def unstable(self) -> np.ndarray:
        """Which rows have an eigenvalue to the right of the imaginary axis."""
        return np.any(is_unstable(self.spectra), axis=1)

    @property
    def stable(self) -> tuple[tuple[float, float], ...]:
        """Along a single range: intervals in which every eigenvalue is to the left of the imaginary
        axis (or on it)."""
        if len(self.names) != 1:
            return ()
        flags, crossings, values = ~self.unstable, [], self.values[:, 0]
        start = float(values[0]) if flags[0] else None
        for k in range(len(flags) - 1):
            if flags[k] == flags[k + 1] and k + 1 not in self.breaks:
                continue
            end, beginning = self._edges(k)
            if start is not None:
                crossings.append((start, end))
            start = beginning if flags[k + 1] else None
        return (*crossings, *([] if start is None else [(start, float(values[-1]))]))

    def _edges(self, k: int) -> tuple[float, float]:
        """Where what row k says ends, and what the next says begins: at the critical value at which
        stability changes, or at the rows where the branch ends between them."""
        a, b = float(self.values[k, 0]), float(self.values[k + 1, 0])
        if k + 1 in self.breaks:
            return a, b
        edge = self._edge(a, b)
        return edge, edge

    def _edge(self, a: float, b: float) -> float:
        """The critical value between two rows at which stability changes."""
        inside = [c for c in self.critical if min(a, b) <= c.value <= max(a, b)]
        marginal = [c for c in inside if abs(c.eigenvalue.real) <= 1e-6 * (1 + abs(c.eigenvalue))]
        return (marginal or inside)[0].value if inside else (a + b) / 2


def swept(study: Study, ranges: Sequence[Range]) -> Sweep:
    """Eigenvalues at every value of one range, or on the grid of two (the second runs faster)."""
    if not ranges:
        return Sweep((), np.zeros((1, 0)), eigenvalues(study.along({})), ())
    if len(ranges) == 1:
        return _line(study, ranges[0])
    outer, inner = ranges
    many = len(inner.values)
    lines = _lines(study, outer, inner)
    spectra = eigenvalues(np.concatenate([study.matrices(line) for line in lines]))
    breaks = tuple(i * many + k for i, line in enumerate(lines) for k in line.breaks)
    values = np.column_stack(
        [np.repeat(outer.values, many), np.tile(inner.values, len(outer.values))]
    )
    names = (outer.name, inner.name)
    labels = tuple(_label(study, name) for name in names)
    return Sweep(names, values, spectra, (), labels, breaks)


def _lines(study: Study, outer: Range, inner: Range) -> list[Steady]:
    """The motions of a map, line by line from the one nearest to the motion that is studied. Each
    is followed from the row of the line before that is furthest from where branches meet, of those
    that are still on the branch."""
    near = int(np.argmin(np.abs(outer.values - study.at[outer.name])))
    rows = {near: int(np.argmin(np.abs(inner.values - study.at[inner.name])))}
    origins, lines = {near: study.origin}, dict[int, Steady]()
    for k in (*range(near, -1, -1), *range(near + 1, len(outer.values))):
        values = {outer.name: np.full(len(inner.values), outer.values[k]), inner.name: inner.values}
        line = lines[k] = study.motions(values, origins[k])
        away = _away(eigenvalues(study.matrices(line)))
        first, last = _unbroken(line, rows[k])
        row = first + int(np.argmax(away[first:last]))
        place = Place(
            line.p[row], study.values(values)[1][row], np.append(line.x[row], line.u[row])
        )
        for beside in (k - 1, k + 1):
            rows.setdefault(beside, row)
            origins.setdefault(beside, place)
    return [lines[k] for k in range(len(outer.values))]


def _unbroken(line: Steady, row: int) -> tuple[int, int]:
    """The rows around one that are of the same branch, the last of them excluded."""
    ends = (0, *line.breaks, len(line.p))
    return max(k for k in ends if k <= row), min(k for k in ends if k > row)


def _away(spectra: np.ndarray) -> np.ndarray:
    """How far each row is from where branches meet."""
    return np.min(np.abs(spectra), axis=1, initial=np.inf)


def _label(study: Study, name: str) -> str:
    """A parameter, input, coordinate or velocity has a unit; other names of a steady motion none
    that is known."""
    known = units(study.equations.system.model)
    return f"{name} ({known[name] or '1'})" if name in known else name


def _line(study: Study, along: Range) -> Sweep:
    motions, (p, s) = (
        study.motions({along.name: along.values}),
        study.values({along.name: along.values}),
    )
    y = np.hstack([motions.x, motions.u])

    spectra = eigenvalues(study.matrices(motions))
    away = _away(spectra)

    def matrix(value: float) -> np.ndarray:
        """From the row beside that is further from where branches meet: from others, Newton's
        method may come to another branch."""
        beside = np.argsort(np.abs(along.values - value), kind="stable")[:2]
        k = int(beside[np.argmax(away[beside])])
        return study.matrices(study.motions({along.name: [value]}, Place(p[k], s[k], y[k])))[0]

    return Sweep(
        (along.name,),
        along.values[:, np.newaxis],
        spectra,
        critical_values(matrix, along.values, spectra, motions.breaks),
        (_label(study, along.name),),
        motions.breaks,
    )
