"""Planted errors: systems and functions with one thing wrong, to see that the suite goes red for
each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca

from derive.expressions.instructions import Instruction, Listing, listing, run
from derive.formulations.records import Equations, Function
from derive.mechanics.records import System

SWAPPED = {
    ca.OP_ADD: ca.OP_SUB, ca.OP_SUB: ca.OP_ADD, ca.OP_MUL: ca.OP_DIV, ca.OP_DIV: ca.OP_MUL,
    ca.OP_SIN: ca.OP_COS, ca.OP_COS: ca.OP_SIN, ca.OP_SQ: ca.OP_TWICE, ca.OP_TWICE: ca.OP_SQ,
}  # fmt: skip
LEAVES = (ca.OP_CONST, ca.OP_INPUT)


def wrong_systems(system: System) -> Iterator[tuple[str, System]]:
    """(what is wrong, the system with it): one per term of the equations, where the model has the
    term."""
    still = ca.substitute(system.h, system.v, ca.SX.zeros(system.v.numel()))
    errors = {
        "gravity": ("h", system.h - 2 * _one_entry(still)),
        "velocity products": ("h", system.h - 2 * _one_entry(system.h - still)),
        "applied force": ("Q", system.Q - 2 * _one_entry(system.Q)),
        "mass": ("M", _with_first(system.M, 1.001)),
        "mass on one side": ("M", _with_one(system.M, 1.001)),
        "negative mass": ("M", -system.M),
        "kinematics": ("N", -system.N),
        "rates": ("qdot", _with_first(system.qdot, -1.0)),
        "position": (
            "phi",
            system.phi + _one_entry(0.001 * system.phi * system.q[0])
            if system.phi.numel()
            else system.phi,
        ),
        "constraint row": ("A", _with_first(system.A, -1.0)),
        "constraint value": ("c", -system.c),
        "constraint drift": ("beta", system.beta - 2 * _one_entry(system.beta)),
        "kinetic energy": ("T", 1.001 * system.T),
        "potential energy": ("V", -system.V),
        "power": ("power", -system.power),
    }
    for name, (term, value) in errors.items():
        if not _same(value, getattr(system, term)):
            yield name, replace(system, **{term: value})


def _one_entry(column: ca.SX) -> ca.SX:
    """The column with all but its first nonzero entry left out."""
    places = [i for i in range(column.numel()) if not ca.SX(column[i]).is_zero()]
    result = ca.SX.zeros(column.numel())
    if places:
        result[places[0]] = column[places[0]]
    return result


def _with_first(matrix: ca.SX, factor: float) -> ca.SX:
    """The matrix with its first nonzero entry multiplied."""
    result = ca.SX(matrix)
    for i in range(result.size1()):
        for j in range(result.size2()):
            if not ca.SX(result[i, j]).is_zero():
                result[i, j] = factor * result[i, j]
                return result
    return result


def _with_one(matrix: ca.SX, factor: float) -> ca.SX:
    """The matrix with one entry above the diagonal multiplied."""
    result = ca.SX(matrix)
    for i in range(result.size1()):
        for j in range(i + 1, result.size2()):
            if not ca.SX(result[i, j]).is_zero():
                result[i, j] = factor * result[i, j]
                return result
    return result


def _same(a: ca.SX, b: ca.SX) -> bool:
    return ca.SX(a - b).is_zero()


def wrong_matrices(equations: Equations) -> Iterator[tuple[str, Equations]]:
    """The equations with every entry of one shown matrix (S, R, B, …) off by 1e-6."""
    for item in equations.named:
        wrong = replace(item, value=ca.densify(item.value) + 1e-6)
        yield (
            item.name,
            replace(
                equations, named=tuple(wrong if x.name == item.name else x for x in equations.named)
            ),
        )


def wrong_functions(equations: Equations, name: str) -> Iterator[tuple[str, Equations]]:
    """The equations with one operation of one function changed: + for −, × for ÷, sine for cosine,
    x² for 2 x."""
    function = equations.function(name)
    for index, wrong in mutants(function.result.value):
        changed = replace(function, result=replace(function.result, value=wrong))
        yield f"{name}, instruction {index}", _with_function(equations, changed)


def _with_function(equations: Equations, changed: Function) -> Equations:
    functions = tuple(
        changed if function.name == changed.name else function for function in equations.functions
    )
    return replace(equations, functions=functions)


def mutants(value: ca.SX) -> Iterator[tuple[int, ca.SX]]:
    """(instruction index, the expression with that operation swapped), for every operation that has
    a counterpart."""
    tape = recorded(value)
    for index, step in enumerate(tape.program.instructions):
        if step.code in SWAPPED:
            yield index, tape.replayed(index, _swapped)


@dataclass(frozen=True)
class Change:
    """One thing that can be wrong in an expression; the expression with it is made when it is asked
    for."""

    about: str
    made: Callable[[], ca.SX]


def changes(value: ca.SX) -> list[Change]:
    """Everything that can be wrong: an operation swapped, its sign, a term left out of a sum; an
    entry's sign or size."""
    tape = recorded(value)
    result = [
        Change(f"operation {index}: {about}", partial(tape.replayed, index, change))
        for index, step in enumerate(tape.program.instructions)
        for about, change, operations in _OPERATIONS
        if step.code in operations
        or (operations == () and step.code not in (*LEAVES, ca.OP_ASSIGN))
    ]
    places = [k for k in range(value.numel()) if not ca.SX(value[k]).is_zero()]
    return result + [
        Change(f"entry {k} {about}", partial(_with_entry, value, k, factor))
        for k in places
        for about, factor in _ENTRY
    ]


def _swapped(operation: int, operands: list[ca.SX]) -> ca.SX:
    return _applied(SWAPPED[operation], operands)


def _negated(operation: int, operands: list[ca.SX]) -> ca.SX:
    return -_applied(operation, operands)


def _shortened(operation: int, operands: list[ca.SX]) -> ca.SX:
    return operands[0]


_OPERATIONS = (
    ("swapped", _swapped, tuple(SWAPPED)),
    ("negated", _negated, ()),
    ("second term left out", _shortened, (ca.OP_ADD, ca.OP_SUB)),
)
_ENTRY = (("negated", -1.0), ("left out", 0.0), ("too large by 1/1000", 1.001))


def _with_entry(value: ca.SX, place: int, factor: float) -> ca.SX:
    result = ca.SX(value)
    result[place] = factor * result[place]
    return result


@dataclass(frozen=True)
class Tape:
    """An expression as the instructions that evaluate it, to be replayed with one of them
    changed."""

    symbols: ca.SX
    program: Listing
    rows: int
    columns: int

    def replayed(self, wrong: int, change: Callable[[int, list[ca.SX]], ca.SX]) -> ca.SX:
        """The expression rebuilt instruction by instruction, number `wrong` changed."""
        changed = self.program.instructions[wrong]

        def operation(read: Instruction, operands: list[ca.SX]) -> ca.SX:
            return (change if read is changed else _applied)(read.code, operands)

        (entries,) = run(
            self.program,
            entry=lambda _, nonzero: self.symbols[nonzero],
            number=ca.SX,
            operation=operation,
        )
        return ca.reshape(ca.vertcat(ca.SX(0, 1), *entries), self.rows, self.columns)


def recorded(value: ca.SX) -> Tape:
    """The instructions of an expression over the symbols in it, so that one of them can be made
    wrong."""
    symbols = ca.vertcat(*ca.symvar(value))
    program = listing(ca.Function("program", [symbols], [ca.densify(value)]))
    return Tape(symbols, program, value.size1(), value.size2())


def _applied(operation: int, operands: list[ca.SX]) -> ca.SX:
    return (
        ca.SX.unary(operation, *operands)
        if len(operands) == 1
        else ca.SX.binary(operation, *operands)
    )
