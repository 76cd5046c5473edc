"""Numbers in attributes, checked where they stand."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from derive.expressions.limits import BELOW, too_large, too_small
from derive.robots.limits import WHOLE
from derive.robots.markup import Element
from derive.robots.robot import Reading
from derive.robots.rotations import Vector

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)


def listing(
    reading: Reading, element: Element, attribute: str, count: int | None = None
) -> list[float] | None:
    """The finite numbers of an attribute, exactly `count` of them if given; None after reporting,
    or where there is none."""
    if attribute not in element.attributes:
        return None
    words = element.get(attribute).split()
    values = [_number(word) for word in words]
    bad = next((word for word, value in zip(words, values) if too_large(value)), None)
    if bad is not None:
        reading.report(
            element,
            f"'{bad}' in '{attribute}' of <{element.tag}>",
            f"finite numbers, {BELOW}",
            attribute=attribute,
        )
        return None
    if count is not None and len(values) != count:
        problem = (
            f"{len(values)} number{'s' * (len(values) != 1)} in '{attribute}' of <{element.tag}>"
        )
        reading.report(element, problem, str(count), attribute=attribute)
        return None
    return values


def _number(word: str) -> float:
    """NaN for what is no number. What is too small for a model is rounding of an exporter's
    zero."""
    value = float(word) if _NUMBER.match(word) else math.nan
    return 0.0 if too_small(value) else value


def is_endless(element: Element, attribute: str) -> bool:
    """Whether an attribute says infinity, as exporters write it where there is no limit: inf, or
    the largest double."""
    try:
        value = float(element.get(attribute, "0"))
    except ValueError:
        return False
    return too_large(value) and not math.isnan(value)


def scalar(reading: Reading, element: Element, attribute: str, otherwise: float = 0.0) -> float:
    """One number of an attribute, `otherwise` where it is not given; anything else is reported."""
    values = listing(reading, element, attribute, 1)
    return values[0] if values else otherwise


def vector(
    reading: Reading,
    element: Element | None,
    attribute: str,
    otherwise: Sequence[float] = (0.0, 0.0, 0.0),
) -> Vector:
    """Three numbers of an attribute, `otherwise` where element or attribute is not there."""
    values = listing(reading, element, attribute, 3) if element else None
    x, y, z = values or otherwise
    return (x, y, z)


def written(number: float) -> str:
    """A number that reads back as the same one, without a needless point."""
    if number == int(number) and abs(number) < WHOLE:
        return str(int(number))
    return repr(number)
