"""Outputs by the reference: formulas, points, velocities and angles of bodies, and multipliers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from derive.expressions import tree
from derive.model.records import Model, Output
from derive.model.rows import row_names
from hamel.verify.reference.balance import twist_rates
from hamel.verify.reference.measures import accelerations
from hamel.verify.reference.states import Frame, State
from hamel.verify.reference.vectors import Array

AXES = {"x": 0, "y": 1, "z": 2}


def outputs(model: Model, state: State, lam: Array, vdot: Array) -> Array:
    """All outputs in order, vectors as two (planar) or three components; `lam` are the multipliers
    of all rows, `vdot` the v̇ of the motion."""
    moving = _moving(model, state, lam, vdot)
    return np.concatenate(
        [np.zeros(0), *(_output(model, moving, output, lam) for output in model.outputs)]
    )


def _moving(model: Model, state: State, lam: Array, vdot: Array) -> State:
    """The state with reactions among its names, and accelerations where outputs use any."""
    names = {f"reaction.{row}": float(x) for row, x in zip(row_names(model), lam)}
    if model.accelerations:
        names |= accelerations(model, state, vdot, twist_rates(state, vdot))
    return replace(state, names=state.names | names)


def events(model: Model, state: State, lam: Array, vdot: Array) -> Array:
    """The formulas of all events, with outputs by name and points by component."""
    state = _moving(model, state, lam, vdot)
    names: dict[str, float] = {}
    for output in model.outputs:
        values = _output(model, state, output, lam)
        formula = output.expression
        function = formula.function if isinstance(formula, tree.Call) else ""
        if function in ("position", "velocity") or isinstance(formula, tree.Vector):
            letters = model.plane or "xyz"
            names |= {f"{output.name}.{x}": float(v) for x, v in zip(letters, values)}
        elif function != "reaction":
            names[output.name] = float(values[0])
    return np.array([state.value(event.expression, names) for event in model.events])


def nearest_turn(model: Model, wanted: Array, got: Array) -> Array:
    """`wanted` with whole turns added to the angles of bodies so that they are nearest to `got`."""
    turns = np.round((np.ravel(got) - wanted) / (2.0 * np.pi))
    return wanted + 2.0 * np.pi * np.where(_angles(model), turns, 0.0)


def _angles(model: Model) -> Array:
    """Which entries of the outputs are angles of bodies."""
    marks = []
    for output in model.outputs:
        function = output.expression.function if isinstance(output.expression, tree.Call) else ""
        marks += [function == "angle"] * _size(model, output, function)
    return np.array(marks, dtype=bool)


def _size(model: Model, output: Output, function: str) -> int:
    if function == "reaction":
        return len(_rows(model, output))
    if isinstance(output.expression, tree.Vector):
        return len(output.expression.entries)
    return len(model.plane or "xyz") if function in ("position", "velocity") else 1


def _rows(model: Model, output: Output) -> list[int]:
    """Where the rows stand that a reaction is of."""
    subject = tree.children(output.expression)[0]
    owner = subject.name if isinstance(subject, tree.Name) else ""
    return [i for i, row in enumerate(row_names(model)) if row.partition(".")[0] == owner]


def _output(model: Model, state: State, output: Output, lam: Array) -> Array:
    formula = output.expression
    if isinstance(formula, tree.Call) and formula.function == "reaction":
        return lam[_rows(model, output)]
    if isinstance(formula, tree.Vector):
        return state.vector(formula.entries)
    if not (
        isinstance(formula, tree.Call) and formula.function in ("position", "velocity", "angle")
    ):
        return np.array([state.value(formula)])
    body = formula.arguments[0]
    frame = state.frames[body.name] if isinstance(body, tree.Name) else Frame(*np.zeros((4, 3)))
    axes = [AXES[letter] for letter in model.plane or "xyz"]
    if formula.function == "angle":
        return np.array([_angle(state, frame, axes)])
    arm = frame.point(_point(state, formula, axes))
    return (frame.origin + arm if formula.function == "position" else frame.speed(arm))[axes]


def _point(state: State, formula: tree.Call, axes: list[int]) -> Array:
    """The body point of a call in body coordinates, in space; the body's origin when none is
    given."""
    point = np.zeros(3)
    if len(formula.arguments) > 1 and isinstance(formula.arguments[1], tree.Vector):
        entries = formula.arguments[1].entries
        point[axes if len(entries) == len(axes) else [0, 1, 2]] = state.vector(entries)
    return point


def _angle(state: State, frame: Frame, axes: list[int]) -> float:
    """From the plane's first axis towards its second, in (−π, π]."""
    first = frame.rotation[:, axes[0]]
    return float(np.arctan2(first[axes[1]], first[axes[0]]))
