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
    )


def show(record: Explained, console: Console) -> None:
    """What was chosen, what has to stay away from zero, operations, and the ledger of the
    passes."""
    console.print(
        f"{record.model}, choice {record.choice} ({listed(record.quasi_velocities)}): "
        f"{record.reason}"
    )
    for pivot in record.pivots:
        console.print(f"pivot: {pivot}")
    for assumption in record.assumptions:
        console.print(f"assumed: {assumption}")
    console.print(f"operations: {operations(record.operations)}")
    ledger(record.ledger, record.left_out, console)
