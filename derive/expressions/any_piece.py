"""Terms in pieces, whichever piece holds: what bends or jumps stands for itself."""

from __future__ import annotations

import casadi as ca

from derive.expressions.instructions import Instruction, listing, run

IN_PIECES = frozenset(
    {ca.OP_FMIN, ca.OP_FMAX, ca.OP_FABS, ca.OP_SIGN, ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE}
)


def on_any_piece(value: ca.SX) -> ca.SX:
    """The scalar with a free symbol in the place of every min, max, abs, sign and comparison: it is
    zero where these are free, too, if it is zero on all pieces for the same reason."""
    known = ca.vertcat(*ca.symvar(value))
    free: list[ca.SX] = []

    def operation(read: Instruction, operands: list[ca.SX]) -> ca.SX:
        if read.code in IN_PIECES:
            free.append(ca.SX.sym(f"piece{len(free)}"))
            return free[-1]
        if len(operands) == 1:
            return ca.SX.unary(read.code, *operands)
        return ca.SX.binary(read.code, *operands)

    program = listing(ca.Function("value", [known], [ca.densify(value)]))
    ((result,),) = run(
        program, entry=lambda _, place: known[place], number=ca.SX, operation=operation
    )
    return result
