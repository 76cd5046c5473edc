"""Gradients of potentials that are one-sided, such as ½ k max(0, z)².

The derivative of max(0, z) is a step, and max(0, z) times the step is max(0, z) again. CasADi keeps
the step, a comparison and a division that change nothing; where a derivative by max(0, z) vanishes
with it, it is left out here.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from derive.expressions.instructions import Instruction, Listing, listing, run

OF_TWO = (ca.OP_FMAX, ca.OP_FMIN)


@dataclass
class _Sides:
    """Symbols that stand for max(0, z) or min(0, z): which of them, what that is, and z, over the
    symbols before."""

    codes: list[int] = field(default_factory=list[int])
    symbols: list[ca.SX] = field(default_factory=list[ca.SX])
    meant: list[ca.SX] = field(default_factory=list[ca.SX])
    inside: list[ca.SX] = field(default_factory=list[ca.SX])

    def named(self, read: Instruction, operands: list[ca.SX]) -> ca.SX:
        """The value of an operation: a new symbol where it is one-sided."""
        if len(operands) == 1:
            return ca.SX.unary(read.code, *operands)
        value = ca.SX.binary(read.code, *operands)
        given = [x for x in operands if not x.is_zero()]
        if read.code not in OF_TWO or len(given) != 1 or value.is_constant():
            return value
        self.codes.append(read.code)
        self.symbols.append(ca.SX.sym(f"side{len(self.symbols)}"))
        self.meant.append(value)
        self.inside.append(given[0])
        return self.symbols[-1]


def gradient(value: ca.SX, by: ca.SX) -> ca.SX:
    """∂value/∂by of a scalar, as a column; without steps that change nothing."""
    symbols = ca.vertcat(*ca.symvar(ca.vertcat(by, value)))
    program = listing(ca.Function("value", [symbols], [ca.densify(value)]))
    if not any(read.code in OF_TWO for read in program.instructions):
        return ca.gradient(value, by)
    sides = _Sides()
    whole = _rebuilt(program, symbols, sides)
    if not sides.symbols:
        return ca.gradient(value, by)
    result = ca.densify(ca.gradient(whole, by))
    every = ca.vertcat(*sides.symbols)
    slopes = ca.vertsplit(ca.densify(ca.gradient(whole, every)))
    levels = _levels(sides, every)
    for level in levels:
        z = ca.vertcat(*[sides.inside[k] for k in level])
        through = ca.vertcat(*[slopes[k] * _step(sides, k, slopes[k]) for k in level])
        result += ca.jtimes(z, by, through, True)
        further = ca.vertsplit(ca.densify(ca.jtimes(z, every, through, True)))
        slopes = [slope + more for slope, more in zip(slopes, further)]
    for level in levels:
        symbols_of, meant = ([x[k] for k in level] for x in (sides.symbols, sides.meant))
        result = ca.substitute(result, ca.vertcat(*symbols_of), ca.vertcat(*meant))
    return result


def _levels(sides: _Sides, every: ca.SX) -> list[list[int]]:
    """Sides that do not stand in each other together, before those that stand in them."""
    within = ca.jacobian_sparsity(ca.vertcat(*sides.inside), every)
    depth = [0] * len(sides.symbols)
    for k, other in sorted(zip(*within.get_triplet())):
        depth[k] = max(depth[k], depth[other] + 1)
    deepest = range(max(depth), -1, -1)
    return [[k for k, d in enumerate(depth) if d == level] for level in deepest]


def _rebuilt(program: Listing, symbols: ca.SX, sides: _Sides) -> ca.SX:
    ((value,),) = run(
        program,
        entry=lambda _, place: symbols[place],
        number=ca.SX,
        operation=sides.named,
    )
    return value


def _step(sides: _Sides, k: int, slope: ca.SX) -> ca.SX:
    """The derivative of max(0, z) by z; one where what it is multiplied by vanishes with
    max(0, z)."""
    symbol = sides.symbols[k]
    if ca.substitute(slope, symbol, ca.SX(0)).is_zero():
        return ca.SX(1)
    z = ca.SX.sym("z")
    slope_of_side = ca.gradient(ca.SX.binary(sides.codes[k], ca.SX(0), z), z)
    return ca.substitute(slope_of_side, z, sides.inside[k])
