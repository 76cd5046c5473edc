"""build: derive, emit, compile and quickly verify a module; the folder appears only when all of that went well."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from hamel.pipeline import MARK, Clock, Constants, emit, equations_of, load_module, program_of
from hamel.records import Built
from hamel.staging import staged_folder

if TYPE_CHECKING:
    from rich.console import Console

    from derive.formulations.records import Equations


def run(
    path: str | Path,
    choice: str | None,
    out: str | Path | None,
    constants: Constants,
    functions: Collection[str] | None,
    formulation: str,
    states: int,
) -> Built:
    clock = Clock()
    equations = equations_of(path, choice, constants, formulation, clock)
    name = equations.system.model.name
    folder = Path(out) if out else Path("generated") / name
    program = program_of(equations, functions, clock)
    with staged_folder(folder, MARK) as made:
        emit(program, made, _pages(equations, clock), clock)
        _confirm(equations, made, states, clock)
    return Built(
        model=name,
        choice=equations.choice,
        reason=equations.reason,
        folder=folder,
        verified=True,
        operations={kernel.name: kernel.operations["total"] for kernel in program.kernels},
        seconds=clock.seconds,
        quasi_velocities=program.quasi_velocities,
        left_out=program.left_out,
        ledger=tuple(asdict(entry) for entry in program.ledger),
        compiled=True,
    )


def _pages(equations: Equations, clock: Clock) -> dict[str, str]:
    with clock("textbook"):
        from derive.textbook import html

        return {"derivation.html": html(equations)}


def _confirm(equations: Equations, folder: Path, states: int, clock: Clock) -> None:
    """Raise VerificationError unless the compiled module agrees with the independent derivation."""
    with clock("verify"):
        from hamel.verify import verification

        module = load_module(folder)
        found = verification(equations.system.model, equations, module, states=states)
    refuse(found.checks, f"the module of {equations.system.model.name}, choice {equations.choice}, is not written")


def refuse(checks: Collection, consequence: str) -> None:
    """Raise VerificationError naming the checks that fail, if any."""
    failed = [check for check in checks if not check.passed]
    if failed:
        from derive.diagnostics import VerificationError

        lines = "; ".join(f"{check.name}: {check.value:.2g} exceeds {check.tolerance:.2g}" for check in failed)
        raise VerificationError(f"verification failed, {consequence}: {lines}")


def show(record: Built, console: Console) -> None:
    from hamel.show import durations, operations

    console.print(f"{record.model}: built and verified {record.folder}")
    console.print(f"  choice      {record.choice} ({', '.join(record.quasi_velocities)}): {record.reason}")
    console.print(f"  operations  {operations(record.operations)}")
    console.print(f"  time        {durations(record.seconds)}")


def explain(record: Built, console: Console) -> None:
    """What `build --explain` adds: the ledger of the passes and what was left out."""
    from hamel.show import ledger

    ledger(record.ledger, record.left_out, console)
