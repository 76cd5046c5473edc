"""explain: why the module of a choice looks as it does."""

from __future__ import annotations

from dataclasses import asdict
from os import PathLike
from typing import TYPE_CHECKING

from derive.diagnostics import listed
from hamel.build.options import Constants
from hamel.build.stages import equations_of, program_of
from hamel.records import Explained
from hamel.show import ledger, operations

if TYPE_CHECKING:
    from rich.console import Console


def run(path: str | PathLike[str], choice: str | None, constants: Constants) -> Explained:
    """The reason for the choice, its pivots, and what each pass did to the number of operations.
    The program is made, but nothing is emitted or compiled."""
    equations = equations_of(path, choice, constants)
    program = program_of(equations)
    return Explained(
        model=program.name,
        choice=program.choice,
        reason=program.reason,
        pivots=program.pivots,
        quasi_velocities=program.quasi_velocities,
        operations={kernel.name: kernel.operations["total"] for kernel in program.kernels},
        ledger=tuple(asdict(entry) for entry in program.ledger),
        left_out=program.left_out,
        assumptions=program.assumptions,
        rolling=dict(program.rolling),
    )


def advice(record: Explained) -> str:
    """Whether this choice can be used everywhere, and what to do where it cannot."""
    varying = [pivot for pivot in record.pivots if "varies" in pivot]
    if not record.pivots:
        return "Nothing has to be eliminated: it can be used everywhere."
    if not varying:
        return "No pivot can vanish: it can be used everywhere."
    return (
        f"{len(varying)} of {len(record.pivots)} pivots can vanish, and the module reports where "
        "one does; 'hamel choices' compares others, and a+b takes two of them as charts."
    )


def show(record: Explained, console: Console) -> None:
    """What was chosen, what has to stay away from zero, operations, and the ledger of the
    passes."""
    console.print(
        f"{record.model} moves with the quasi-velocities {listed(record.quasi_velocities)}, choice "
        f"'{record.choice}': {record.reason}"
    )
    console.print(advice(record))
    for pivot in record.pivots:
        console.print(f"pivot: {pivot}")
    for assumption in record.assumptions:
        console.print(f"assumed: {assumption}")
    console.print(f"operations: {operations(record.operations)}")
    ledger(record, console)
