"""The way from one point to another where both are counted from the ground: what is constant in
both is taken together first.

Of two points 40 m away a gap has two digits less than one of two points near by. Where links come
to lie in a line, rates are quotients of such gaps, and the digits that are left decide whether a
motion finds its way across.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from derive.expressions.scalars import Scalar, Vector
from derive.mechanics.limits import LONG_SUM


def gap(first: Vector, second: Vector, parameters: ca.SX) -> Vector:
    """second − first, entry by entry, in m; `parameters` are symbols that do not move."""
    known = frozenset(parameters[i].element_hash() for i in range(parameters.numel()))
    return [_difference(Sum(known), y, x) for x, y in zip(first, second)]


@dataclass
class Sum:
    """Terms of a sum: those that move, with their signs, and of what is constant how often each
    parameter occurs, by its hash (0 stands for the number one)."""

    known: frozenset[int]
    moving: list[tuple[float, ca.SX]] = field(default_factory=list[tuple[float, ca.SX]])
    constant: dict[int, tuple[float, ca.SX]] = field(default_factory=dict[int, tuple[float, ca.SX]])

    def add(self, sign: float, whole: ca.SX) -> bool:
        """Takes the terms of sign · `whole`. Returns whether there were at most LONG_SUM nodes of
        them, and some are constant and some move; else the sum is of no use."""
        open_terms, before, constants = [(sign, whole)], len(self.moving), 0
        for _ in range(LONG_SUM):
            if not open_terms:
                return constants > 0 and len(self.moving) > before
            factor, term = open_terms.pop()
            if term.is_op(ca.OP_NEG):
                open_terms.append((-factor, term.dep(0)))
            elif term.is_op(ca.OP_ADD) or term.is_op(ca.OP_SUB):
                second = -factor if term.is_op(ca.OP_SUB) else factor
                open_terms += [(second, term.dep(1)), (factor, term.dep(0))]
            elif self._is_constant(factor, term):
                constants += 1
            else:
                self.moving.append((factor, term))
        return False

    def _is_constant(self, factor: float, term: ca.SX) -> bool:
        """Takes a number, a parameter, or the product of both."""
        number, symbol = 1.0, term
        if term.is_constant():
            number, symbol = float(term), ca.SX(1.0)
        elif term.is_op(ca.OP_MUL) and term.dep(0).is_constant():
            number, symbol = float(term.dep(0)), term.dep(1)
        elif term.is_op(ca.OP_MUL) and term.dep(1).is_constant():
            number, symbol = float(term.dep(1)), term.dep(0)
        key = 0 if symbol.is_constant() else symbol.element_hash()
        if key and not (symbol.is_symbolic() and key in self.known):
            return False
        self.constant[key] = (self.constant.get(key, (0.0, symbol))[0] + factor * number, symbol)
        return True

    def total(self) -> ca.SX:
        """What moves, then what is constant."""
        result = ca.SX(0.0)
        for factor, term in self.moving:
            result = result + term if factor > 0 else result - term
        for number, symbol in self.constant.values():
            result += number * symbol
        return result


def _difference(terms: Sum, minuend: Scalar, subtrahend: Scalar) -> Scalar:
    """With the constants of both in one sum where both have some besides what moves."""
    ends = (1.0, ca.SX(minuend)), (-1.0, ca.SX(subtrahend))
    told = [terms.add(sign, end) for sign, end in ends]
    return terms.total() if all(told) else minuend - subtrahend
