"""build: derive, emit, compile and quickly verify a module; the folder appears only when all of that went well."""

from __future__ import annotations

import tempfile
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from codegen.compiler import INSTALL
from derive.diagnostics import ToolchainError, VerificationError
from derive.textbook import html
from hamel.meanwhile import meanwhile
from hamel.pipeline import Clock, Constants, emit, equations_of, load_quietly, program_of
from hamel.records import Built
from hamel.verify import quick_verification

if TYPE_CHECKING:
    from rich.console import Console

    from codegen.build import Built as MadeFolder
    from codegen.program import Program
    from derive.formulations.records import Equations


def run(
    path: str | Path,
    choice: str | None,
    out: str | Path | None,
    constants: Constants,
    functions: Collection[str] | None,
    formulation: str,
    integrators: Collection[str],
    states: int,
    numpy: bool,
) -> Built:
    clock = Clock()
    equations = equations_of(path, choice, constants, formulation, clock)
    with meanwhile(lambda: html(equations)) as page:
        program = program_of(equations, functions, clock, integrators)
        folder = Path(out) if out else Path("generated") / program.name
        _confirm(equations, program, states, numpy, clock)
        with clock("textbook"):
            pages = {"derivation.html": page()}
    # What was verified is in the cache by now, so that this does not compile again.
    made = emit(program, folder, pages, clock)
    return _record(program, folder, made.compiled, clock)


def _confirm(equations: Equations, program: Program, states: int, numpy: bool, clock: Clock) -> None:
    """Compile out of sight, and raise unless the module agrees with the independent derivation."""
    with (
        tempfile.TemporaryDirectory(prefix="hamel-", ignore_cleanup_errors=True) as trial,
        ThreadPoolExecutor(1) as compiling,  # the derivation is checked while the compiler works
    ):
        made = compiling.submit(emit, program, Path(trial) / program.name, {}, clock)
        with clock("verify"):
            found = quick_verification(equations.system.model, equations, lambda: _loaded(made.result(), numpy), states)
    failed = [check for check in found.checks if not check.passed]
    if failed:
        lines = "; ".join(f"{check.name}: {check.value:.2g} exceeds {check.tolerance:.2g}" for check in failed)
        raise VerificationError(f"{program.name}, choice {program.choice}: verification failed, nothing is written: {lines}")


def _loaded(made: MadeFolder, numpy: bool) -> ModuleType:
    if not (made.compiled or numpy):
        hint = "or build with --numpy: the module then runs on NumPy until it is compiled"
        raise ToolchainError(f"no C compiler found: {INSTALL}", hint)
    return load_quietly(made)


def _record(program: Program, folder: Path, compiled: bool, clock: Clock) -> Built:
    return Built(
        model=program.name,
        choice=program.choice,
        reason=program.reason,
        folder=folder,
        verified=True,
        operations={kernel.name: kernel.operations["total"] for kernel in program.kernels},
        seconds=clock.seconds,
        quasi_velocities=program.quasi_velocities,
        left_out=program.left_out,
        ledger=tuple(asdict(entry) for entry in program.ledger),
        compiled=compiled,
    )


def show(record: Built, console: Console) -> None:
    from hamel.show import durations, operations

    console.print(f"{record.model}: built and verified {record.folder}{'' if record.compiled else ' (NumPy only, not compiled)'}")
    console.print(f"  choice      {record.choice} ({', '.join(record.quasi_velocities)}): {record.reason}")
    console.print(f"  operations  {operations(record.operations)}")
    console.print(f"  time        {durations(record.seconds)}")


def explain(record: Built, console: Console) -> None:
    """What `build --explain` adds: the ledger of the passes and what was left out."""
    from hamel.show import ledger

    ledger(record.ledger, record.left_out, console)
