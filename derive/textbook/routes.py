"""One road, or two beside each other: what each costs, where each fails, and that they agree."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.states.sampling import states
from derive.textbook.formulas.terms import Terms
from derive.textbook.manuscript import Manuscript
from derive.textbook.records import Runs, Text
from derive.textbook.roads import ROADS, Road

SAMPLES = 8  # random admissible states at which roads are compared
MOST_ROADS = 2
ORDER = ("First", "Second")


def roads_of(terms: Terms, names: Sequence[str]) -> tuple[Road, ...]:
    """The roads of that name, in this order. Raises AssumptionError where the system cannot take
    one; equations in the generalized velocities take none, their formulation is their road."""
    known = {road.name: road for road in ROADS}
    for name in names:
        if name not in known:
            near = did_you_mean(name, list(known)) or f"there are {listed(list(known))}"
            raise ModelError(f"there is no road '{name}'; {near}")
    taken = tuple(known[name] for name in dict.fromkeys(names))
    if len(taken) > MOST_ROADS:
        raise ModelError("a page shows one road, or two beside each other")
    for road in taken:
        reason = "" if road is ROADS[0] else _misfit(terms, road)
        if reason:
            raise AssumptionError(f"{terms.system.model.name} cannot take {road.title}: {reason}")
    return taken


def _misfit(terms: Terms, road: Road) -> str:
    """Why the system cannot take a road."""
    if terms.equations.generalized_velocities:
        return f"the formulation {terms.equations.formulation} makes no choice of quasi-velocities"
    if not terms.w.numel():
        return "its constraints leave no freedom"
    if not terms.system.written:
        return "its mass matrix is not written out, which this road starts from"
    return road.misfit(terms)


def write_roads(doc: Manuscript, taken: Sequence[Road]) -> None:
    """The sections of the roads."""
    if len(taken) == 1:
        taken[0].write(doc)
        return
    before = set(doc.entries)
    for column, road in enumerate(taken, 1):
        doc.column = column
        # each road prints what it needs, as if the other were not there
        for name in set(doc.entries) - before:
            del doc.entries[name]
        doc.section(f"{ORDER[column - 1]} road: {road.title}")  # its own sections may be called so
        doc.say("{text}.", text=road.about[0].upper() + road.about[1:])
        road.write(doc)
    doc.column = 0
    _compared(doc, taken)


def _compared(doc: Manuscript, taken: Sequence[Road]) -> None:
    doc.section("The two roads compared")
    first, second = taken
    ways = [road.accelerations(doc.terms) for road in taken]
    difference, states_tried = _difference(doc, ways)
    doc.say(
        "Both roads come to the same accelerations. Evaluated from their own equations at "
        f"{states_tried} random admissible states they differ by at most "
        f"{difference:.1e} of their size:"
    )
    doc.law("same accelerations", r"!!w_{1}", r"!!w_{2}", ways[0] - ways[1])
    for road, way in zip(taken, ways):
        doc.check(f"{road.name} accelerations", way - doc.terms.wdot)
    counts = [_operations(way) for way in ways]
    rows: list[tuple[Runs, ...]] = [
        _row("unknowns", *(str(road.unknowns(doc.terms)) for road in taken)),
        _row("operations for the accelerations, written out", *map(str, counts)),
        _row("needs", first.needs, second.needs),
        _row("fails", first.fails, second.fails),
    ]
    doc.table(("", first.title, second.title), rows)
    doc.items(taken, lambda road: (Text(road.source),))


def _row(*texts: str) -> tuple[Runs, ...]:
    return tuple((Text(text),) for text in texts)


def _difference(doc: Manuscript, ways: Sequence[ca.SX]) -> tuple[float, int]:
    """The largest difference of accelerations, relative to their size."""
    s = doc.system
    function = ca.Function("roads", [s.t, s.q, s.v, s.u, s.p], _over_velocities(doc, ways))
    sample = states(s, SAMPLES, seed=1, parameters=0.1)
    worst = 0.0
    for place in zip(sample.t, sample.q, sample.v, sample.u, sample.p):
        one, other = (np.asarray(x) for x in function(*place))
        size = max(float(np.max(np.abs(one))), 1.0)
        worst = max(worst, float(np.max(np.abs(one - other))) / size)
    return worst, len(sample.t)


def _over_velocities(doc: Manuscript, ways: Sequence[ca.SX]) -> list[ca.SX]:
    """The terms with w = B v."""
    B_v = ca.mtimes(doc.terms.named("B"), doc.system.v)
    return [ca.densify(x) for x in ca.substitute(list(ways), [doc.terms.w], [B_v])]


def _operations(way: ca.SX) -> int:
    """Of a term, equal parts counted once."""
    return ca.Function("way", ca.symvar(way), [way]).n_instructions()
