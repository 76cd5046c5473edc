"""build: what people read of a module that was built."""

from __future__ import annotations

from rich.console import Console

from derive.diagnostics import listed
from hamel.records import Built
from hamel.show import durations, ledger, operations


def show(record: Built, console: Console) -> None:
    """Where the module is, its choice and why it was chosen, operations, size and time."""
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
    for name, how in record.targets.items():
        console.print(f"  target      {name}, {how}")
    if record.tuned:
        times = ", ".join(f"{name} {ns:.1f} ns" for name, ns in record.tuned.items())
        console.print(f"  tuned       {times}")
    console.print(f"  time        {durations(record.seconds)}")


def explain(record: Built, console: Console) -> None:
    """What `build --explain` adds: the ledger of the passes and what was left out."""
    ledger(record, console)
