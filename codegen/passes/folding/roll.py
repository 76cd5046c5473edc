"""roll: a recursion over links becomes a kernel of loops, with one straight-line body for each kind
of link. Every body goes through the passes of any other function."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from codegen.passes.names import RESERVED, Names, identifier
from codegen.passes.rewriting.improve import count, improve, used_operations
from codegen.passes.rewriting.trace import record
from codegen.passes.schedule import Scheduled, schedule
from codegen.program import (
    BASE,
    KINDS,
    PREVIOUS,
    Angle,
    Argument,
    Entry,
    Expression,
    Kernel,
    Read,
    Rolled,
    Sweep,
    Table,
    Visit,
)
from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.expressions.scalars import Scalar
from derive.formulations.records import Function
from derive.mechanics.loops import records
from derive.mechanics.loops.records import Recursion

ROLLS = AUTO, NEVER, ALWAYS = ("auto", "never", "always")
# Links from which loops take less time than what they are unrolled to, scalar and in lanes; with
# fewer they do where they have no more operations (measured: oblique chains from 8 links on). And
# links for each kind, for a processor cannot foresee which comes next (60 of 12 kinds take 16 %
# longer).
FROM, PER_KIND = 40, 10
# … and on a free base, where robots have axes along each other's: written out, that saves half
FROM_FREE = 64
# times as many operations that loops may have where they alone have lanes (measured: humanoids of
# 30 links with 1.4 times as many take as long for one state, with 2.1 times half as long again)
WORTH_LANES = 1.5
FEWEST = 3  # of each kind: with fewer the code of all kinds is as long
# what loops over links call their own, in C and Python
_LOCALS = """
i j n k f r e here sine cosine sines cosines angle angles slot slots tables constants come go start
kind kinds rising singular
"""
LOCALS = frozenset(_LOCALS.split())


@dataclass(frozen=True)
class Loops:
    """A kernel, and the lines of the ledger."""

    kernel: Kernel
    entries: tuple[Entry, ...]


def check_roll(roll: str) -> None:
    """Raises ModelError for a word that says nothing of loops."""
    if roll not in ROLLS:
        raise ModelError(f"roll is '{roll}'", did_you_mean(roll, ROLLS) or f"it is {listed(ROLLS)}")


def refusal(function: Function, roll: str, links: int) -> str | None:
    """Why the function is not rolled; nothing where that was not wanted or links are few, None
    where it is to be.

    Raises AssumptionError where it always should be.
    """
    if roll == NEVER or function.recursion is None or (roll == AUTO and links < PER_KIND):
        return ""
    try:
        kinds = len(function.recursion().kinds)
    except AssumptionError as error:
        why = error.diagnostics[0].message
        if roll == ALWAYS:
            raise AssumptionError(f"{function.name} cannot be rolled: {why}") from None
        return why if links >= FROM else ""
    if roll == AUTO and links < FEWEST * kinds:
        why = f"{links} links of {kinds} kinds, too few of each to gain"
        return why if links >= FROM else ""
    return None


def is_sure(function: Function, roll: str, links: int) -> bool:
    """Whether loops are better than what is written out, without a comparison."""
    if roll == ALWAYS:
        return True
    if function.recursion is None:
        return False
    of = function.recursion()
    least = FROM_FREE if of.has_several else FROM
    return links >= max(least, PER_KIND * len(of.kinds))


def rolled(function: Function, arguments: Sequence[Argument]) -> Loops:
    """The function as loops over links."""
    if function.recursion is None:
        raise AssumptionError(f"{function.name} is no recursion")
    of = function.recursion()
    entries: list[Entry] = []
    bodies = _Bodies(function.name, of, entries)
    angles = tuple(
        None if angle is None else bodies.angle(k, angle) for k, angle in enumerate(of.angles)
    )
    sweeps = [bodies.sweep(sweep) for sweep in of.sweeps]
    computed = _computed(of)
    values, once = _prologue(of, function, computed, arguments)
    known = dict(zip(map(str, computed), values.roots))

    def value(x: Scalar) -> Expression:
        """A number, or the local that holds it."""
        return x if isinstance(x, float) else known[str(x)]

    ways, out, slots = _ways(of.parents)
    result = Rolled(
        kinds=of.kinds_of,
        rows=of.rows_of,
        indices=of.indices,
        reads=tuple(Read(read.name, read.argument, read.index) for read in of.reads),
        of=ways,
        to=out,
        slots=slots,
        tables=tuple(
            Table(
                kind.about,
                kind.constants.numel(),
                tuple(tuple(map(value, row)) for row in kind.table),
            )
            for kind in of.kinds
        ),
        angles=angles,
        sweeps=tuple(
            Sweep(sweep.title, sweep.rising, tuple(map(value, sweep.start)), visits)
            for sweep, visits in zip(of.sweeps, sweeps)
        ),
        widths=bodies.widths,
        factors=tuple(map(value, of.formulas)),
    )
    kernel = _kernel(function, arguments, result, values)
    counts = _operations(result)
    return Loops(
        replace(kernel, operations={name: n + once[name] for name, n in counts.items()}),
        tuple(entries),
    )


class _Bodies:
    """Bodies of code over the same rows."""

    def __init__(self, function: str, of: Recursion, entries: list[Entry]) -> None:
        angles = {0, 1} if any(angle is not None for angle in of.angles) else set[int]()
        used = [
            angles.union(*(sweep.visits[kind].kept for sweep in of.sweeps))
            for kind in range(len(of.kinds))
        ]
        self.places = [{k: n for n, k in enumerate(sorted(of_kind))} for of_kind in used]
        self.widths = tuple(map(len, used))
        self._function, self._of, self._entries = function, of, entries

    def sweep(self, sweep: records.Sweep) -> tuple[Visit, ...]:
        """A visit for each kind."""
        return tuple(
            self._visit(k, sweep.title, sweep.received, visit)
            for k, visit in enumerate(sweep.visits)
        )

    def angle(self, number: int, angle: Scalar) -> Angle:
        """That of the links of one kind."""
        made = self._visit(number, "angles", ca.SX(0, 1), records.Visit({}, [angle]))
        return Angle(replace(made, handed=()), made.handed[0])

    def _visit(self, number: int, title: str, received: ca.SX, visit: records.Visit) -> Visit:
        """The body of one kind, after the passes."""
        kind, places = self._of.kinds[number], self.places[number]
        slots = [
            ("k", kind.constants), *((read.name, read.symbol) for read in self._of.reads),
            ("t", self._of.t), ("f", self._of.factors), ("r", self._of.row), ("e", received),
        ]  # fmt: skip
        kept, handed, results = list(visit.kept.items()), visit.handed, visit.results
        roots = [ca.SX(x) for x in (*(x for _, x in kept), *handed, *results.values())]
        where = f"{self._function}: {title.split(',')[0]}, {kind.about}"
        best, entries = improve(where, record(slots, roots), range(0))
        self._entries += entries
        inputs = {(name, i): self._name(name, i) for name, x in slots for i in range(x.numel())}
        done = schedule(best.lowered, (), title, inputs, Names([*Names().taken, *inputs.values()]))
        many, last = len(kept), len(kept) + len(handed)
        loads = tuple(
            load if load.argument != "r" else type(load)(load.name, "r", places[load.index])
            for load in done.loads
        )
        return Visit(
            loads=loads,
            sections=done.sections,
            kept=tuple((places[k], x) for (k, _), x in zip(kept, done.roots)),
            handed=done.roots[many:last],
            results=tuple(zip(results, done.roots[last:])),
            operations=count(used_operations(best.lowered)),
        )

    def _name(self, argument: str, i: int) -> str:
        return f"{argument}{i}" if argument in ("k", "f", "r", "e") else argument


def _computed(of: Recursion) -> list[ca.SX]:
    """What stands in tables and is no number, each once."""
    tables = (x for kind in of.kinds for row in kind.table for x in row)
    starts = (x for sweep in of.sweeps for x in sweep.start)
    symbolic = {str(x): x for x in (*tables, *of.formulas, *starts) if isinstance(x, ca.SX)}
    return list(symbolic.values())


def _prologue(
    of: Recursion, function: Function, computed: Sequence[ca.SX], arguments: Sequence[Argument]
) -> tuple[Scheduled, dict[str, int]]:
    """Straight-line code for what tables hold of parameters, and its operations."""
    if not computed:
        return Scheduled((), (), ()), dict.fromkeys((*KINDS, "total"), 0)
    p = next(argument for argument in arguments if argument.name == "p")
    best, _ = improve(function.name, record([("p", of.p)], computed), range(0))
    tables = [f"table{k}" for k in range(len(of.kinds))]
    free = Names([*RESERVED, *LOCALS, *tables, identifier(function.result.name)])
    names = {("p", i): free(name) for i, name in enumerate(p.names)}
    title = "constants of links, from parameters"
    done = schedule(best.lowered, best.marks, title, names, free)
    return done, count(used_operations(best.lowered))


def _ways(parents: Sequence[int]) -> tuple[tuple[int, ...], tuple[int, ...], int]:
    """From where each link receives, where it leaves what it hands on, and how many slots that
    takes; a slot is used again when its last child is done."""
    last: dict[int, int] = {}
    for i, parent in enumerate(parents):
        if parent != i - 1 and parent >= 0:
            last[parent] = i
    free: list[int] = []
    slot_of: dict[int, int] = {}
    of: list[int] = []
    to: list[int] = []
    slots = 0
    for i, parent in enumerate(parents):
        way = BASE if parent < 0 else PREVIOUS if parent == i - 1 else slot_of[parent]
        of.append(way)
        if way >= 0 and last[parent] == i:
            heapq.heappush(free, way)
        place = -1
        if i in last:
            place = heapq.heappop(free) if free else slots
            slots = max(slots, place + 1)
            slot_of[i] = place
        to.append(place)
    return tuple(of), tuple(to), slots


def _kernel(
    function: Function, arguments: Sequence[Argument], made: Rolled, values: Scheduled
) -> Kernel:
    used = {load.argument for visit in made.visits for load in visit.loads}
    read = {"x", *(x.argument for x in made.reads if x.name in used), *({"t"} & used)}
    read |= {load.argument for load in values.loads}
    uses = tuple(a.name for a in arguments if a.name in read)
    size = function.result.size
    return Kernel(
        name=function.name,
        about=function.about,
        result=function.result.name,
        shape=(size,),
        labels=function.result.labels,
        units=function.result.units,
        x=next(argument for argument in arguments if argument.name == "x"),
        uses=uses,
        loads=values.loads,
        sections=values.sections,
        outputs=(),
        guards=(),
        loop=None,
        watched=tuple(
            (a.name, i) for a in arguments if a.name in uses for i in range(len(a.names))
        ),
        results=_computed_results(made),
        operations={},
        rolled=made,
    )


def _computed_results(made: Rolled) -> tuple[int, ...]:
    """Entries of the result that are no copies of arguments."""
    copied = {read.name for read in made.reads}
    computed = {
        (name, kind)
        for sweep in made.sweeps
        for kind, visit in enumerate(sweep.visits)
        for name, value in visit.results
        if value not in copied
    }
    places = {
        made.indices[name][i]
        for i, k in enumerate(made.kinds)
        for name, kind in computed
        if kind == k
    }
    return tuple(sorted(places))


def _operations(made: Rolled) -> dict[str, int]:
    """Body × links, with sines and cosines."""
    counts: dict[str, int] = dict.fromkeys((*KINDS, "total"), 0)
    for k, angle in enumerate(made.angles):
        links = sum(kind == k for kind in made.kinds)
        bodies = [sweep.visits[k] for sweep in made.sweeps] + ([angle.of] if angle else [])
        for name in counts:
            counts[name] += links * sum(body.operations[name] for body in bodies)
        turns = links if angle else 0
        counts["sin"] += turns
        counts["cos"] += turns
        counts["total"] += 2 * turns
    return counts
