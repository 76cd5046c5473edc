"""What changes its sign where the right-hand side of the motion goes on to another piece.

min, max, abs, sign, comparisons, and so tables, contact and whatever else the terms were made with:
they are read off the terms themselves, not off the formulas of the file.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from derive.mechanics.records import System
from derive.model.kinks import are_constraints_in_pieces

OF_ONE = frozenset({ca.OP_FABS, ca.OP_SIGN})
OF_TWO = frozenset({ca.OP_FMIN, ca.OP_FMAX, ca.OP_LT, ca.OP_LE})


def kinks(system: System) -> tuple[ca.SX, ...]:
    """Functions of t, q, v, u, p and z, each zero at one kink or jump of forces, of rates of states
    or of prescribed motions. Of one term with several thresholds a single function: it changes its
    sign at each of them. Of the time alone there are two, so that neighbours, which may be near
    each other, do not hide one another within one step."""
    others = _symbols(ca.vertcat(system.q, system.v, system.z, system.u))
    moving = others | _symbols(system.t)
    thresholds: dict[int, tuple[ca.SX, set[float]]] = {}
    result: list[ca.SX] = []
    for value, other in _sides(_terms(system)):
        if moving.isdisjoint(_symbols(value - other)):
            continue
        if not other.is_constant():
            result.append(value - other)
        elif (reduced := _threshold(value, float(other))) is not None:
            term, place = reduced
            thresholds.setdefault(term.element_hash(), (term, set()))[1].add(place)
    for term, places in thresholds.values():
        ordered, timed = sorted(places), others.isdisjoint(_symbols(term))
        parts = [ordered[::2], ordered[1::2]] if timed else [ordered]
        result += [_alternating(term, part) for part in parts if part]
    return tuple(_without_twins(result))


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


def _symbols(term: ca.SX) -> frozenset[int]:
    """What a term is made of. Looking for some of it among all coordinates of a large system, as
    `depends_on` does, takes as long as the system is large."""
    return frozenset(symbol.element_hash() for symbol in ca.symvar(term))


DEPTH = 6  # in which two terms are compared: more only finds more twins


def _without_twins(found: list[ca.SX]) -> Iterator[ca.SX]:
    """Of functions that differ in their sign alone the first. Twins are of the same symbols."""
    seen: dict[frozenset[int], list[ca.SX]] = {}
    for one in found:
        alike = seen.setdefault(_symbols(one), [])
        signs = [ca.simplify(one), ca.simplify(-one)]
        if not any(ca.is_equal(sign, other, DEPTH) for other in alike for sign in signs):
            alike.append(signs[0])
            yield one
