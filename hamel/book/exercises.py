"""Exercises of a chapter. Every solution is computed, by the model's structure or its module."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from derive.formulations.frames import based
from derive.mechanics.records import Row, System
from derive.model.records import Input
from derive.textbook.formulas.notation import symbols_of
from derive.textbook.names import dotted, per_second, symbol, unit
from derive.textbook.writing.mathml import mathml
from hamel.book.course import Course
from hamel.book.limits import DIGITS, NOTHING

Values = Sequence[float] | np.ndarray

PUSH = 1.0  # of the first input, in its unit


@dataclass(frozen=True)
class Exercise:
    """A question, and its answer in words and numbers: (name, value, unit)."""

    question: str
    answer: str
    values: tuple[tuple[str, str, str], ...] = ()


def exercises(course: Course) -> tuple[Exercise, ...]:
    """All that apply; one whose function has no value at the start is left out."""
    found: list[Exercise] = []
    for kind in KINDS:
        with contextlib.suppress(FloatingPointError):
            found += kind(course)
    return tuple(found)


def start_values(course: Course) -> tuple[tuple[str, str, str], ...]:
    """The state at which exercises begin: (name, value, unit)."""
    return _values(course, _states(course), course.x)


def _states(course: Course) -> Sequence[str]:
    return tuple(course.module.states)


def _values(
    course: Course, names: Sequence[str], numbers: Values, rates: bool = False
) -> tuple[tuple[str, str, str], ...]:
    """Symbol, number and unit of each; of the rate of each where these are `rates`."""
    units = [course.record.units.get(name, "") for name in names]
    if rates:
        units = [per_second(unit) for unit in units]
    symbols = [_symbol(course, name, rates) for name in names]
    return tuple(zip(symbols, number_texts(numbers), map(_unit, units)))


def _symbol(course: Course, name: str, rate: bool = False) -> Markup:
    """As the formulas have it; quasi-velocities of further charts are spelled."""
    latex = symbols_of(based(course.equations)).get(name) or symbol(name)
    return Markup(mathml(dotted(latex) if rate else latex))


def _unit(text: str) -> str:
    return unit(text) if text not in ("", "1") else ""


def number_texts(numbers: Values) -> list[str]:
    """With a few digits; zero where only rounding is left."""
    largest = float(np.max(np.abs(np.asarray(numbers, dtype=float)), initial=0.0))
    shown = [0.0 if abs(x) <= NOTHING * largest else float(x) for x in numbers]
    return [f"{x:.{DIGITS}g}".replace("-", "−") for x in shown]


def _freedoms(course: Course) -> Iterator[Exercise]:
    """How many quasi-velocities are left."""
    system = course.problem.system
    nv, nw = system.v.numel(), len(_speeds(course))
    question = (
        "Count coordinates, generalized velocities and independent constraints. How many degrees "
        "of freedom are left?"
    )
    answer = (
        f"{system.q.numel()} coordinates, {nv} generalized velocities, {nv - nw} independent "
        f"constraints on them: {nv} − {nv - nw} = {nw}."
    )
    yield Exercise(question, answer)


def _speeds(course: Course) -> Sequence[str]:
    """Names of the quasi-velocities, which stand behind the coordinates in x."""
    count = course.problem.system.q.numel()
    return _states(course)[count : len(_states(course)) - len(course.equations.z)]


def _rates(course: Course, u: np.ndarray, p: np.ndarray) -> np.ndarray:
    """ẇ at the start."""
    count = course.problem.system.q.numel()
    rates = course.value("dynamics", u, p)
    return rates[count : count + len(_speeds(course))]


def _acceleration(course: Course) -> Iterator[Exercise]:
    """The boxed equations, once."""
    yield Exercise(
        "Put the state of the table into the boxed equations, with all inputs at their values "
        "there. What are the rates of the quasi-velocities?",
        "The function dynamics of the module gives",
        _values(course, _speeds(course), _rates(course, course.start.u, course.start.p), True),
    )


def _energy(course: Course) -> Iterator[Exercise]:
    """Whether energy stays."""
    columns = course.record.measures
    T, V, work = (np.asarray(columns[name], dtype=float) for name in ("T", "V", "work"))
    change = float((T + V)[-1] - (T + V)[0])
    largest = float(np.max(np.abs(np.concatenate([T, V]))))
    small = abs(change) <= 1e-8 * max(largest, 1e-300)
    told = "stays the same, but for rounding" if small else f"changes by {_text(change)} J"
    by = "" if small else working(course.problem.system, float(work[-1]))
    yield Exercise(
        Markup(
            "Which energies does the mechanism have at the start, and what becomes of {} in {:g} s?"
        ).format(_math("T+V"), course.span),
        Markup("{} = {} J and {} = {} J. The sum {}{}.").format(
            _math("T"), _text(float(T[0])), _math("V"), _text(float(V[0])), told, by
        ),
    )


def working(system: System, work: float) -> str:
    """Who did how much work; nothing where T + V is not what work changes."""
    if not system.homogeneous:
        return ""
    who = [] if system.power.is_zero() else ["forces without potential"]
    who += [] if system.c.is_zero() else ["constraints that move"]
    return f"; {' and '.join(who)} did {_text(work)} J of work" if who else ""


def _math(latex: str) -> Markup:
    return Markup(mathml(latex))


def _text(x: float) -> str:
    return number_texts([x])[0]


def _reaction(course: Course) -> Iterator[Exercise]:
    """Multipliers, which the equations do without."""
    rows = course.problem.system.rows
    if not rows or not hasattr(course.module, "reactions"):
        return
    values = course.value("reactions", course.start.u, course.start.p)
    yield Exercise(
        "The equations have no multipliers. Find the forces that hold the constraints at the "
        "start nevertheless, from the equations with multipliers.",
        "The function reactions of the module gives, row by row",
        tuple((name, text, "") for name, text in zip(_names(rows, values), number_texts(values))),
    )


def _names(rows: Sequence[Row], values: Values) -> list[str]:
    """Of the multipliers; by number where rows that repeat others have none."""
    if len(rows) == len(values):
        return [f"λ of {row.name}" for row in rows]
    return [f"λ {k}" for k in range(1, len(values) + 1)]


def _input(course: Course) -> Iterator[Exercise]:
    """What the first input does that acts at once: none that first-order states hand on."""
    u, p = course.start.u, course.start.p
    now = _rates(course, u, p)
    for k, given in enumerate(course.problem.system.model.inputs):
        pushed = u.copy()
        pushed[k] += PUSH
        change = _rates(course, pushed, p) - now
        if np.any(change):
            yield _pushed(course, given, change)
            return


def _pushed(course: Course, given: Input, change: Values) -> Exercise:
    question = Markup(
        "Raise the input {} by {:g} {} at the start. By how much do the rates of the "
        "quasi-velocities change?"
    )
    return Exercise(
        question.format(_symbol(course, given.name), PUSH, _unit(given.unit)),
        "The equations are affine in the inputs; the difference of two values of dynamics is",
        _values(course, _speeds(course), change, True),
    )


def _heavier(course: Course) -> Iterator[Exercise]:
    """What the first mass does."""
    parameters = course.problem.system.model.parameters
    masses = [k for k, parameter in enumerate(parameters) if parameter.unit == "kg"]
    if not masses:
        return
    k = masses[0]
    p = course.start.p.copy()
    p[k] *= 2
    question = Markup(
        "Double the mass {}. What are the rates of the quasi-velocities at the same state?"
    )
    yield Exercise(
        question.format(_symbol(course, parameters[k].name)),
        "With the other parameter dynamics gives",
        _values(course, _speeds(course), _rates(course, course.start.u, p), True),
    )


Kind = Callable[[Course], Iterator[Exercise]]
KINDS: tuple[Kind, ...] = (_freedoms, _acceleration, _energy, _reaction, _input, _heavier)
