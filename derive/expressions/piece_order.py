"""What functions in pieces take for granted: widths of more than nothing, bounds and places in
order.

With a width of zero a step is a quotient by zero, which is folded into the piece of one side;
bounds in the wrong order leave it to each kind of number which one counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from derive.expressions import tree
from derive.expressions.evaluate import number
from derive.expressions.functions import FUNCTIONS
from derive.expressions.mistakes import FormulaError

SMOOTH = {"step": 1, "ramp": 1, "clip": 3}  # where the width stands, behind all others


def check_pieces(formula: tree.Expression, names: Mapping[str, float], text: str = "") -> None:
    """Raises FormulaError where that does not hold at the values of `names`; what depends on other
    names is not known yet."""
    for node in tree.walk(formula):
        if isinstance(node, tree.Call):
            _check_width(node, names, text)
            _check_order(node, names, text)


def _check_width(call: tree.Call, names: Mapping[str, float], text: str) -> None:
    place = SMOOTH.get(call.function, len(call.arguments))
    for _, width, at in _known(call.arguments[place:], names):
        if width <= 0.0:
            raise FormulaError(
                f"the width of {call.function}() is {width:g}",
                text,
                at,
                "more than zero",
                f"{call.function}() without a width is sharp",
            )


def _check_order(call: tree.Call, names: Mapping[str, float], text: str) -> None:
    """Bounds may be equal, places may not: there would be two values."""
    is_clip = call.function == "clip"
    places = call.arguments[1:3] if is_clip else call.arguments[2::2]
    if not (is_clip or call.function == "piecewise"):
        return
    known = list(_known(places, names))
    for (one, first, _), (other, second, at) in pairwise(known):
        if other == one + 1 and (second < first or (second == first and not is_clip)):
            what = "bounds" if is_clip else "places"
            raise FormulaError(
                f"the {what} of {call.function}() are {first:g} and {second:g}",
                text,
                at,
                "the lower bound first" if is_clip else "places that increase",
            )


def _known(
    arguments: Sequence[tree.Expression], names: Mapping[str, float]
) -> Iterator[tuple[int, float, int]]:
    """Which arguments have values, these, and where they stand in the text."""
    for place, argument in enumerate(arguments):
        value = value_of(argument, names)
        if value is not None:
            yield place, value, argument.at


def value_of(formula: tree.Expression, names: Mapping[str, float]) -> float | None:
    """The value of a formula of these names; None where it uses others, or has none."""
    if not all(_is_known(node, names) for node in tree.walk(formula)):
        return None
    try:
        return number(formula, names)
    except FormulaError:
        return None


def _is_known(node: tree.Expression, names: Mapping[str, float]) -> bool:
    """Not a name without a value, a rate, nor a table."""
    if isinstance(node, tree.Call):
        return node.function in FUNCTIONS
    return not isinstance(node, tree.Rate) and (
        not isinstance(node, tree.Name) or node.name in names
    )
