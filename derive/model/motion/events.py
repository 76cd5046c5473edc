"""Events: where a formula of the motion changes its sign."""

from __future__ import annotations

from derive.expressions.dimensions import infer
from derive.expressions.quantities import unit
from derive.expressions.tree import Call, Expression, Name, Rate, Vector, walk
from derive.model.document import Key, Scalar
from derive.model.language.shape import Document
from derive.model.language.study_entries import EventEntry
from derive.model.reader import UNREAD, Reader
from derive.model.records import Event, Output
from derive.model.rows import components, is_reaction
from derive.model.scope import ANYTHING, PARAMETER, REACTION, VELOCITY, Scope, Symbol

DIRECTIONS = {"both": 0, "rising": 1, "falling": -1}
MOST = 64  # that the simulation of a module looks for


def events(reader: Reader, document: Document, outputs: tuple[Output, ...]) -> tuple[Event, ...]:
    """The entries of `events:`; their formulas may use outputs, points by component: `tip.x`."""
    entries = list(document.events.items())
    for key, _ in entries[MOST:]:
        reader.report(key.span, f"more than {MOST} events", f"{MOST} at most")
    outer = reader.scope
    reader.scope = _with_outputs(reader, outputs)
    result = tuple(_event(reader, key, entry) for key, entry in entries)
    reader.scope = outer
    return result


def _event(reader: Reader, key: Key, entry: Scalar | EventEntry) -> Event:
    reader.name(key)
    if isinstance(entry, Scalar):
        scalar, direction, stop = entry, 0, False
    else:
        scalar = entry.formula
        direction = reader.choice(entry.direction, DIRECTIONS, "direction", 0)
        stop = reader.answer(entry.stop, otherwise=False)
    formula = reader.formula(scalar, "an event", ANYTHING)
    if _is_constant(reader, formula):
        reader.notes.append(f"event {key} never happens: nothing in '{scalar.text}' changes")
    return Event(str(key), formula, scalar.text, direction, stop, key.span)


def _is_constant(reader: Reader, formula: Expression) -> bool:
    """Whether it is of numbers and parameters alone."""
    leaves = [node for node in walk(formula) if isinstance(node, Name | Rate)]
    symbols = [reader.scope.symbols.get(node.name) for node in leaves if isinstance(node, Name)]
    known = len(symbols) == len(leaves) and formula is not UNREAD
    return known and all(x is not None and x.kinds <= {PARAMETER} for x in symbols)


def _with_outputs(reader: Reader, outputs: tuple[Output, ...]) -> Scope:
    """The scope with the names of outputs that are numbers, and of those that are reactions to say
    so."""
    inner = Scope(aliases=dict(reader.scope.aliases), used=reader.scope.used)
    for name, symbol in reader.scope.symbols.items():
        inner.put(name, symbol)
    for output in outputs:
        if is_reaction(output.expression):
            inner.add(output.name, Symbol(frozenset({REACTION}), None))
        for name in components(output.name, output.expression, reader.space.letters):
            dimension = unit(output.unit).dimension if output.unit else unit("1").dimension
            if not isinstance(output.expression, Call | Vector) and output.expression is not UNREAD:
                dimension = infer(output.expression, inner.dimensions)
            inner.add(name, Symbol(frozenset({VELOCITY}), dimension))
    return inner
