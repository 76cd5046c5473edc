"""A study along one range or over two: rows of eigenvalues, critical values, and where the motion
is stable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from derive.diagnostics import AssumptionError
from derive.linearize.branch import Place
from derive.linearize.critical import Critical
from derive.linearize.records import Steady
from derive.linearize.spectrum import is_unstable
from derive.linearize.study import Study
from hamel.linear.courses import Course, away, courses, runs, spectra_of
from hamel.linear.ranges import Range
from hamel.settings import units


@dataclass(frozen=True)
class Sweep:
    """`values`: one column per swept name, a row for each motion; `spectra`: N × k, not numbers
    for the rows `absent`."""

    names: tuple[str, ...]
    values: np.ndarray
    spectra: np.ndarray
    labels: tuple[str, ...] = ()  # the names with their units, where these are known
    breaks: tuple[int, ...] = ()  # rows on another branch of motions than the row before
    absent: tuple[int, ...] = ()  # rows for which there is no steady motion
    courses: tuple[Course, ...] = ()  # along a single range

    @property
    def grows(self) -> np.ndarray:
        """Which rows have an eigenvalue to the right of the imaginary axis."""
        return np.any(is_unstable(self.spectra), axis=1)

    @property
    def critical(self) -> tuple[Critical, ...]:
        """Where the kind of motion changes along a single range."""
        return tuple(c for course in self.courses for c in course.critical)

    @property
    def stable(self) -> tuple[tuple[float, float], ...]:
        """Along a single range: intervals in which every eigenvalue is to the left of the imaginary
        axis (or on it)."""
        return tuple(ends for course in self.courses for ends in course.intervals(False))

    @property
    def unstable(self) -> tuple[tuple[float, float], ...]:
        """Along a single range: intervals in which some eigenvalue is to the right of it."""
        return tuple(ends for course in self.courses for ends in course.intervals(True))


def swept(study: Study, ranges: Sequence[Range]) -> Sweep:
    """Eigenvalues at every value of one range, or on the grid of two (the second runs faster).
    Raises AssumptionError where no row has a steady motion."""
    if not ranges:
        return Sweep((), np.zeros((1, 0)), spectra_of(study, study.motions({})))
    if len(ranges) == 1:
        return _line(study, ranges[0])
    outer, inner = ranges
    many = len(inner.values)
    lines = _lines(study, outer, inner)
    values = np.column_stack(
        [np.repeat(outer.values, many), np.tile(inner.values, len(outer.values))]
    )
    names = (outer.name, inner.name)
    return Sweep(
        names,
        values,
        np.concatenate([spectra_of(study, line) for line in lines]),
        tuple(_label(study, name) for name in names),
        tuple(i * many + k for i, line in enumerate(lines) for k in line.breaks),
        tuple(i * many + k for i, line in enumerate(lines) for k in line.absent),
    )


def _lines(study: Study, outer: Range, inner: Range) -> list[Steady]:
    """The motions of a map, line by line from the one nearest to the motion that is studied. Each
    is followed from the row of the line before that is furthest from where branches meet, of those
    that are still on the branch."""
    near = int(np.argmin(np.abs(outer.values - study.at[outer.name])))
    rows = {near: int(np.argmin(np.abs(inner.values - study.at[inner.name])))}
    origins, lines = {near: study.origin}, dict[int, Steady]()
    for k in (*range(near, -1, -1), *range(near + 1, len(outer.values))):
        values = {outer.name: np.full(len(inner.values), outer.values[k]), inner.name: inner.values}
        try:
            line = study.motions(values, origins[k])
        except AssumptionError:
            line = _without(study, values)
        lines[k] = line
        row, place = _furthest(study, line, values, rows[k]) or (rows[k], origins[k])
        for beside in (k - 1, k + 1):
            rows.setdefault(beside, row)
            origins.setdefault(beside, place)
    return [lines[k] for k in range(len(outer.values))]


def _without(study: Study, values: dict[str, np.ndarray]) -> Steady:
    """A line without any motion."""
    p, ny = study.values(values)[0], len(study.origin.y)
    x, u = np.split(np.full((len(p), ny), np.nan), [study.problem.function.size1_in(0)], axis=1)
    return Steady(x, u, p, np.full(len(p), np.nan), (), tuple(range(len(p))))


def _furthest(
    study: Study, line: Steady, values: dict[str, np.ndarray], row: int
) -> tuple[int, Place] | None:
    """The row that is furthest from where branches meet, of those on the branch of this one, and
    its motion; None where it has none."""
    course = next((run for run in runs(line) if run[0] <= row < run[1]), None)
    if course is None:
        return None
    first, end = course
    best = first + int(np.argmax(away(spectra_of(study, line))[first:end]))
    y = np.append(line.x[best], line.u[best])
    return best, Place(line.p[best], study.values(values)[1][best], y)


def _label(study: Study, name: str) -> str:
    """A parameter, input, coordinate or velocity has a unit; other names of a steady motion none
    that is known."""
    known = units(study.equations.system.model)
    return f"{name} ({known[name] or '1'})" if name in known else name


def _line(study: Study, along: Range) -> Sweep:
    motions = study.motions({along.name: along.values})
    spectra = spectra_of(study, motions)
    return Sweep(
        (along.name,),
        along.values[:, np.newaxis],
        spectra,
        (_label(study, along.name),),
        motions.breaks,
        motions.absent,
        tuple(courses(study, along, motions, spectra)),
    )
