"""A mode in words: how it goes on, and what moves in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from derive.linearize.sensitivity import Mode
from derive.linearize.study import Study
from derive.states.scales import scales
from hamel.linear.limits import FAINT, SAME, SEEN
from hamel.records import Linearized


def course(eigenvalue: complex) -> str:
    """What becomes of the mode: growth or decay, and its frequency."""
    size = abs(eigenvalue)
    growth = eigenvalue.real
    if abs(growth) <= SAME * size:
        change = "neither grows nor decays"
    elif growth > 0:
        change = f"grows, doubling in {math.log(2) / growth:.3g} s"
    else:
        change = f"decays by half in {math.log(2) / -growth:.3g} s"
    if abs(eigenvalue.imag) <= SAME * size:
        return change
    return f"oscillates at {abs(eigenvalue.imag) / (2 * math.pi):.3g} Hz and {change}"


def branches(record: Linearized) -> str:
    """Where the branch of steady motions ends and another one is followed; "" where none does."""
    if not record.breaks:
        return ""
    ends = [(record.rows[k - 1], record.rows[k]) for k in record.breaks]
    if len(record.swept) != 1:
        return f"the branch of steady motions ends in {len(ends)} places of the map"
    name = record.swept[0]
    places = [f"{name} = {before[name]:.6g} and {after[name]:.6g}" for before, after in ends]
    between = ", and between ".join(places)
    return f"the branch of steady motions ends between {between}: rows beyond are of another one"


def without(record: Linearized) -> str:
    """Where there is no steady motion; "" where there is one at every row."""
    if not record.absent:
        return ""
    if len(record.swept) != 1:
        return f"no steady motion was found at {len(record.absent)} places of the map"
    name, rows = record.swept[0], record.rows
    places = []
    for _, group in groupby(enumerate(record.absent), lambda pair: pair[1] - pair[0]):
        run = [k for _, k in group]
        first, last = rows[run[0]][name], rows[run[-1]][name]
        places.append(f"{first:.6g}" if len(run) == 1 else f"{first:.6g} … {last:.6g}")
    return f"no steady motion was found at {name} = {', '.join(places)}"


def shape(study: Study, mode: Mode) -> str:
    """The amplitudes of the coordinates that matter, relative to the largest of the same unit, and
    how far they lag; velocities where no coordinate moves. What is rounding beside others does not
    move."""
    form = study.linear
    left = [k for k in range(len(form.states)) if k not in study.cyclic]
    sizes = np.abs(mode.vector) / scales(study.equations.system.model).all_of(form.units)
    moving = [k for k in left if sizes[k] > FAINT * np.max(sizes[left])]
    nq = study.equations.system.q.numel()
    places = [k for k in moving if form.independent[k] < nq] or moving
    groups = _by_unit(form.units, places)
    return "; ".join(_group(form.states, mode.vector, group) for group in groups)


def _by_unit(units: Sequence[str], places: Sequence[int]) -> list[list[int]]:
    return [
        [k for k in places if units[k] == unit] for unit in dict.fromkeys(units[k] for k in places)
    ]


def _group(names: Sequence[str], vector: np.ndarray, group: Sequence[int]) -> str:
    first = max(group, key=lambda k: abs(vector[k]))
    others = sorted((k for k in group if k != first), key=lambda k: -abs(vector[k]))
    parts = [
        _relative(names[k], vector[k] / vector[first])
        for k in others
        if abs(vector[k]) > SEEN * abs(vector[first])
    ]
    return ", ".join([f"{names[first]} 1", *parts])


def _relative(name: str, ratio: complex) -> str:
    angle = math.degrees(math.atan2(ratio.imag, ratio.real))
    if abs(ratio.imag) <= 1e-6 * abs(ratio):
        return f"{name} {ratio.real:.3g}"
    return f"{name} {abs(ratio):.3g} ({abs(angle):.0f}° {'ahead' if angle > 0 else 'behind'})"
