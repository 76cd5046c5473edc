"""What is measured of every motion, by name: energies, work and violations.

A name of the model's own, such as a voltage V, is the model's: the measure goes by its long name
then, so that nothing is lost and a name means the same to every verb.
"""

from __future__ import annotations

from derive.model.records import Model
from derive.model.rows import components
from hamel.settings import units

LONG = {
    "T": "kinetic_energy",
    "V": "potential_energy",
    "jacobi": "jacobi_integral",
    "work": "work_done",
    "position_violation": "largest_position_violation",
    "velocity_violation": "largest_velocity_violation",
    "choice": "choice_taken",
}


def measures(model: Model) -> dict[str, str]:
    """What each measure is called beside the names of this model."""
    letters = model.plane or "xyz"
    parts = (components(x.name, x.expression, letters) for x in model.outputs)
    taken = {*units(model), *(x.name for x in model.outputs), *(n for part in parts for n in part)}
    return {name: _free(name, taken) for name in LONG}


def _free(name: str, taken: set[str]) -> str:
    free = LONG[name] if name in taken else name
    while free in taken:
        free += "_"
    return free
