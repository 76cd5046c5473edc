"""The symbols of a system and what every name in a formula stands for."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import casadi as ca

from derive.expressions.evaluate import Functions, casadi_functions, casadi_tables, number, value
from derive.expressions.scalars import Scalar, Vector
from derive.expressions.tree import Expression, Name, walk
from derive.joints import joint_type
from derive.model.records import Model
from derive.model.rows import row_names


@dataclass(frozen=True)
class Symbols:
    """t, q, v, u, p as SX columns, z the first-order states at the end of p; `qd` stands for q̇
    while formulas are read and is replaced by N
    v afterwards, `vdot` for v̇ in outputs until a formulation knows it."""

    t: ca.SX
    q: ca.SX
    v: ca.SX
    u: ca.SX
    p: ca.SX
    z: ca.SX
    defaults: tuple[float, ...]  # of p
    qd: ca.SX
    vdot: ca.SX
    names: dict[str, Scalar]
    rates: dict[str, Scalar]
    functions: Functions  # of formulas

    def scalar(self, expression: Expression) -> Scalar:
        """The formula over these symbols; a float where only numbers and constant parameters
        occur."""
        result = value(expression, self.names, self.rates, self.functions)
        return float(result) if not isinstance(result, ca.SX) or result.is_constant() else result

    def reactions(self, rows: Iterable[str]) -> ca.SX:
        """The symbols that stand for the multipliers of rows."""
        result = [ca.SX(self.names[f"reaction.{row}"]) for row in rows]
        return ca.vertcat(*result) if result else ca.SX(0, 1)

    def vector(self, entries: tuple[Expression, ...]) -> Vector:
        """Components of a point or direction as scalars of the graph; numbers stay floats."""
        return [self.scalar(entry) for entry in entries]


def symbols(model: Model, constants: Collection[str]) -> Symbols:
    """The symbols t, q, q̇, v, u, p of a model, and a table from every name in a formula to what it
    stands for.

    Parameters in `constants` are numbers from here on and no entries of p. Definitions come last
    and in order: each may use those before it; those that use measures of the motion are entered
    by derive.mechanics.measures. Reactions are symbols of their own, replaced by
    their value when the multipliers are known.
    """
    t, u = ca.SX.sym("t"), _column([i.name for i in model.inputs])
    q, qd = (
        _column([c.name for c in model.coordinates]),
        _column([f"d_{c.name}" for c in model.coordinates]),
    )
    v = _column([x.name for x in model.velocities])
    vdot = _column([f"d_{x.name}" for x in model.velocities])
    free = [x for x in model.parameters if x.name not in constants]
    z = _column([x.name for x in model.states])
    p = ca.vertcat(_column([x.name for x in free]), z)
    names: dict[str, Scalar] = {x.name: float(x.value) for x in model.parameters}
    names |= {x.name: p[i] for i, x in enumerate(free)}
    names |= {x.name: q[i] for i, x in enumerate(model.coordinates)}
    names |= {x.name: v[i] for i, x in enumerate(model.velocities)}
    names |= {x.name: u[i] for i, x in enumerate(model.inputs)}
    names |= {x.name: z[i] for i, x in enumerate(model.states)}
    names["t"] = t
    names |= {f"reaction.{row}": ca.SX.sym(f"reaction_{row}") for row in row_names(model)}
    functions = {**casadi_functions(), **casadi_tables(model.tables)}
    rates: dict[str, Scalar] = {x.name: qd[i] for i, x in enumerate(model.coordinates)}
    values = {x.name: x.value for x in model.parameters}
    starts = [number(x.initial, values) for x in model.states]
    defaults = (*(x.value for x in free), *starts)
    result = Symbols(t, q, v, u, p, z, defaults, qd, vdot, names, rates, functions)
    define(model, result)
    return result


def define(model: Model, symbols: Symbols) -> None:
    """Enters the definitions that are not there yet and whose names are all known: those that use
    measures of the motion have to wait for the mechanics."""
    for name, expression in model.definitions:
        needed = (node.name for node in walk(expression) if isinstance(node, Name))
        if name not in symbols.names and all(x in symbols.names for x in needed):
            symbols.names[name] = symbols.scalar(expression)


def _column(names: list[str]) -> ca.SX:
    return ca.vertcat(*[ca.SX.sym(name) for name in names]) if names else ca.SX(0, 1)


def quaternions(model: Model) -> tuple[int, ...]:
    """Where in q a unit quaternion starts."""
    names = [c.name for c in model.coordinates]
    kinds = [(joint, joint_type(joint.type, joint.orientation)) for joint in model.joints]
    return tuple(
        names.index(joint.coordinates[kind.unit_from])
        for joint, kind in kinds
        if kind.unit_from >= 0
    )
