"""taylor: from a function to recurrences for the Taylor coefficients of all that it computes.

Along a solution every value is a power series in time, v = Σ vₙ sⁿ. Each operation gives vₙ from
coefficients of its operands up to n and of lower order of its own (R. E. Moore: Interval Analysis,
1966; A. Griewank, A. Walther: Evaluating Derivatives, 2008, table 13.2). Every operation that is
not linear needs one sum Σ lⱼ rₙ₋ⱼ over 0 < j < n of two known series, its *slot*. All sums of one
order depend on lower orders alone, so they are made together, side by side; what is left of an
order are the terms j = 0 and j = n.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from codegen.passes.lanes import is_plain, side_by_side
from codegen.passes.recurrences import Recurrences
from codegen.passes.series import NoSeries, Series, Step, Term
from codegen.program import Expression, Program, Statement
from derive.diagnostics import AssumptionError

MOST_SLOTS = 1_200  # what a step keeps of them stands on the stack: at most half a megabyte
SERIES = "taylor"  # the integrator
FASTER = ((20, 1e-5), (40, 1e-11))  # products up to which series are faster, and from which rtol
HIGHEST = 24  # order: what a tolerance near rounding asks for
SMOOTH = frozenset({"add", "sub", "mul", "div", "neg", "sqrt", "sin", "cos"})  # in vectors of lanes


def suffixes(program: Program) -> tuple[str, ...]:
    """Of the functions of each chart of the program."""
    return tuple(chart.suffix for chart in program.charts) or ("",)


def series(program: Program, suffix: str = "") -> Series:
    """Recurrences of `dynamics`, and of `power` where there is one. Raises NoSeries.

    The state follows from its own derivative: (n + 1) xₙ₊₁ = ẋₙ. Where constants are precomputed,
    the series are those of the rest, for parameters do not vary along a motion.
    """
    dynamics = program.in_chart("dynamics", suffix)
    assert dynamics is not None  # it is what is simulated
    if dynamics.rolled:
        raise NoSeries("loops over links, which have no recurrences; --roll never writes them out")
    hoisted = dynamics.hoisted
    alone = not program.charts and not program.frame
    tape = Recurrences()
    rates = tape.read(hoisted.rest if hoisted and alone else dynamics)
    power = program.in_chart("power", suffix)
    if power:
        rates += tape.read(power)
    if len(tape.slots) > MOST_SLOTS:
        raise NoSeries(f"{len(tape.slots)} products, more than the {MOST_SLOTS} that it can hold")
    return _series(tape, rates)


def in_pieces(program: Program) -> bool:
    """Is any of the series not analytic everywhere?"""
    return any(series(program, suffix).in_pieces for suffix in suffixes(program))


def series_in_lanes(program: Program) -> bool:
    """Do several motions go along their series side by side? Where they can by other methods, and
    all is smooth: a comparison says something else in each lane."""
    if not side_by_side(program) or program.has("kinks"):
        return False
    made = [series(program, suffix) for suffix in suffixes(program)]
    values = [s.value for of in made for s in (*of.start, *of.guards)]
    smooth = all(is_plain(value, SMOOTH) for value in values)
    return smooth and not any(of.in_pieces for of in made)


def series_refusal(program: Program) -> str:
    """Why there are no recurrences for the program; nothing where there are."""
    try:
        for suffix in suffixes(program):
            series(program, suffix)
    except NoSeries as reason:
        return f"its equations have {reason}"
    return ""


def check_series(program: Program) -> None:
    """Refuse a program without recurrences. Raises AssumptionError."""
    reason = series_refusal(program)
    if reason:
        raise AssumptionError(
            f"{SERIES} does not fit {program.name}: {reason}",
            "the other explicit integrators fit every model; verner9 is for tight tolerances",
        )


def faster_from(program: Program) -> float:
    """rtol from which one motion takes less time along its series than by Runge-Kutta methods; 0
    where it never does (measured: chains of 2 and 5 pendulums, four_bar, snake3)."""
    if series_refusal(program):
        return 0.0
    candidates = [series(program, suffix) for suffix in suffixes(program)]
    if any(each.in_pieces for each in candidates):
        return 0.0
    products = max(len(each.slots) for each in candidates)
    return next((rtol for most, rtol in FASTER if products <= most), 0.0)


def _series(tape: Recurrences, rates: Sequence[Expression]) -> Series:
    """What the tape read as a record, sums of sums flattened; `rates` are ẋ, then the power."""
    states, inputs = (
        tuple((load.name, load.index) for load in tape.loads.values() if load.argument == name)
        for name in ("x", "u")
    )
    time = next((load.name for load in tape.loads.values() if load.argument == "t"), "")
    _leave_out_dead(tape, rates)
    steps = _Flattening(tape, rates).steps()
    return Series(
        loads=tuple(tape.loads.values()),
        start=_asked_for(tape, rates, steps),
        guards=tuple(tape.guards),
        steps=steps,
        slots=tuple(tape.slots),
        states=states,
        inputs=inputs,
        time=time,
        coefficients=tape.coefficients,
        rates=tuple((rate, tape.coefficient(rate)) for rate in rates),
        in_pieces=tape.in_pieces,
    )


def _leave_out_dead(tape: Recurrences, rates: Sequence[Expression]) -> None:
    """Steps and slots that no rate depends on go."""
    steps, slots = {step.name: step for step in tape.steps}, list(tape.slots)
    alive: set[str] = set()
    todo = [tape.coefficient(rate) for rate in rates]
    while todo:
        name = todo.pop()
        if not isinstance(name, str) or name in alive:
            continue
        alive.add(name)
        for term in steps[name].terms if name in steps else ():
            of = slots[term.of] if isinstance(term.of, int) else term.of
            sides = [of] if isinstance(of, str) else [*map(tape.coefficient, (of.left, of.right))]
            todo += sides
    kept = [step for step in tape.steps if step.name in alive]
    used = sorted({term.of for step in kept for term in step.terms if isinstance(term.of, int)})
    places: dict[str | int, int] = {old: new for new, old in enumerate(used)}
    tape.slots = {slots[old]: new for new, old in enumerate(used)}
    tape.steps = [
        replace(step, terms=tuple(replace(t, of=places.get(t.of, t.of)) for t in step.terms))
        for step in kept
    ]


def _asked_for(
    tape: Recurrences, rates: Sequence[Expression], steps: Sequence[Step]
) -> tuple[Statement, ...]:
    """Values at the start that something takes; a sine stays beside its cosine."""
    values: list[Expression] = [*rates, *(guard.value for guard in tape.guards)]
    values += [term.factor for step in steps for term in step.terms]
    values += [step.condition for step in steps if step.condition is not None]
    values += [side for slot in tape.slots for side in (slot.left, slot.right)]
    wanted = {name for value in values for name in names_in(value)}
    start: list[Statement] = []
    for statement in reversed(tape.start):
        turn = isinstance(statement.value, tuple) and statement.value[0] in ("sin", "cos")
        if turn or statement.name in wanted:
            start.append(statement)
            wanted |= names_in(statement.value)
    return tuple(reversed(start))


def names_in(value: Expression) -> set[str]:
    """The locals of an expression."""
    if isinstance(value, tuple):
        return {name for operand in value[1:] for name in names_in(operand)}
    return {value} if isinstance(value, str) else set()


class _Flattening:
    """Sums of sums become one where nothing is computed twice by that: each addition and
    multiplication on the way from one order to the next takes its time, and they are one after the
    other."""

    def __init__(self, tape: Recurrences, rates: Sequence[Expression]) -> None:
        self.tape = tape
        self.flat: dict[str, Step] = {}
        self.shown = {str(tape.coefficient(rate)) for rate in rates}
        for slot in tape.slots:
            self.shown |= {str(tape.coefficient(slot.left)), str(tape.coefficient(slot.right))}
        self.users = Counter(term.of for step in tape.steps for term in step.terms)

    def steps(self) -> tuple[Step, ...]:
        """The steps in order, each with what its terms consist of in place of them; those that no
        slot, no rate and no other step asks for are left out."""
        for step in self.tape.steps:
            terms = [inner for term in step.terms for inner in self._terms(term)]
            self.flat[step.name] = Step(step.name, tuple(self._merged(terms)), step.condition)
        wanted = set(self.shown)
        steps: list[Step] = []
        for step in reversed(self.flat.values()):
            if step.name in wanted:
                steps.append(step)
                wanted |= {term.of for term in step.terms if isinstance(term.of, str)}
        return tuple(reversed(steps))

    def _terms(self, term: Term) -> list[Term]:
        """A term, or what it consists of."""
        inner = self.flat.get(term.of) if isinstance(term.of, str) else None
        if inner is None or inner.condition is not None:
            return [term]
        scaled = len(inner.terms) == 1 and isinstance(inner.terms[0].of, str)
        alone = self.users[inner.name] == 1 and inner.name not in self.shown
        if not (scaled or alone):
            return [term]
        return [part.times(term, self._product(part.factor, term.factor)) for part in inner.terms]

    def _product(self, a: Expression, b: Expression) -> Expression:
        if a == 1.0 or b == 1.0:
            return b if a == 1.0 else a
        if isinstance(a, float) and isinstance(b, float):
            return a * b
        return self.tape.held("mul", a, b)

    def _merged(self, terms: Sequence[Term]) -> list[Term]:
        """One term of each coefficient."""
        sums: dict[str | int, Term] = {}
        for term in terms:
            before = sums.get(term.of)
            if before is None:
                sums[term.of] = term
            else:
                operation = "add" if before.sign == term.sign else "sub"
                factor = self.tape.held(operation, before.factor, term.factor)
                sums[term.of] = Term(term.of, factor, before.sign)
        return list(sums.values())
