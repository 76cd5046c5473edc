"""simulate: what people read of a simulation."""

from __future__ import annotations

from rich.console import Console

from derive.diagnostics import listed
from hamel.records import Simulated
from hamel.show import number

MOST_SWITCHES = 5  # changes of choice that are told one by one
FEW_NAMES = 6  # of the velocities of a partition


def show(record: Simulated, console: Console) -> None:
    """Where it starts, what it took, and how far the motion can be trusted."""
    for name, by in record.moved.items():
        contradiction = f"initial {name} = {by['given']:.6g} contradicts the constraints"
        console.print(f"{contradiction}, {by['used']:.6g} is used")
    steps = f"{record.steps} steps, {record.rejected} rejected, {record.seconds:.2g} s of computing"
    console.print(f"{record.model}, choice {record.choice}: {record.lasts} in {steps}")
    why = f": {record.why}" if record.why else ""
    automatic = f" (picked by auto{why})" if record.automatic else ""
    method = f"{record.formulation}, enforcement {record.enforcement}, {record.integrator}"
    console.print(f"  {method}{automatic}")
    console.print(f"  largest |φ|         {number(record.position_violation)}")
    console.print(f"  largest |A v − c|   {number(record.velocity_violation)}")
    console.print(f"  largest |A v̇ − β|   {number(record.acceleration_violation)}")
    integral = ", as Jacobi's integral T₂ − T₀ + V" if "jacobi" in record.measures else ""
    balance = f"{number(record.energy_balance)} of the largest energy exchanged{integral}"
    console.print(f"  energy balance      {balance}")
    if record.error is not None:
        console.print(
            f"  error ≈             {number(record.error)} in any entry of the state at the end"
        )
    _show_charts(record, console)
    _show_events(record, console)
    for place in (record.file, record.plot, record.view):
        if place:
            console.print(f"  wrote {place}")


def _show_events(record: Simulated, console: Console) -> None:
    """How often each happened, and which one ended the motion."""
    for name, times in record.events.items():
        count = "once" if len(times) == 1 else f"{len(times)} times"
        at = "".join(f" at {t:.9g} s" for t in times[:1])
        last = f", last at {times[-1]:.9g} s" if len(times) > 1 else ""
        console.print(f"  event {name:<13} {count}{at}{last}")
    if record.stopped_by:
        console.print(f"  stopped by {record.stopped_by} at {record.time:.12g} s")


def _show_charts(record: Simulated, console: Console) -> None:
    """Where pivots vanished on the way, and which charts came after each other."""
    if record.crossings:
        several = "s" if record.crossings > 1 else ""
        console.print(
            f"  crossed {record.crossings} position{several} where a pivot of the choice or of the "
            "constraints vanishes; two ways across agree within the tolerance"
        )
    if record.landings:
        console.print(f"  {record.landings} steps end where forces go on to another piece")
    if record.charts:
        console.print(f"  charts used         {record.charts}")
    for switch in record.switches[:MOST_SWITCHES]:
        console.print(
            f"  between {switch.time:.6g} s and {switch.before:.6g} s {_chart(switch.left)} "
            f"came near where it fails; {_chart(switch.entered)} took over"
        )
    more = len(record.switches) - MOST_SWITCHES
    if more > 0:
        last = record.switches[-1]
        console.print(f"  {more} more like these, the last before {last.before:.6g} s")


def _chart(name: str) -> str:
    """The name of a choice; of a partition of many velocities the first ones."""
    return listed(name.split(), FEW_NAMES).replace(",", "") if " " in name else name
