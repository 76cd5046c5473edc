"""check: read a model, form its mechanics, make its initial state consistent, try its choices;
nothing is generated."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from derive.diagnostics import counted
from derive.model.records import Model
from derive.robots.reading import load
from derive.states.initial import Initial, initial_state
from hamel.build.stages import mechanics_of, usable_choices
from hamel.records import Checked
from hamel.show import refusals

if TYPE_CHECKING:
    from rich.console import Console

    from derive.mechanics.records import System

# singular values below this fraction of the largest are zero: constraints of exact models are far
# from it
RANK = 1e-9


def run(path: str | PathLike[str]) -> Checked:
    """Degrees of freedom, the rank of A at the consistent initial state, the usable
    choices, and why the others are refused.

    Raises ModelError where the file is wrong, AssumptionError where the first choice cannot be
    made: it is the default.
    """
    model = load(path)
    mechanics = mechanics_of(model)
    usable, refused = usable_choices(mechanics)  # first: it tells what is stretched to fit
    initial = initial_state(mechanics)
    rank = _rank(mechanics, initial.q)
    default = next(iter(usable.values()))
    return Checked(
        model=model.name,
        file=model.file,
        bodies=tuple(body.name for body in model.bodies),
        coordinates=tuple(coordinate.name for coordinate in model.coordinates),
        velocities=tuple(velocity.name for velocity in model.velocities),
        constraints=tuple(row.name for row in mechanics.rows),
        inputs=tuple(given.name for given in model.inputs),
        states=tuple(state.name for state in model.states),
        parameters=tuple(parameter.name for parameter in model.parameters),
        outputs=tuple(output.name for output in model.outputs),
        choices=tuple(usable),
        refused=refused,
        rank=rank,
        degrees_of_freedom=len(default.w),
        speeds_at_start=len(model.velocities) - rank,
        moved=moved_by(initial.moved),
        initial=_by_name(model, initial),
        assumptions=default.assumptions,
    )


def _by_name(model: Model, initial: Initial) -> dict[str, float]:
    """The consistent initial state."""
    named = (
        (model.coordinates, initial.q),
        (model.velocities, initial.v),
        (model.states, initial.z),
    )
    return {x.name: float(value) for given, values in named for x, value in zip(given, values)}


def moved_by(moved: Iterable[tuple[str, float, float]]) -> dict[str, dict[str, float]]:
    """Held initial values that had to give way, by name."""
    return {name: {"given": given, "used": used} for name, given, used in moved}


def _rank(mechanics: System, q: Any) -> int:
    """Rank of A at the configuration q, t = 0, with the file's parameters."""
    rows = ca.Function("A", [mechanics.t, mechanics.q, mechanics.p], [ca.densify(mechanics.A)])
    values = np.linalg.svd(np.asarray(rows(0.0, q, list(mechanics.parameters))), compute_uv=False)
    return int(np.sum(values > RANK * values[0])) if values.size else 0


def show(record: Checked, console: Console) -> None:
    """One line of verdict, then what the equations assume, what is refused, and initial values that
    had to move."""
    velocities = counted(len(record.velocities), "velocity", "velocities")
    freedom = counted(record.degrees_of_freedom, "degree") + " of freedom"
    singular = record.speeds_at_start > record.degrees_of_freedom
    rank = len(record.velocities) - record.degrees_of_freedom if singular else record.rank
    size = f"{velocities}, {counted(len(record.constraints), 'constraint')} of rank {rank}"
    if singular:
        size += f" ({record.rank} at the start)"
    if record.states:
        size += f", {counted(len(record.states), 'first-order state')}"
    console.print(f"{record.model}: ok, {size}, {freedom}; choices {', '.join(record.choices)}")
    if singular:
        console.print(
            f"  the initial state is singular: {record.speeds_at_start} speeds are free there, "
            f"{record.degrees_of_freedom} elsewhere, and no motion from it is determined"
        )
    for assumption in record.assumptions:
        console.print(f"  {assumption}")
    refusals(record.refused, console)
    for name, by in record.moved.items():
        console.print(
            f"  initial {name} = {by['given']:.6g} cannot be kept, {by['used']:.6g} is used"
        )
