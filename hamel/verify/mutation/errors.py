"""Planted errors: systems and functions with one thing wrong, to see that the suite goes red for
each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca
import numpy as np

from derive.expressions.instructions import Instruction, Listing, listing, run
from derive.formulations.records import Equations, Function
from derive.mechanics.records import System
from derive.states.sampling import States, states

SWAPPED = {
    ca.OP_ADD: ca.OP_SUB, ca.OP_SUB: ca.OP_ADD, ca.OP_MUL: ca.OP_DIV, ca.OP_DIV: ca.OP_MUL,
    ca.OP_SIN: ca.OP_COS, ca.OP_COS: ca.OP_SIN, ca.OP_SQ: ca.OP_TWICE, ca.OP_TWICE: ca.OP_SQ,
}  # fmt: skip
LEAVES = (ca.OP_CONST, ca.OP_INPUT)
DRAWS = 3  # of admissible states, at which entries are looked at
ROUNDING = 1e-10  # an entry below this at all of them is rounding


@dataclass(frozen=True)
class _Seen:
    """Admissible states, which tell what of a term is more than rounding."""

    system: System
    states: States

    def entries(self, matrix: ca.SX) -> list[tuple[int, int]]:
        """Places of what is more than rounding, row by row: an error in rounding is none."""
        s, found = self.system, self.states
        at = ca.Function("entries", [s.t, s.q, s.v, s.u, s.p], [ca.densify(matrix)])
        rows = [np.array(at(*row)) for row in zip(found.t, found.q, found.v, found.u, found.p)]
        sizes = np.max([np.nan_to_num(np.abs(row), nan=np.inf) for row in rows], axis=0)
        return [(int(i), int(j)) for i, j in np.argwhere(sizes > ROUNDING)]


def wrong_systems(system: System) -> Iterator[tuple[str, System]]:
    """(what is wrong, the system with it): one per term of the equations, where the model has the
    term."""
    seen = _Seen(system, states(system, DRAWS))
    still = ca.substitute(system.h, system.v, ca.SX.zeros(system.v.numel()))
    errors = {
        "gravity": ("h", system.h - 2 * _one_entry(seen, still)),
        "velocity products": ("h", system.h - 2 * _one_entry(seen, system.h - still)),
        "applied force": ("Q", system.Q - 2 * _one_entry(seen, system.Q)),
        "mass": ("M", _with_first(seen, system.M, 1.001)),
        "mass on one side": ("M", _with_one(seen, system.M, 1.001)),
        "negative mass": ("M", -system.M),
        "kinematics": ("N", -system.N),
        "rates": ("qdot", _with_first(seen, system.qdot, -1.0)),
        "position": (
            "phi",
            system.phi + _first_row(0.001 * system.phi * system.q[0])
            if system.phi.numel()
            else system.phi,
        ),
        "constraint row": ("A", _with_first(seen, system.A, -1.0)),
        "constraint value": ("c", _negative(seen, system.c)),
        "constraint drift": ("beta", system.beta - 2 * _one_entry(seen, system.beta)),
        "kinetic energy": ("T", 1.001 * system.T),
        "potential energy": ("V", -system.V),
        "power": ("power", _negative(seen, system.power)),
    }
    for name, (term, value) in errors.items():
        if not _same(value, getattr(system, term)):
            yield name, replace(system, **{term: value})


def _first_row(column: ca.SX) -> ca.SX:
    """The column with all but its first entry left out."""
    return ca.vertcat(column[0], ca.SX.zeros(column.numel() - 1))


def _one_entry(seen: _Seen, column: ca.SX) -> ca.SX:
    """The column with all but its first entry left out that is more than rounding."""
    result = ca.SX.zeros(column.numel())
    for i, j in seen.entries(column)[:1]:
        result[i, j] = column[i, j]
    return result


def _negative(seen: _Seen, matrix: ca.SX) -> ca.SX:
    """The matrix with its sign changed, where it is more than rounding."""
    return -matrix if seen.entries(matrix) else matrix


def _with_first(seen: _Seen, matrix: ca.SX, factor: float) -> ca.SX:
    """The matrix with its first entry multiplied."""
    return _multiplied(matrix, seen.entries(matrix), factor)


def _with_one(seen: _Seen, matrix: ca.SX, factor: float) -> ca.SX:
    """The matrix with one entry above the diagonal multiplied."""
    return _multiplied(matrix, [(i, j) for i, j in seen.entries(matrix) if i < j], factor)


def _multiplied(matrix: ca.SX, places: Sequence[tuple[int, int]], factor: float) -> ca.SX:
    result = ca.SX(matrix)
    for i, j in places[:1]:
        result[i, j] = factor * result[i, j]
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
    symbols = ca.vertcat(ca.SX(0, 1), *ca.symvar(ca.SX(value)))  # a constant has none
    program = listing(ca.Function("program", [symbols], [ca.densify(value)]))
    return Tape(symbols, program, value.size1(), value.size2())


def _applied(operation: int, operands: list[ca.SX]) -> ca.SX:
    return (
        ca.SX.unary(operation, *operands)
        if len(operands) == 1
        else ca.SX.binary(operation, *operands)
    )
