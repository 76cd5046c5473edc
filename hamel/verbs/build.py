"""build: a module that was built before from the same things, or a new one: derived, compiled and
quickly verified."""

from __future__ import annotations

from collections.abc import Collection
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from derive.diagnostics import listed
from hamel import kept
from hamel.built import Built
from hamel.pipeline import Constants, Fixed

if TYPE_CHECKING:
    from rich.console import Console


def run(
    path: str | PathLike[str],
    out: str | Path | None,
    choice: str | None,
    constants: Constants,
    functions: Collection[str] | None,
    formulation: str,
    integrators: Collection[str],
    states: int,
    numpy: bool,
    tune: bool = False,
    header: bool = False,
    fix: Fixed = MappingProxyType({}),
    real: str = "float64",
) -> Built:
    options = {
        "choice": choice,
        "constants": constants if isinstance(constants, str) else tuple(constants),
        "functions": functions and tuple(functions),
        "formulation": formulation,
        "integrators": tuple(integrators),
        "states": states,
        "numpy": numpy,
        "tune": tune,
        "header": header,
        "fix": dict(fix),
        "real": real,
    }
    name = kept.key(path, options)
    found = kept.restored(name, out)
    if found is None:
        from hamel.making import made

        found = made(path, out, **options)
        kept.remember(name, found)
    return found


def show(record: Built, console: Console) -> None:
    from hamel.show import durations, operations

    how = (
        "verified when it was built from the same, copied to"
        if record.kept
        else "built and verified"
    )
    notes = [
        "" if record.real == "float64" else record.real,
        "" if record.compiled else "NumPy only, not compiled",
    ]
    note = ", ".join(filter(None, notes))
    console.print(f"{record.model}: {how} {record.folder}{note and f' ({note})'}")
    console.print(
        f"  choice      {record.choice} ({listed(record.quasi_velocities)}): {record.reason}"
    )
    console.print(f"  operations  {operations(record.operations)}")
    if record.size:
        console.print(f"  library     {record.size / 1000:,.0f} kB")
    if record.tuned:
        console.print(
            f"  tuned       {', '.join(f'{name} {ns:.1f} ns' for name, ns in record.tuned.items())}"
        )
    console.print(f"  time        {durations(record.seconds)}")


def explain(record: Built, console: Console) -> None:
    """What `build --explain` adds: the ledger of the passes and what was left out."""
    from hamel.show import ledger

    ledger(record.ledger, record.left_out, console)
