"""Exercises of a chapter. Every solution is computed, by the model's structure or its module."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from derive.mechanics.records import Row
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
    course: Course, names: Sequence[str], numbers: Values, per: str = ""
) -> tuple[tuple[str, str, str], ...]:
    units = course.record.units
    rows = zip(names, number_texts(numbers), (units.get(name, "") for name in names))
    return tuple((f"{per}{name}", text, unit if not per else "") for name, text, unit in rows)


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
        _values(course, _speeds(course), _rates(course, course.start.u, course.start.p), "d/dt "),
    )


def _energy(course: Course) -> Iterator[Exercise]:
    """Whether energy stays."""
    columns = course.record.motion
    T, V, work = (np.asarray(columns[name], dtype=float) for name in ("T", "V", "work"))
    change = float((T + V)[-1] - (T + V)[0])
    largest = float(np.max(np.abs(np.concatenate([T, V]))))
    small = abs(change) <= 1e-8 * max(largest, 1e-300)
    told = "stays the same, but for rounding" if small else f"changes by {_text(change)} J"
    by = f"; forces without potential did {_text(float(work[-1]))} J of work" if not small else ""
    yield Exercise(
        f"Which energies does the mechanism have at the start, and what becomes of T + V in "
        f"{course.span:g} s?",
        f"T = {_text(float(T[0]))} J and V = {_text(float(V[0]))} J. The sum {told}{by}.",
    )


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
        "start nevertheless, from M v̇ + h = Q + Aᵀλ.",
        "The function reactions of the module gives, row by row,",
        tuple((name, text, "") for name, text in zip(_names(rows, values), number_texts(values))),
    )


def _names(rows: Sequence[Row], values: Values) -> list[str]:
    """Of the multipliers; by number where rows that repeat others have none."""
    if len(rows) == len(values):
        return [f"λ of {row.name}" for row in rows]
    return [f"λ {k}" for k in range(1, len(values) + 1)]


def _input(course: Course) -> Iterator[Exercise]:
    """What the first input does."""
    inputs = course.problem.system.model.inputs
    if not inputs:
        return
    u, p = course.start.u, course.start.p
    pushed = u.copy()
    pushed[0] += PUSH
    change = _rates(course, pushed, p) - _rates(course, u, p)
    unit = f" {inputs[0].unit}" if inputs[0].unit else ""
    yield Exercise(
        f"Raise the input {inputs[0].name} by {PUSH:g}{unit} at the start. By how much do the "
        "rates of the quasi-velocities change?",
        "The equations are affine in the inputs; the difference of two values of dynamics is",
        _values(course, _speeds(course), change, "Δ d/dt "),
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
    yield Exercise(
        f"Double the mass {parameters[k].name}. What are the rates of the quasi-velocities at "
        "the same state?",
        "With the other parameter dynamics gives",
        _values(course, _speeds(course), _rates(course, course.start.u, p), "d/dt "),
    )


Kind = Callable[[Course], Iterator[Exercise]]
KINDS: tuple[Kind, ...] = (_freedoms, _acceleration, _energy, _reaction, _input, _heavier)
