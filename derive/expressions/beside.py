"""Terms in pieces, with the pieces that hold a little beside: of both sides of a kink one at a
time, and of all terms that go on to another piece there the same."""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.expressions.any_piece import IN_PIECES
from derive.expressions.instructions import Instruction, listing, run

Both = tuple[ca.SX, ca.SX]  # the value here, and what it is beside
CHOSEN = frozenset({ca.OP_FMIN, ca.OP_FMAX})


def with_pieces_beside(value: ca.SX, at: ca.SX, by: np.ndarray) -> ca.SX:
    """`value` (r × c) over the symbols `at` (n) and others, where every min, max, abs, sign and
    comparison goes by what its operands are at `at` + `by`. Everything else is what it is here, so
    that it is exact however far `by` goes within the pieces."""
    known = ca.vertcat(at, *[x for x in ca.symvar(value) if not _is_among(x, at)])
    moved = known + ca.vertcat(ca.DM(by), ca.DM.zeros(known.numel() - at.numel()))
    program = listing(ca.Function("value", [known], [ca.densify(ca.vec(value))]))

    def number(x: float) -> Both:
        return ca.SX(x), ca.SX(x)

    (entries,) = run(program, lambda _, k: (known[k], moved[k]), number, _made)
    return ca.reshape(ca.vertcat(*[here for here, _ in entries]), value.size1(), value.size2())


def _is_among(symbol: ca.SX, many: ca.SX) -> bool:
    return any(symbol.element_hash() == x.element_hash() for x in ca.vertsplit(many))


def _made(read: Instruction, operands: list[Both]) -> Both:
    here, beside = [x for x, _ in operands], [x for _, x in operands]
    there = _plain(read.code, beside)
    if read.code not in IN_PIECES:
        return _plain(read.code, here), there
    if read.code == ca.OP_FABS:
        return ca.SX.unary(ca.OP_SIGN, beside[0]) * here[0], there
    if read.code in CHOSEN:
        first = (beside[0] < beside[1]) if read.code == ca.OP_FMIN else (beside[0] > beside[1])
        return ca.if_else(first, here[0], here[1]), there
    return there, there


def _plain(code: int, operands: list[ca.SX]) -> ca.SX:
    if len(operands) == 1:
        return ca.SX.unary(code, operands[0])
    return ca.SX.binary(code, *operands)
