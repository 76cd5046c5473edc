"""Dimension inference over a formula: metres are not added to kilograms, and sines are taken of
plain numbers.

The dimension of a part is a Dimension, UNKNOWN (it holds a parameter that was given without a unit;
nothing can be said), or BARE (numbers without units alone: fits anything it is added to, and is a
plain number as a factor).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction

from derive.expressions import tree
from derive.expressions.functions import FUNCTIONS
from derive.expressions.mistakes import FormulaError
from derive.expressions.quantities import unit
from derive.expressions.tree import Expression
from derive.expressions.units import (
    NUMBER,
    Dimension,
    named,
    power_of,
    pretty,
    product_of,
    quotient_of,
)

UNKNOWN = None
BARE = "bare"
SHORT = 60  # characters of a formula that a hint shows whole
_NUMBER = re.compile(r"[-+\s]*[0-9.]+(?:[eE][-+]?[0-9]+)?")
Inferred = Dimension | str | None


def infer(expression: Expression, known: Mapping[str, Inferred], text: str = "") -> Inferred:
    """The dimension of a formula, from the bottom up without recursion: terms of a sum must agree,
    factors multiply, sines are taken of plain numbers.

    `known` has an entry for each name, and "der(q)" for each rate; absent ones are UNKNOWN. Raises
    FormulaError at the part that does not fit.
    """
    stack: list[Inferred] = []
    for node in tree.walk(expression):
        count = len(tree.children(node))
        operands = stack[len(stack) - count :] if count else []
        if count:
            del stack[len(stack) - count :]
        stack.append(_of(node, operands, known, text))
    return stack[0]


def _of(
    node: Expression, operands: list[Inferred], known: Mapping[str, Inferred], text: str
) -> Inferred:
    match node:
        case tree.Number(_, written):
            return unit(written).dimension if written else BARE
        case tree.Name(name):
            return known.get(name, UNKNOWN)
        case tree.Rate(name):
            return known.get(f"der({name})", UNKNOWN)
        case tree.Sum(terms):
            return _alike(terms, operands, "add", text)
        case tree.Product():
            return _product(operands)
        case tree.Quotient():
            return _quotient(operands)
        case tree.Power():
            return _power(node, operands, text)
        case tree.Negative():
            return operands[0]
        case tree.Call(function):
            table = f"{function}()" in known
            return (_table if table else _call)(node, operands, text, known)
        case tree.Vector(entries):
            return _alike(entries, operands, "list", text)

        case _:
            pass


def _alike(
    parts: tuple[Expression, ...], dimensions: list[Inferred], verb: str, text: str
) -> Inferred:
    first: Inferred = BARE
    for part, dimension in zip(parts, dimensions):
        if dimension in (UNKNOWN, BARE):
            first = UNKNOWN if dimension is UNKNOWN and first == BARE else first
        elif first in (UNKNOWN, BARE):
            first = dimension
        elif dimension != first:
            phrase = _mismatch(verb, dimension, first)
            hint = with_unit(part, quotient_of(first, dimension), text)  # type: ignore[arg-type]
            raise FormulaError(phrase, text, part.at, named(_solid(first)), hint)
    return first


def _mismatch(verb: str, given: Inferred, first: Inferred) -> str:
    a, b = named(_solid(given)), named(_solid(first))
    return {"add": f"cannot add {a} to {b}", "compare": f"cannot compare {a} with {b}"}.get(
        verb, f"{a} in a list of {b}"
    )


def _solid(dimension: Inferred) -> Dimension:
    return dimension if isinstance(dimension, tuple) else NUMBER


def _product(operands: list[Inferred]) -> Inferred:
    if UNKNOWN in operands:
        return UNKNOWN
    if all(operand == BARE for operand in operands):
        return BARE
    total = NUMBER
    for operand in operands:
        total = product_of(total, _solid(operand))
    return total


def _quotient(operands: list[Inferred]) -> Inferred:
    above, below = operands
    if UNKNOWN in operands:
        return UNKNOWN
    return BARE if above == below == BARE else quotient_of(_solid(above), _solid(below))


def _power(node: tree.Power, operands: list[Inferred], text: str) -> Inferred:
    base, exponent = operands
    _plain(exponent, node.exponent, "an exponent", text)
    if not isinstance(base, tuple):
        return base
    if base == NUMBER:
        return NUMBER
    constant = _exponent(node.exponent)
    if constant is None:
        raise FormulaError(
            f"{named(base)} to a power that is not a number",
            text,
            node.exponent.at,
            "a number, or a base without unit",
        )
    return power_of(base, constant)


def _exponent(node: Expression) -> Fraction | None:
    match node:
        case tree.Number(value):
            return Fraction(value).limit_denominator(1000)
        case tree.Negative(argument):
            inner = _exponent(argument)
            return None if inner is None else -inner
        case tree.Quotient(tree.Number(above), tree.Number(below)):
            return Fraction(above / below).limit_denominator(1000)
        case _:
            pass
    return None


def _plain(dimension: Inferred, node: Expression, what: str, text: str) -> None:
    if isinstance(dimension, tuple) and dimension != NUMBER:
        hint = with_unit(node, quotient_of(NUMBER, dimension), text, angle=True)
        raise FormulaError(
            f"{what} in {named(dimension)}", text, node.at, "a plain number or an angle", hint
        )


def with_unit(node: Expression, missing: Dimension, text: str, angle: bool = False) -> str:
    """How a bare factor of a formula is written with the unit that the formula lacks: `sin(3*t)` →
    `sin((3 rad/s)*t)`; "" where no bare number is a factor."""
    factor = _bare_factor(node)
    if factor is None or missing == NUMBER or not text:
        return ""
    number = _NUMBER.match(text, factor.at)
    if number is None:
        return ""
    unit_of = pretty(missing)
    if angle and unit_of.startswith("1/"):
        unit_of = f"rad{unit_of[1:]}"
    written = f"({number.group().strip()} {unit_of})"
    whole = f"{text[: factor.at]}{written}{text[number.end() :]}".strip()
    return f"with its unit that is {whole if len(whole) <= SHORT else f'{written}*…'}"


def _bare_factor(node: Expression) -> tree.Number | None:
    """The first number without a unit that multiplies the whole."""
    match node:
        case tree.Number(_, ""):
            return node
        case tree.Negative(inside) | tree.Quotient(inside, _):
            return _bare_factor(inside)
        case tree.Product(factors):
            return next((f for f in factors if isinstance(f, tree.Number) and not f.unit), None)
        case _:
            pass
    return None


def _table(
    node: tree.Call, operands: list[Inferred], text: str, known: Mapping[str, Inferred]
) -> Inferred:
    """What `known` has as NAME( of the argument and as NAME() of the value."""
    wanted = known[f"{node.function}("]
    if isinstance(operands[0], tuple) and operands[0] != wanted:
        message = f"{node.function}() of {named(operands[0])}"
        raise FormulaError(message, text, node.arguments[0].at, named(_solid(wanted)))
    return known[f"{node.function}()"]


def _call(
    node: tree.Call, operands: list[Inferred], text: str, known: Mapping[str, Inferred]
) -> Inferred:
    rule = FUNCTIONS[node.function].units if node.function in FUNCTIONS else "output"
    if rule == "number":
        _plain(operands[0], node.arguments[0], f"{node.function}() of a quantity", text)
        return BARE if operands[0] == BARE else NUMBER
    if rule == "root":
        return (
            power_of(operands[0], Fraction(1, 2)) if isinstance(operands[0], tuple) else operands[0]
        )
    if rule in ("same", "ratio"):
        common = _alike(node.arguments, operands, "compare", text)
        return common if rule == "same" else NUMBER
    if rule == "pieces":
        return _pieces(node, operands, text)
    return NUMBER if rule == "sign" else UNKNOWN


def _pieces(node: tree.Call, operands: list[Inferred], text: str) -> Inferred:
    """Of x and the places between pieces, all alike, and of the pieces, all alike."""
    if len(operands) % 2:
        raise FormulaError(
            f"piecewise() with {len(operands)} arguments",
            text,
            node.at,
            "x, a formula, and then pairs: where the next begins, and its formula",
        )
    places = (node.arguments[0], *node.arguments[2::2])
    _alike(places, [operands[0], *operands[2::2]], "compare", text)
    return _alike(node.arguments[1::2], operands[1::2], "compare", text)
