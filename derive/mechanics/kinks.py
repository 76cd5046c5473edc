"""What changes its sign where the right-hand side of the motion goes on to another piece.

min, max, abs, sign, comparisons, and so tables, contact and whatever else the terms were made with:
they are read off the terms themselves, not off the formulas of the file.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from derive.mechanics.records import System
from derive.model.kinks import are_constraints_in_pieces

NEIGHBOURS = 4  # thresholds of a term that have functions of their own
OF_ONE = frozenset({ca.OP_FABS, ca.OP_SIGN})
OF_TWO = frozenset({ca.OP_FMIN, ca.OP_FMAX, ca.OP_LT, ca.OP_LE})


def kinks(system: System) -> tuple[ca.SX, ...]:
    """Functions of t, q, v, u, p and z, each zero at one kink or jump of forces, of rates of states
    or of prescribed motions. Of one term with several thresholds there are at most four, which
    change their signs at every fourth of them: neighbours, which may be near each other, do not
    hide one another within one step."""
    within = _Within()
    moving = within.any_of(ca.vertcat(system.q, system.v, system.z, system.u, system.t))
    thresholds: dict[int, tuple[ca.SX, set[float]]] = {}
    result: list[ca.SX] = []
    for value, other in _sides(_terms(system)):
        if not moving & (within(value) | within(other)):
            continue
        if not other.is_constant():
            result.append(value - other)
        elif (reduced := _threshold(value, float(other))) is not None:
            term, place = reduced
            thresholds.setdefault(term.element_hash(), (term, set()))[1].add(place)
    for term, places in thresholds.values():
        parts = (sorted(places)[first::NEIGHBOURS] for first in range(NEIGHBOURS))
        result += [_alternating(term, part) for part in parts if part]
    return tuple(_without_twins(result, within))


def _terms(system: System) -> list[ca.SX]:
    terms = [system.Q, system.zdot, system.h_extra]
    if are_constraints_in_pieces(system.model):
        terms += [system.phi, system.A, system.c, system.beta]
    return [term[i] for full in terms for term in [ca.SX(full).nz[:]] for i in range(term.numel())]


def _sides(terms: list[ca.SX]) -> Iterator[tuple[ca.SX, ca.SX]]:
    """What is compared with what: a number is the second. Terms are visited once."""
    seen: set[int] = set()
    left = list(terms)
    while left:
        term = left.pop()
        if term.element_hash() in seen:
            continue
        seen.add(term.element_hash())
        parts = [term.dep(i) for i in range(term.n_dep())]
        left += parts
        if term.op() in OF_ONE:
            yield parts[0], ca.SX(0)
        elif term.op() in OF_TWO:
            first, second = parts
            yield (second, first) if first.is_constant() else (first, second)


def _threshold(value: ca.SX, place: float) -> tuple[ca.SX, float] | None:
    """A simpler term and number with the same sign of the difference: without what is added, and
    without a limit that is not reached there. None where the limit keeps the sign as it is."""
    while True:
        parts = [value.dep(i) for i in range(value.n_dep())]
        constant = next((i for i, part in enumerate(parts) if part.is_constant()), None)
        if value.op() == ca.OP_NEG:
            value, place = parts[0], -place
        elif constant is None or len(parts) != 2:
            return value, place
        elif value.op() in (ca.OP_FMIN, ca.OP_FMAX):
            limit = float(parts[constant])
            if (place >= limit) if value.op() == ca.OP_FMIN else (place <= limit):
                return None
            value = parts[1 - constant]
        elif value.op() == ca.OP_ADD:
            value, place = parts[1 - constant], place - float(parts[constant])
        elif value.op() == ca.OP_SUB and constant == 1:
            value, place = parts[0], place + float(parts[1])
        elif value.op() == ca.OP_SUB:
            value, place = parts[1], float(parts[0]) - place
        else:
            return value, place


def _alternating(term: ca.SX, places: list[float]) -> ca.SX:
    """Zero at the places alone, with slopes 1, −1, 1 … there: parabolas between them, straight
    lines outside."""
    last = len(places) - 1
    outside = (-1.0) ** last * ca.fmax(term - places[-1], 0)
    if not last:
        return term - places[0]
    result = ca.fmin(term - places[0], 0) + outside
    for i in range(last):
        length = places[i + 1] - places[i]
        part = ca.fmax(ca.fmin(term, places[i + 1]) - places[i], 0)
        result += (-1.0) ** i * part * (length - part) / length
    return result


class _Within:
    """The symbols that terms are made of, a bit each. What terms have in common is looked through
    once: each height of a long chain is made of all coordinates before it."""

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}
        self._known: dict[int, int] = {}

    def any_of(self, column: ca.SX) -> int:
        """All of a column."""
        found = 0
        for term in ca.vertsplit(ca.SX(column)):
            found |= self(term)
        return found

    def __call__(self, term: ca.SX) -> int:
        left = [term]
        while left:
            one = left[-1]
            key = one.element_hash()
            if key in self._known:
                left.pop()
                continue
            parts = [one.dep(i) for i in range(one.n_dep())]
            missing = [x for x in parts if x.element_hash() not in self._known]
            if missing:
                left += missing
                continue
            left.pop()
            self._known[key] = self._own(one, parts)
        return self._known[term.element_hash()]

    def _own(self, term: ca.SX, parts: list[ca.SX]) -> int:
        if term.is_symbolic():
            return 1 << self._numbers.setdefault(term.element_hash(), len(self._numbers))
        found = 0
        for part in parts:
            found |= self._known[part.element_hash()]
        return found


DEPTH = 6  # in which two terms are compared: more only finds more twins
LARGE = 64  # symbols from which a term is compared as it is: to simplify many such takes long


def _without_twins(found: list[ca.SX], within: _Within) -> Iterator[ca.SX]:
    """Of functions that differ in their sign alone the first. Twins are of the same symbols."""
    seen: dict[int, list[ca.SX]] = {}
    for one in found:
        symbols = within(one)
        alike = seen.setdefault(symbols, [])
        signs = [one, -one]
        if symbols.bit_count() < LARGE:
            signs = [ca.simplify(sign) for sign in signs]
        if not any(ca.is_equal(sign, other, DEPTH) for other in alike for sign in signs):
            alike.append(signs[0])
            yield one
