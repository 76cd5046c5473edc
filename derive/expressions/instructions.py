"""The straight-line program that CasADi runs a function as, read in one place.

CasADi reuses the places of its workspace. Here every instruction has a result of its own, known by
its number, so that whoever rewrites, counts or evaluates the program need not follow what is
overwritten.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import casadi as ca

Value = TypeVar("Value")


class Instruction(NamedTuple):  # there are many: a frozen dataclass takes twice as long
    """`code` is CasADi's operation, `operands` are the numbers of the instructions it works on.

    An input (OP_INPUT) has its place in `entry`: the argument and the nonzero of it; a constant
    (OP_CONST) its value in `number`.
    """

    code: int
    operands: tuple[int, ...] = ()
    entry: tuple[int, int] = (0, 0)
    number: float = 0.0


@dataclass(frozen=True)
class Listing:
    """Instructions, operands before what is made of them; `outputs` has for every nonzero of every
    result the number of the instruction it comes from."""

    instructions: tuple[Instruction, ...]
    outputs: tuple[tuple[int, ...], ...]


def listing(function: ca.Function) -> Listing:
    """The program of an SX function, each instruction with a result of its own: CasADi's workspace
    is renamed to single assignment."""
    outputs = [[0] * function.nnz_out(i) for i in range(function.n_out())]
    instructions: list[Instruction] = []
    places: dict[int, int] = {}  # by place in CasADi's workspace: who wrote it last
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        target = function.instruction_output(k)
        if code == ca.OP_OUTPUT:
            outputs[target[0]][target[1]] = places[function.instruction_input(k)[0]]
            continue
        if code == ca.OP_CONST:
            read = Instruction(code, number=function.instruction_constant(k))
        elif code == ca.OP_INPUT:
            argument, nonzero = function.instruction_input(k)
            read = Instruction(code, entry=(argument, nonzero))
        else:
            sources = function.instruction_input(k)
            read = Instruction(code, tuple([places[source] for source in sources]))
        places[target[0]] = len(instructions)
        instructions.append(read)
    return Listing(tuple(instructions), tuple(map(tuple, outputs)))


def run(
    program: Listing,
    entry: Callable[[int, int], Value],
    number: Callable[[float], Value],
    operation: Callable[[Instruction, list[Value]], Value],
) -> list[list[Value]]:
    """The outputs of the program in any kind of values.

    `entry` gives the value of a nonzero of an argument, `number` that of a constant, `operation`
    that of an instruction on its operands. Values are let go after their last use.
    """
    dead = ended(program)
    values: dict[int, Value] = {}
    for k, read in enumerate(program.instructions):
        if read.code == ca.OP_INPUT:
            values[k] = entry(*read.entry)
        elif read.code == ca.OP_CONST:
            values[k] = number(read.number)
        else:
            values[k] = operation(read, [values[operand] for operand in read.operands])
        for ended_one in dead[k]:
            del values[ended_one]
    return [[values[k] for k in output] for output in program.outputs]


def ended(program: Listing) -> list[tuple[int, ...]]:
    """For every instruction the results that nobody uses after it, its own if nobody ever does."""
    last = _last_uses(program)
    return [
        tuple(i for i in {*read.operands, k} if last[i] <= k)
        for k, read in enumerate(program.instructions)
    ]


def _last_uses(program: Listing) -> list[int]:
    """For every instruction the number of the last one that uses its result; past the end for
    outputs."""
    last = [-1] * len(program.instructions)
    for k, read in enumerate(program.instructions):
        for operand in read.operands:
            last[operand] = k
    for output in program.outputs:
        for k in output:
            last[k] = len(program.instructions)
    return last
