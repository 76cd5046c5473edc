"""Bodies that lose mass, a second time: rates of mass and inertia by SymPy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import sympy

from derive.expressions import tree
from derive.model.records import Body, Model
from hamel.verify.reference.formulas import evaluated, lookup, symbolic
from hamel.verify.reference.states import State
from hamel.verify.reference.tables import numeric
from hamel.verify.reference.tables import symbolic as symbolic_tables


def lost(model: Model, name: str, state: State) -> Body:
    """The rates of a body's mass and inertia, as if they were a body: SymPy differentiates them by
    t."""
    body = next(body for body in model.bodies if body.name == name)
    return replace(
        body,
        mass=time_derivative(model, body.mass, state),
        inertia=tuple(time_derivative(model, moment, state) for moment in body.inertia),  # type: ignore[arg-type]
    )


def time_derivative(model: Model, formula: tree.Expression, state: State) -> tree.Expression:
    """∂/∂t of a formula of parameters, t, tables and definitions of these."""
    functions = {**symbolic(), **symbolic_tables(model.tables)}
    t = sympy.Symbol("t")
    names: dict[str, Any] = {**state.names, "t": t}
    definitions = dict(model.definitions)
    for name in _needed(formula, definitions):
        names[name] = evaluated(definitions[name], lookup(names, {}), functions)
    read: Any = sympy.sympify(evaluated(formula, lookup(names, {}), functions))
    slope: Any = sympy.lambdify([t], read.diff(t), [numeric(model.tables), "numpy"])
    return tree.Number(float(slope(state.names["t"])))


def _needed(formula: tree.Expression, definitions: Mapping[str, tree.Expression]) -> list[str]:
    """Definitions that a formula uses, those first that others use."""
    result: list[str] = []
    for node in tree.walk(formula):
        if isinstance(node, tree.Name) and node.name in definitions:
            result += [*_needed(definitions[node.name], definitions), node.name]
    return result
