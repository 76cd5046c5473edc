"""turns: the coordinates in which nothing that a simulation computes sees a whole turn.

A value is followed as g + Σ a_i q_i, where whole turns of the coordinates leave g as it is and the
a_i are numbers. Sines, cosines and tangents of such a sum forget whole turns of a coordinate whose
a_i is an integer. Everything else that takes the sum, such as the product with a stiffness, sees
them, and so does who gets it as a result. Derivatives of what a function does not see do not see it
either.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from codegen.passes.rewriting.trace import Tape

Shift = dict[int, float]  # the a_i that are not zero

_PERIODIC = frozenset({ca.OP_SIN, ca.OP_COS, ca.OP_TAN})


def turns(
    tape: Tape, roots: Sequence[int], count: int, handed_on: bool
) -> tuple[set[int], set[int]]:
    """The coordinates among the first `count` entries of x that go round on the way to the roots,
    and those whose turns are seen.

    `handed_on`: the first results are the coordinates themselves, corrected, so that turns are to
    be seen in them.
    """
    shifts, round_, seen = _followed(tape, tape.needed(roots), count)
    for k, root in enumerate(roots):
        own = {k: 1.0} if handed_on and k < count else {}
        seen |= _sum(shifts.get(root, {}), own, -1.0).keys()
    return round_, seen


def _followed(
    tape: Tape, needed: bytearray, count: int
) -> tuple[dict[int, Shift], set[int], set[int]]:
    shifts: dict[int, Shift] = {}
    round_: set[int] = set()
    seen: set[int] = set()
    for k, step in enumerate(tape.steps):
        if step.code == ca.OP_INPUT:
            argument, entry = tape.slot(step)
            if argument == "x" and entry < count:
                shifts[k] = {entry: 1.0}
        given = [shifts.get(i, {}) for i in step.operands]
        if not (needed[k] and any(given)):
            continue
        constants = [_constant(tape, i) for i in step.operands]
        if step.code in _PERIODIC:
            whole = {i for i, a in given[0].items() if a.is_integer()}
            round_ |= whole
            seen |= given[0].keys() - whole
        elif (combination := _linear(step.code, given, constants)) is not None:
            shifts[k] = combination
        else:
            seen |= {i for one in given for i in one}
    return shifts, round_, seen


def _constant(tape: Tape, place: int) -> float | None:
    step = tape.steps[place]
    return step.number if step.code == ca.OP_CONST else None


def _linear(code: int, given: Sequence[Shift], constants: Sequence[float | None]) -> Shift | None:
    """The shift of the result of an operation that is linear in what is shifted; None of any
    other."""
    first, last = given[0], given[-1]
    match code:
        case ca.OP_ADD:
            return _sum(first, last, 1.0)
        case ca.OP_SUB:
            return _sum(first, last, -1.0)
        case ca.OP_NEG:
            return _sum({}, first, -1.0)
        case ca.OP_TWICE:
            return _sum({}, first, 2.0)
        case ca.OP_ASSIGN:
            return first
        case ca.OP_MUL if constants[0] is not None:
            return _sum({}, last, constants[0])
        case ca.OP_MUL if constants[1] is not None:
            return _sum({}, first, constants[1])
        case ca.OP_DIV if constants[1]:
            return _sum({}, first, 1.0 / constants[1])
        case _:
            return None


def _sum(one: Mapping[int, float], other: Mapping[int, float], times: float) -> Shift:
    total = {i: one.get(i, 0.0) + times * other.get(i, 0.0) for i in (*one, *other)}
    return {i: a for i, a in total.items() if a}
