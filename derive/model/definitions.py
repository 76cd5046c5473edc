"""Parameters and `where:`: names for numbers, and names for formulas that may use each other."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter

from derive.diagnostics import listed
from derive.expressions import tree
from derive.expressions.dimensions import BARE, UNKNOWN, Inferred, infer
from derive.expressions.evaluate import number
from derive.expressions.linearity import degree
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.quantities import quantity, unit
from derive.expressions.tree import Expression
from derive.expressions.units import TIME as TIME_DIMENSION
from derive.expressions.units import pretty
from derive.model.document import Key, Scalar
from derive.model.language.entries import ParameterEntry
from derive.model.language.shape import Document
from derive.model.reader import WITH_KINEMATICS, Reader
from derive.model.records import Parameter
from derive.model.scope import ANYTHING, PARAMETER, TIME, Symbol, used

FEW = 3  # names in a note


def parameters(reader: Reader, document: Document) -> tuple[Parameter, ...]:
    """The parameters with their default values in SI."""
    return tuple(_parameter(reader, key, entry) for key, entry in document.parameters.items())


def _parameter(reader: Reader, key: Key, entry: Scalar | ParameterEntry) -> Parameter:
    scalar = entry if isinstance(entry, Scalar) else entry.value
    about = "" if isinstance(entry, Scalar) or entry.about is None else entry.about.text
    value, written, dimension = _number(reader, scalar)
    name = reader.name(key)
    reader.scope.add(name, Symbol(frozenset({PARAMETER}), dimension))
    reader.values[name], reader.units[name] = value, written
    return Parameter(name, value, written, about, key.span)


def _number(reader: Reader, scalar: Scalar) -> tuple[float, str, Inferred]:
    """Value, SI unit and dimension of a parameter."""
    plain = quantity(scalar.text)
    if plain is not None:
        return plain.value, plain.unit, unit(plain.unit).dimension if plain.unit else UNKNOWN
    try:
        parsed = expression(scalar.text)
        _no_names(parsed, scalar.text)
        dimension = infer(parsed, {}, scalar.text)
        value = number(parsed, {}, scalar.text)
    except FormulaError as error:
        reader.fault(scalar, error)
        return 1.0, "", UNKNOWN
    return (
        value,
        pretty(dimension) if isinstance(dimension, tuple) else "",
        UNKNOWN if dimension == BARE else dimension,
    )


def _no_names(parsed: Expression, text: str) -> None:
    for node in tree.walk(parsed):
        if isinstance(node, tree.Name | tree.Rate):
            hint = "a formula of parameters goes under `where:`"
            raise FormulaError(
                f"'{node.name}' in the value of a parameter",
                text,
                node.at,
                "a number with its unit",
                hint,
            )


def unused(reader: Reader, parameters: tuple[Parameter, ...]) -> tuple[str, ...]:
    """A note of the parameters that no formula of the file names: likely one is misspelt."""
    names = [x.name for x in parameters if x.name not in reader.scope.used]
    if not names:
        return ()
    many = len(names) > 1
    said = f"parameter{'s' * many} {listed(names, FEW)} {'are' if many else 'is'} used nowhere"
    return (said,)


def definitions(reader: Reader, document: Document) -> tuple[tuple[str, Expression], ...]:
    """`where:` in dependency order."""
    reader.scope.add("t", Symbol(frozenset({TIME}), TIME_DIMENSION))
    entries = {str(key): (key, scalar) for key, scalar in document.where.items()}
    names = {*reader.scope.symbols, *entries}
    parsed = {
        reader.name(key): _parsed(reader, scalar, names, entries)
        for key, scalar in document.where.items()
    }
    order = _order(reader, parsed, entries)
    return tuple((name, _definition(reader, name, entries[name][1])) for name in order)


def _parsed(
    reader: Reader, scalar: Scalar, names: set[str], entries: dict[str, tuple[Key, Scalar]]
) -> set[str]:
    """The definitions a definition uses; errors are reported when it is read in its turn."""
    try:
        functions = WITH_KINEMATICS | reader.functions
        nodes = tree.walk(expression(scalar.text, names, functions, vectors=True))
    except FormulaError:
        return set()
    leaves = [node for node in nodes if isinstance(node, tree.Name | tree.Rate)]
    return {node.name for node in leaves if node.name in entries}


def _order(
    reader: Reader, uses: dict[str, set[str]], entries: dict[str, tuple[Key, Scalar]]
) -> list[str]:
    try:
        return list(TopologicalSorter(uses).static_order())
    except CycleError as error:
        circle = _from_first(list(reversed(error.args[1])), list(entries))
        reader.report(
            entries[circle[0]][0].span,
            f"'{circle[0]}' is defined by itself: {' → '.join(circle[:10])}",
            "formulas without a circle",
        )
        reader.finish()
        raise AssertionError("unreachable") from None


def _from_first(circle: list[str], order: list[str]) -> list[str]:
    """The circle, closed, told from its first definition in the file."""
    start = min(range(len(circle) - 1), key=lambda i: order.index(circle[i]))
    return circle[start:-1] + circle[: start + 1]


def _definition(reader: Reader, name: str, scalar: Scalar) -> Expression:
    formula = reader.formula(scalar, "a definition", ANYTHING)
    scope = reader.scope
    kinds = used(formula, scope)
    try:
        dimension = infer(formula, scope.dimensions, scalar.text)
    except FormulaError:
        dimension = UNKNOWN  # reported by `formula`
    known = UNKNOWN if dimension == BARE else dimension
    degrees = degree(formula, definitions=scope.degrees)
    scope.add(name, Symbol(frozenset(kinds), known, degrees, tuple(kinds.items())))
    reader.definitions[name] = formula
    if kinds.keys() <= {PARAMETER} and (value := reader.value(formula, scalar)) is not None:
        reader.values[name] = value
    return formula
