"""Springs and dampers of joints and tendons: polynomials, as MuJoCo 4 has them.

A spring that is longer by x than at rest pulls with k₁ x + k₂ x² + k₃ x³, a damper that becomes
longer with the speed ẋ with d₁ ẋ + d₂ |ẋ| ẋ + d₃ ẋ³.
"""

from __future__ import annotations

from collections.abc import Sequence

from derive.robots.markup import Element
from derive.robots.numbers import listing, written
from derive.robots.robot import Reading

NONE = [0.0, 0.0, 0.0]


def powers(reading: Reading, element: Element, name: str) -> list[float]:
    """The three factors of `stiffness` or `damping`."""
    given = listing(reading, element, name) or []
    if len(given) > 3:
        reading.report(element, f"{len(given)} numbers in '{name}'", "at most 3", "", name)
    return [*given, *NONE][:3]


def of_length(k: Sequence[float], x: str, force: str, length: str) -> list[str]:
    """Terms k₁ x, k₂ x², k₃ x³; `force` and `length` are the units of the sum and of x, the latter
    empty where x is a number."""
    return [
        f"({written(factor)} {force}{_per(length, n)})*{x}{'' if n == 1 else f'^{n}'}"
        for n, factor in enumerate(k, 1)
        if factor
    ]


def of_speed(d: Sequence[float], v: str, force: str, length: str) -> list[str]:
    """Terms d₁ v, d₂ |v| v, d₃ v³."""
    shapes = (v, f"abs({v})*{v}", f"{v}^3")
    units = ("*s", "*s^2", "*s^3") if length else ("", "", "")
    return [
        f"({written(factor)} {force}{unit}{_per(length, n)})*{shape}"
        for n, (factor, unit, shape) in enumerate(zip(d, units, shapes), 1)
        if factor
    ]


def _per(length: str, power: int) -> str:
    return "" if not length else f"/{length}" if power == 1 else f"/{length}^{power}"
