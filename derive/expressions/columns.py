"""A function of CasADi at many places at once: each of its operations for all places, on columns.

CasADi's own map runs the whole program for one place after the other, which takes five to ten times
as long from some hundred places on; and what comes out here stands as columns, too.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from derive.expressions.instructions import ended, listing

AT_ONCE = 1024  # places: their columns stay in the fast memory of a core
KNOWN = 64  # functions that are remembered


def _erf(x: np.ndarray) -> np.ndarray:
    return np.array([math.erf(value) for value in np.ravel(x)]).reshape(np.shape(x))


def _remainder(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    x, y = np.broadcast_arrays(x, y)
    pairs = [(a, b) if b and math.isfinite(a) else (math.nan, 1.0) for a, b in zip(x.flat, y.flat)]
    return np.array([math.remainder(*pair) for pair in pairs]).reshape(x.shape)


def _twice(x: np.ndarray) -> np.ndarray:
    return x + x


def _inverse(x: np.ndarray) -> np.ndarray:
    return np.divide(1.0, x)


def _where(holds: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.where(np.not_equal(holds, 0.0), x, 0.0)


def _number(function: Callable[..., Any]) -> Callable[..., Any]:
    """One where it holds, zero elsewhere."""
    return lambda *operands: np.where(function(*operands), 1.0, 0.0)


OPERATIONS: dict[int, Callable[..., Any]] = {
    **{ca.OP_ASSIGN: np.positive, ca.OP_ADD: np.add, ca.OP_SUB: np.subtract},
    **{ca.OP_MUL: np.multiply, ca.OP_DIV: np.divide, ca.OP_NEG: np.negative},
    **{ca.OP_SQ: np.square, ca.OP_TWICE: _twice, ca.OP_INV: _inverse},
    **{ca.OP_POW: np.power, ca.OP_CONSTPOW: np.power, ca.OP_SQRT: np.sqrt},
    **{ca.OP_EXP: np.exp, ca.OP_LOG: np.log, ca.OP_EXPM1: np.expm1, ca.OP_LOG1P: np.log1p},
    **{ca.OP_SIN: np.sin, ca.OP_COS: np.cos, ca.OP_TAN: np.tan},
    **{ca.OP_ASIN: np.arcsin, ca.OP_ACOS: np.arccos, ca.OP_ATAN: np.arctan},
    **{ca.OP_SINH: np.sinh, ca.OP_COSH: np.cosh, ca.OP_TANH: np.tanh},
    **{ca.OP_ASINH: np.arcsinh, ca.OP_ACOSH: np.arccosh, ca.OP_ATANH: np.arctanh},
    **{ca.OP_ATAN2: np.arctan2, ca.OP_HYPOT: np.hypot, ca.OP_ERF: _erf},
    **{ca.OP_FABS: np.fabs, ca.OP_SIGN: np.sign, ca.OP_COPYSIGN: np.copysign},
    **{ca.OP_FLOOR: np.floor, ca.OP_CEIL: np.ceil, ca.OP_FMOD: np.fmod},
    **{ca.OP_FMIN: np.fmin, ca.OP_FMAX: np.fmax, ca.OP_REMAINDER: _remainder},
    **{ca.OP_LT: _number(np.less), ca.OP_LE: _number(np.less_equal)},
    **{ca.OP_EQ: _number(np.equal), ca.OP_NE: _number(np.not_equal)},
    **{ca.OP_AND: _number(np.logical_and), ca.OP_OR: _number(np.logical_or)},
    **{ca.OP_NOT: _number(np.logical_not)},
    ca.OP_IF_ELSE_ZERO: _where,
}


class Columns:
    """An SX function with dense results."""

    def __init__(self, function: ca.Function) -> None:
        self.function = function
        self._shapes = [
            (function.size2_out(i), function.size1_out(i)) for i in range(function.n_out())
        ]
        program = listing(function)
        self._outputs = program.outputs
        read = program.instructions
        self._start = [np.float64(x.number) if x.code == ca.OP_CONST else None for x in read]
        self._entries = [(k, *x.entry) for k, x in enumerate(read) if x.code == ca.OP_INPUT]
        self._steps = [
            (k, OPERATIONS[x.code], x.operands, dead)
            for k, (x, dead) in enumerate(zip(read, ended(program)))
            if x.code not in (ca.OP_CONST, ca.OP_INPUT)
        ]

    def __call__(self, *arguments: np.ndarray) -> list[np.ndarray]:
        """The results, rows × columns × k each, for arguments width × k; one with a single column
        is the same at all places."""
        k = max(x.shape[1] for x in arguments)
        results = [np.empty((*shape, k)) for shape in self._shapes]
        with np.errstate(all="ignore"):
            for first in range(0, k, AT_ONCE):
                part = slice(first, first + AT_ONCE)
                here = [x[:, part] if x.shape[1] > 1 else x for x in arguments]
                for result, values in zip(results, self._values(here)):
                    rows = result.reshape(len(values), k)
                    for row, value in zip(rows, values):
                        row[part] = value
        return [result.transpose(1, 0, 2) for result in results]

    def _values(self, arguments: list[np.ndarray]) -> list[list[Any]]:
        """The columns of all entries. What is not used any more is let go, and its memory taken for
        the next."""
        values: list[Any] = self._start.copy()
        for k, argument, entry in self._entries:
            values[k] = arguments[argument][entry]
        for k, operation, operands, dead in self._steps:
            values[k] = operation(*[values[i] for i in operands])
            for i in dead:
                values[i] = None
        return [[values[k] for k in output] for output in self._outputs]


_known: dict[int, Columns] = {}
_lock = threading.Lock()


def columns_of(function: ca.Function) -> Columns:
    """Made once. It holds on to the function, so that no other one is of its number meanwhile."""
    number = hash(function)
    with _lock:
        if number not in _known:
            while len(_known) >= KNOWN:
                _known.pop(next(iter(_known)))
            _known[number] = Columns(function)
        return _known[number]
