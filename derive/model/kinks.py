"""Where the formulas of a model are in pieces: calls that jump or have a kink, and tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from itertools import combinations
from typing import Any

from derive.diagnostics import ModelError
from derive.expressions import tree
from derive.expressions.mistakes import FormulaError
from derive.expressions.piece_order import check_pieces, value_of
from derive.model.load_records import Contact, JointFriction
from derive.model.records import Model, Span

SHARP = {"step": 1, "ramp": 1, "clip": 3, "piecewise": 32}  # arguments without a width
SWITCHING = SHARP | {"sign": 1, "abs": 1, "min": 16, "max": 16}
JUMPING = frozenset({"sign", "step", "piecewise"})
MOVING = ("definitions", "constraints", "loads", "states", "kinetic", "potential")


@dataclass(frozen=True)
class Piece:
    """A call in a formula of the entry `owner`, "" in an energy."""

    call: tree.Call
    owner: str
    span: Span | None


def pieces(model: Model) -> tuple[Piece, ...]:
    """Sharp calls and tables in everything that the motion depends on, in the order of the file."""
    tables = {table.name for table in model.tables}
    return tuple(
        Piece(call, owner, span)
        for call, owner, span in _calls(model)
        if call.function in tables or _counts(call, SHARP)
    )


def jumps(model: Model) -> tuple[Piece, ...]:
    """The calls of `pieces`, and signs, whose value may jump."""
    return tuple(
        Piece(call, owner, span)
        for call, owner, span in _calls(model)
        if call.function in JUMPING and _counts(call, SWITCHING)
    )


def switches(model: Model) -> tuple[tree.Expression, ...]:
    """What changes its sign where a formula goes on to another piece."""
    knots = {table.name: tuple(map(tree.Number, table.x)) for table in model.tables}
    return tuple(
        tree.Sum((one, tree.Negative(other)))
        for call, _, _ in _calls(model)
        if call.function in knots or _counts(call, SWITCHING)
        for one, other in _compared(call, knots.get(call.function, ()))
    )


def are_constraints_in_pieces(model: Model) -> bool:
    """Whether a constraint, or a motion that one prescribes, uses a table or another formula in
    pieces."""
    tables = {table.name for table in model.tables}
    return any(
        call.function in tables or _counts(call, SWITCHING)
        for call, _, _ in _calls(model, ("constraints", "definitions"))
    )


def check_order(model: Model, values: Mapping[str, float]) -> None:
    """Raises ModelError where bounds, places or widths are not in order at these values of the
    parameters, nor what makes friction smooth."""
    known = _with_definitions(model, values)
    for load in model.loads:
        width = (
            value_of(load.smoothing, known) if isinstance(load, JointFriction | Contact) else None
        )
        if width is not None and width <= 0.0:
            message = f"the smoothing of '{load.name}' is {width:g}"
            raise ModelError(model.diagnostic(load.span, message, "more than zero"))
    for call, _, span in _calls(model, (*MOVING, "outputs")):
        try:
            check_pieces(call, known)
        except FormulaError as error:
            message, expected, _ = error.detail
            raise ModelError(model.diagnostic(span, message, expected)) from error


def _with_definitions(model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """The values, and those of the definitions that they decide."""
    known = dict(values)
    for name, formula in model.definitions:
        value = value_of(formula, known)
        known |= {} if value is None else {name: value}
    return known


def _compared(
    call: tree.Call, knots: Sequence[tree.Expression]
) -> Iterable[tuple[tree.Expression, tree.Expression]]:
    """What is compared with what: of min and max each with each, else the first argument with
    places."""
    if call.function in ("min", "max"):
        return combinations(call.arguments, 2)
    places = knots or _places(call)
    return ((call.arguments[0], place) for place in places)


def _places(call: tree.Call) -> Sequence[tree.Expression]:
    if call.function == "piecewise":
        return call.arguments[2::2]
    return call.arguments[1:3] if call.function == "clip" else (tree.ZERO,)


def _counts(call: tree.Call, most: dict[str, int]) -> bool:
    return len(call.arguments) <= most.get(call.function, 0)


def _calls(
    model: Model, parts: tuple[str, ...] = MOVING
) -> Iterator[tuple[tree.Call, str, Span | None]]:
    for part in parts:
        given: Any = getattr(model, part)
        for item in _entries(given):
            owner, span = getattr(item, "name", ""), getattr(item, "span", None)
            for formula in _formulas(item):
                calls = (node for node in tree.walk(formula) if isinstance(node, tree.Call))
                yield from ((call, owner, span) for call in calls)


def _formulas(item: Any) -> Iterator[tree.Expression]:
    """The formulas of a record, however deep they stand in it."""
    if isinstance(item, tree.Expression):
        yield item
        return
    names = [field.name for field in fields(item)] if is_dataclass(item) else []
    for entry in [getattr(item, name) for name in names] or _entries(item, ()):
        yield from _formulas(entry)


def _entries(item: Any, otherwise: tuple[Any, ...] | None = None) -> tuple[Any, ...]:
    """Of a tuple; else the thing alone, or `otherwise`."""
    if isinstance(item, tuple):
        return tuple[Any, ...](item)  # pyright: ignore[reportUnknownArgumentType]
    return (item,) if otherwise is None else otherwise
