"""angles: sines and cosines of sums from those of their parts.

A sine with its cosine takes eighteen multiplications in lanes, a theorem of addition four.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from codegen.program import Expression

Parts = Mapping[str, int]  # how often each local is in a sum


@dataclass(frozen=True)
class Turn:
    """An angle, and the two others that it is the sum or the difference of; None where it needs a
    sine and a cosine of its own."""

    angle: Expression
    of: tuple[Expression, Expression] | None = None
    sign: int = 1


def turns(
    angles: Sequence[Expression],
    values: Mapping[str, Expression],
    given: Collection[str],
    before: Sequence[Expression] = (),
) -> list[Turn]:
    """Those of the angles that are sums of what is `given`, each after those that it is made of;
    `values` are what other locals stand for. The angles `before` stand first, made as they would
    be without the others, so that a compiler finds again what it has."""
    sums = _sums(angles, values, given)
    own = {_key(parts): angle for angle, parts in reversed(sums.items())}
    first = _sums(before, {}, given)
    first = {own.get(_key(parts), angle): parts for angle, parts in first.items()}
    found: list[Turn] = []
    for group in (first, sums):
        left = sorted(group, key=lambda angle: sum(map(abs, group[angle].values())))
        _add([angle for angle in left if angle not in first or group is first], first | sums, found)
    return found


def _add(left: list[Expression], sums: Mapping[Expression, Parts], found: list[Turn]) -> None:
    """The angles that are left to those that were found: the first that is made of two of them, or
    the first of all."""
    known = _Known([sums[turn.angle] for turn in found])
    ready = {angle for angle in left if known.pair(sums[angle])}
    while left:
        angle = next((angle for angle in left if angle in ready), left[0])
        pair = known.pair(sums[angle])
        if pair:
            first, second, sign = pair
            found.append(Turn(angle, (found[first].angle, found[second].angle), sign))
        else:
            found.append(Turn(angle))
        left.remove(angle)
        known.add(sums[angle])
        ready |= {other for other in left if known.makes(sums[other], sums[angle])}


class _Known:
    """Sums that were found, by what they are of."""

    def __init__(self, sums: Sequence[Parts]) -> None:
        self._sums: list[Parts] = []
        self._places: dict[frozenset[tuple[str, int]], int] = {}
        for parts in sums:
            self.add(parts)

    def add(self, parts: Parts) -> None:
        self._places.setdefault(_key(parts), len(self._sums))
        self._sums.append(parts)

    def _place(self, parts: Parts) -> int:
        return self._places.get(_key(parts), len(self._sums))

    def makes(self, wanted: Parts, last: Parts) -> bool:
        """Whether it is the sum or a difference of the last and another one."""
        others = (_added(wanted, last, -1), _added(wanted, last, 1), _added(last, wanted, -1))
        return any(_key(other) in self._places for other in others)

    def pair(self, wanted: Parts) -> tuple[int, int, int] | None:
        """The first two that it is the sum (1) or the difference (-1) of."""
        for first, parts in enumerate(self._sums):
            plus = self._place(_added(wanted, parts, -1))
            minus = self._place(_added(parts, wanted, -1))
            if min(plus, minus) < len(self._sums):
                return (first, plus, 1) if plus <= minus else (first, minus, -1)
        return None


def _key(parts: Parts) -> frozenset[tuple[str, int]]:
    return frozenset(parts.items())


def spelled_sums(
    angles: Sequence[Expression], values: Mapping[str, Expression], given: Collection[str]
) -> list[Expression]:
    """Those of the angles that are sums of what is `given`, with what their locals stand for in
    their place. Others stay out: written out a formula may be of any length."""
    return [spelled(angle, values) for angle in _sums(angles, values, given)]


def spelled(value: Expression, values: Mapping[str, Expression]) -> Expression:
    """A sum with what its locals stand for in their place."""
    if isinstance(value, str):
        return spelled(values[value], values) if value in values else value
    if not isinstance(value, tuple):
        return value
    return (value[0], *(spelled(operand, values) for operand in value[1:]))


def _sums(
    angles: Sequence[Expression], values: Mapping[str, Expression], given: Collection[str]
) -> dict[Expression, Parts]:
    """The angles that are sums of what is given, with their parts."""
    known: dict[str, Parts | None] = {}

    def parts(value: Expression) -> Parts | None:
        if isinstance(value, str) and value not in given:
            if value not in known:
                known[value] = parts(values[value]) if value in values else None
            return known[value]
        if isinstance(value, str):
            return {value: 1}
        if not isinstance(value, tuple) or value[0] not in ("add", "sub"):
            return None
        left = parts(value[1])
        right = None if left is None else parts(value[2])
        if left is None or right is None:
            return None
        return _added(left, right, 1 if value[0] == "add" else -1)

    found = {angle: parts(angle) for angle in angles}
    return {angle: of for angle, of in found.items() if of}


def _added(a: Parts, b: Parts, sign: int) -> Parts:
    total = {name: a.get(name, 0) + sign * b.get(name, 0) for name in {**a, **b}}
    return {name: count for name, count in total.items() if count}
