"""Formulas of joints that are alike: one formula for many joints, with constants and inputs in
tables.

Two formulas are alike where they differ in numbers, in parameters and in which input stands in
them. What has neither coordinate nor velocity, input nor time in it counts as one constant.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from derive.diagnostics import AssumptionError
from derive.expressions.instructions import Instruction, listing, run
from derive.expressions.scalars import Scalar, Vector
from derive.mechanics.limits import MOST_TERMS

Key = tuple[Any, ...]
CONSTANT: Key = ("constant",)
FOREIGN: Key = ("several joints",)
LONG: Key = ("too long",)
Q, V, INPUT, TIME = range(4)  # what a leaf is, besides


@dataclass(frozen=True)
class Formula:
    """`key` is the same for formulas that are alike; `constants` and `inputs` (entries of u) stand
    in it from left to right. `joints` are the coordinates and the velocities it takes: in the key
    they are counted joint by joint. Keys have no shared parts, so that what takes several joints,
    or more than MOST_TERMS, has none: written out it may be of any length."""

    key: Key
    constants: tuple[Scalar, ...] = ()
    inputs: tuple[int, ...] = ()
    joints: frozenset[tuple[int, int]] = frozenset()
    terms: int = 1


@dataclass(frozen=True)
class Shared:
    """Several formulas with parts in common, over numbers of one link: `key` names operation by
    operation what it is made of, a constant, an argument or an operation before, and the results.
    Alike have one key; constants stand in it in order."""

    key: Key
    constants: tuple[Scalar, ...]
    inputs: tuple[int, ...]


@dataclass(frozen=True)
class Slots:
    """The arguments of formulas, the number of every coordinate and velocity in its joint, and the
    link that it moves."""

    t: ca.SX
    q: ca.SX
    v: ca.SX
    u: ca.SX
    p: ca.SX
    coordinates: Mapping[int, int]
    velocities: Mapping[int, int]
    links: Mapping[tuple[int, int], int]


def formulas(values: ca.SX, slots: Slots) -> list[Formula]:
    """The formula of each entry of a column."""
    given = [slots.q, slots.v, slots.u, slots.t, slots.p]
    function = ca.Function("forces", given, [ca.densify(values)])
    numbers = (slots.coordinates, slots.velocities)

    def entry(argument: int, nonzero: int) -> Formula:
        """A leaf."""
        if argument == 4:
            return Formula(CONSTANT, (slots.p[nonzero],))
        if argument == INPUT:
            return Formula((INPUT,), inputs=(nonzero,))
        if argument == TIME:
            return Formula((TIME,))
        return Formula(
            (argument, numbers[argument][nonzero]), joints=frozenset([(argument, nonzero)])
        )

    def operation(read: Instruction, operands: list[Formula]) -> Formula:
        joints = frozenset[tuple[int, int]]().union(*(operand.joints for operand in operands))
        by_link = {slots.links[entry]: entry for entry in joints}
        if len(by_link) > 1:
            return Formula(FOREIGN, joints=frozenset(sorted(by_link.values())[:2]))
        return _operation(read, operands, joints)

    return run(listing(function), entry, lambda x: Formula(CONSTANT, (x,)), operation)[0]


def _operation(
    read: Instruction, operands: list[Formula], joints: frozenset[tuple[int, int]]
) -> Formula:
    terms = sum(operand.terms for operand in operands)
    if terms > MOST_TERMS:
        return Formula(LONG, joints=joints, terms=terms)
    constants = tuple(x for operand in operands for x in operand.constants)
    if all(operand.key == CONSTANT for operand in operands):
        return Formula(CONSTANT, (_applied(read.code, constants),))
    return Formula(
        (read.code, *(operand.key for operand in operands)),
        constants,
        tuple(x for operand in operands for x in operand.inputs),
        joints,
        terms,
    )


def _applied(code: int, operands: Sequence[Scalar]) -> Scalar:
    """A float where all operands are floats."""
    results = (
        ca.SX.unary(code, operands[0])
        if len(operands) == 1
        else ca.SX.binary(code, operands[0], operands[1])
    )
    return float(results) if all(isinstance(x, float) for x in operands) else ca.SX(results)


def check_own(
    formula: Formula, coordinates: Collection[int], velocities: Collection[int], joint: str
) -> None:
    """A joint's force may depend on that joint alone, in a formula that can be written out. Raises
    AssumptionError."""
    own = {*((Q, k) for k in coordinates), *((V, k) for k in velocities)}
    if not formula.joints <= own:
        raise AssumptionError(f"a force at {joint} depends on other joints, too")
    if formula.key == LONG:
        raise AssumptionError(f"a force at {joint} is a formula of more than {MOST_TERMS} terms")


def written(
    key: Key, q: Sequence[ca.SX], v: Sequence[ca.SX], t: ca.SX, constants: Vector, inputs: Vector
) -> Scalar:
    """The formula over these symbols: coordinates and velocities of one joint."""
    return _written(key, (q, v), t, iter(constants), iter(inputs))


def _written(
    key: Key,
    of: tuple[Sequence[ca.SX], Sequence[ca.SX]],
    t: ca.SX,
    constants: Iterator[Scalar],
    inputs: Iterator[Scalar],
) -> Scalar:
    if key == CONSTANT:
        return next(constants)
    if len(key) == 1:
        return next(inputs) if key[0] == INPUT else t
    if isinstance(key[1], int):
        symbols = of[Q] if key[0] == Q else of[V]
        return symbols[key[1]]
    operands = [_written(inner, of, t, constants, inputs) for inner in key[1:]]
    return _applied(key[0], operands)


# ---- formulas with shared parts

_Node = tuple[str, Any]  # "number" with its value, or "own", "input", "time", "made" with its place


def shared(values: ca.SX, own: ca.SX, slots: Slots) -> Shared:
    """Formulas of the numbers `own` of one link, and of t, u and p."""
    function = ca.Function("pushed", [own, slots.u, slots.t, slots.p], [ca.densify(values)])
    steps: list[tuple[Any, ...]] = []
    constants: list[Scalar] = []
    inputs: list[int] = []

    def entry(argument: int, nonzero: int) -> _Node:
        if argument == 3:
            return "number", slots.p[nonzero]
        return ("own", "input", "time")[argument], nonzero

    def named(node: _Node) -> tuple[Any, ...]:
        """As it stands in the key; constants and inputs go by their order."""
        if node[0] == "number":
            constants.append(node[1])
            return ("number",)
        if node[0] == "input":
            inputs.append(node[1])
            return ("input",)
        return node

    def operation(read: Instruction, operands: list[_Node]) -> _Node:
        if all(kind == "number" for kind, _ in operands):
            return "number", _applied(read.code, [x for _, x in operands])
        steps.append((read.code, *map(named, operands)))
        return "made", len(steps) - 1

    results = run(listing(function), entry, lambda x: ("number", x), operation)[0]
    key = (tuple(steps), tuple(map(named, results)))
    return Shared(key, tuple(constants), tuple(inputs))


def written_shared(
    key: Key, own: Sequence[ca.SX], t: ca.SX, constants: Vector, inputs: Vector
) -> Vector:
    """The formulas over these symbols."""
    made: Vector = []
    left, taken = iter(constants), iter(inputs)

    def value(node: tuple[Any, ...]) -> Scalar:
        match node[0]:
            case "number":
                return next(left)
            case "input":
                return next(taken)
            case "own":
                return own[int(node[1])]
            case "time":
                return t
            case _:
                return made[int(node[1])]

    steps, results = key
    for code, *operands in steps:
        made.append(_applied(code, [value(x) for x in operands]))
    return [value(x) for x in results]
