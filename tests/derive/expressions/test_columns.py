"""A function of CasADi on columns gives what CasADi gives, operation by operation.

Of derive.expressions: columns.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.expressions.columns import AT_ONCE, OPERATIONS, columns_of

X, Y = ca.SX.sym("x"), ca.SX.sym("y")
UNARY = [
    ca.sin, ca.cos, ca.tan, ca.asin, ca.acos, ca.atan, ca.sinh, ca.cosh, ca.tanh, ca.asinh,
    ca.acosh, ca.atanh, ca.exp, ca.log, ca.expm1, ca.log1p, ca.erf, ca.sqrt, ca.fabs, ca.sign,
    ca.floor, ca.ceil, ca.logic_not, lambda x: -x, lambda x: x * x, lambda x: x + x,
    lambda x: 1 / x, lambda x: x**3.5,
]  # fmt: skip
BINARY = [
    ca.atan2, ca.hypot, ca.fmin, ca.fmax, ca.fmod, ca.copysign, ca.remainder, ca.logic_and,
    ca.logic_or, lambda x, y: x + y, lambda x, y: x - y, lambda x, y: x * y, lambda x, y: x / y,
    lambda x, y: x**y, lambda x, y: x < y, lambda x, y: x <= y, lambda x, y: x == y,
    lambda x, y: x != y, lambda x, y: ca.if_else(x < y, x, y),
]  # fmt: skip
VALUES = np.array([-2.5, -1.0, -0.3, 0.0, 0.4, 0.7, 1.0, 2.5])


@pytest.mark.parametrize("made", [f(X) for f in UNARY] + [f(X, Y) for f in BINARY], ids=str)
def test_every_operation(made: ca.SX) -> None:
    function = ca.Function("f", [X, Y], [ca.densify(made)])
    x, y = (side.reshape(1, -1) for side in np.meshgrid(VALUES, VALUES))
    wanted = function(x, y).full()
    found = columns_of(function)(x, y)[0][0]
    np.testing.assert_allclose(found, wanted, rtol=1e-14, atol=1e-15)


def test_the_table_has_all_that_casadi_makes_of_numbers() -> None:
    """But what is no operation on numbers."""
    codes = {name: getattr(ca, name) for name in dir(ca) if name.startswith("OP_")}
    first, last = codes["OP_ASSIGN"], codes["OP_ERF"]
    missing = {n for n, code in codes.items() if first <= code <= last and code not in OPERATIONS}
    assert missing <= {"OP_CONST", "OP_INPUT", "OP_OUTPUT", "OP_PARAMETER", "OP_CALL", "OP_FIND"}


def test_matrices_constants_and_more_places_than_at_once() -> None:
    p = ca.SX.sym("p", 3)
    results = [ca.densify(ca.blockcat([[X, p[0], 2.0], [Y * p[2], 0.0, X]])), ca.SX.ones(1)]
    function = ca.Function("f", [X, Y, p], results)
    k = 2 * AT_ONCE + 7
    rng = np.random.default_rng(0)
    x, y, q = (rng.standard_normal((n, k)) for n in (1, 1, 3))
    matrix, one = columns_of(function)(x, y[:, :1], q)
    assert matrix.shape == (2, 3, k) and (one == 1.0).all()
    assert (matrix[0, 0] == x[0]).all() and (matrix[1, 0] == y[0, 0] * q[2]).all()
    assert (matrix[0, 2] == 2.0).all() and (matrix[1, 1] == 0.0).all()


def test_it_is_made_once_and_never_another_one() -> None:
    """A function that takes the place of one that is gone has columns of its own."""
    for value in range(200):
        function = ca.Function("f", [X], [X + value])
        assert columns_of(function) is columns_of(function)
        assert columns_of(function)(np.zeros((1, 1)))[0][0, 0, 0] == value
        del function
