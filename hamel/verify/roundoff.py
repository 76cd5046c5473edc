"""Running error analysis: how far roundoff alone can move the results of a straight-line program.

Every operation z = f(a, b) adds half a unit in the last place of z and passes on what its operands carry:
    δz = |∂f/∂a| δa + |∂f/∂b| δb + ε |z|          (Wilkinson; Higham, Accuracy and Stability of Numerical Algorithms, §3.3)
Two orderings of the same sums and products agree within a small multiple of the bound, a wrong sign does not.
"""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np

EPSILON = float(np.finfo(float).eps) / 2


def bound(arguments: list[ca.SX], value: ca.SX) -> ca.SX:
    """The bound of each entry of a dense `value`, an expression over the same arguments, which count as exact."""
    symbols = ca.vertcat(*arguments)
    program = ca.Function("program", [symbols], [value])
    work: dict[int, ca.SX] = {}
    carried: dict[int, ca.SX] = {}
    result = ca.SX.zeros(value.numel())
    for index in range(program.n_instructions()):
        operation, into = program.instruction_id(index), program.instruction_output(index)
        operands = program.instruction_input(index)
        if operation == ca.OP_OUTPUT:
            result[into[1]] = carried[operands[0]]
        elif operation == ca.OP_INPUT:
            work[into[0]], carried[into[0]] = symbols[operands[1]], ca.SX(0)
        elif operation == ca.OP_CONST:
            work[into[0]], carried[into[0]] = ca.SX(program.instruction_constant(index)), ca.SX(0)
        else:
            taken = [work[i] for i in operands]
            passed = [carried[i] for i in operands]
            work[into[0]], carried[into[0]] = _operation(operation, taken, passed)
    return ca.reshape(result, value.size1(), value.size2())


def _operation(operation: int, operands: list[ca.SX], carried: list[ca.SX]) -> tuple[ca.SX, ca.SX]:
    z, *slopes = _slopes(operation, len(operands))(*operands)
    passed = sum((ca.fabs(slope) * error for slope, error in zip(slopes, carried)), ca.SX(0))
    exact = operation in (ca.OP_NEG, ca.OP_TWICE, ca.OP_FABS, ca.OP_ASSIGN)
    return z, passed if exact else passed + EPSILON * ca.fabs(z)


@cache
def _slopes(operation: int, count: int) -> ca.Function:
    """(a, b) → f, ∂f/∂a, ∂f/∂b of one CasADi operation."""
    symbols = [ca.SX.sym(name) for name in "ab"[:count]]
    z = ca.SX.unary(operation, *symbols) if count == 1 else ca.SX.binary(operation, *symbols)
    return ca.Function("slopes", symbols, [z, *(ca.densify(ca.jacobian(z, symbol)) for symbol in symbols)])
