"""CasADi terms evaluated with many digits, so that roundoff is told from an error."""

import casadi as ca
import mpmath

from derive.expressions.instructions import listing, run

UNARY = {
    ca.OP_INV: lambda a: 1 / a,
    ca.OP_NEG: lambda a: -a,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_TWICE: lambda a: 2 * a,
    ca.OP_SQRT: mpmath.sqrt,
    ca.OP_SIN: mpmath.sin,
    ca.OP_COS: mpmath.cos,
    ca.OP_TAN: mpmath.tan,
    ca.OP_ASIN: mpmath.asin,
    ca.OP_ACOS: mpmath.acos,
    ca.OP_ATAN: mpmath.atan,
    ca.OP_SINH: mpmath.sinh,
    ca.OP_COSH: mpmath.cosh,
    ca.OP_TANH: mpmath.tanh,
    ca.OP_EXP: mpmath.exp,
    ca.OP_LOG: mpmath.log,
    ca.OP_FABS: abs,
    ca.OP_SIGN: mpmath.sign,
    ca.OP_FLOOR: mpmath.floor,
    ca.OP_CEIL: mpmath.ceil,
    ca.OP_NOT: lambda a: mpmath.mpf(a == 0),
    ca.OP_ASSIGN: lambda a: a,
}
BINARY = {
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b,
    ca.OP_POW: lambda a, b: a**b,
    ca.OP_CONSTPOW: lambda a, b: a**b,
    ca.OP_ATAN2: mpmath.atan2,
    ca.OP_COPYSIGN: lambda a, b: abs(a) if b >= 0 else -abs(a),
    ca.OP_FMIN: min,
    ca.OP_FMAX: max,
    ca.OP_LT: lambda a, b: mpmath.mpf(a < b),
    ca.OP_LE: lambda a, b: mpmath.mpf(a <= b),
    ca.OP_EQ: lambda a, b: mpmath.mpf(a == b),
    ca.OP_NE: lambda a, b: mpmath.mpf(a != b),
    ca.OP_AND: lambda a, b: mpmath.mpf(bool(a) and bool(b)),
    ca.OP_OR: lambda a, b: mpmath.mpf(bool(a) or bool(b)),
    ca.OP_IF_ELSE_ZERO: lambda a, b: b if a else mpmath.mpf(0),
}


def evaluated(arguments, values, numbers, digits=40):
    """The entries of `values` (SX, over the SX columns `arguments`) where these have the given
    `numbers`, with many digits: a list of numbers for each value."""
    function = ca.Function("terms", arguments, [ca.densify(ca.SX(v)) for v in values])
    with mpmath.workdps(digits):
        return run(
            listing(function),
            entry=lambda argument, nonzero: mpmath.mpf(numbers[argument][nonzero]),
            number=mpmath.mpf,
            operation=_applied,
        )


def _applied(read, operands):
    return (UNARY if len(operands) == 1 else BINARY)[read.code](*operands)
