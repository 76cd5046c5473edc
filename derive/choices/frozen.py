"""Choice c: B = N₀ᵀ, an orthonormal basis of ker A at a base point, held constant: Ḃ = 0 (Haug's
tangent space coordinates).

The base point is the model's initial state. w are the velocities along the directions that were
tangent there; the choice is good near the base point and ends where the tangent space has turned by
a right angle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from derive.choices.limits import RANK
from derive.choices.resolution import Resolved, carried_out
from derive.choices.survey import Survey, direction_names
from derive.choices.walk import Dependent, Undetermined
from derive.diagnostics import AssumptionError
from derive.mechanics.records import RowForm
from derive.model.records import Choice
from derive.numerics import NONZERO
from derive.states.initial import initial_state

DIGITS = 12  # of the numbers in B: any numbers near N₀ will do, these are the same on every machine


def frozen(survey: Survey, choice: Choice) -> Resolved:
    """The choice w = N₀ᵀ v with the numbers N₀ from `tangent`. Raises AssumptionError where A has
    not its full rank at the initial state, or the basis is of no use elsewhere."""
    directions = tangent(survey)
    names = direction_names(survey.system, len(directions))
    rows = [
        RowForm(name, (), tuple((j, float(x)) for j, x in enumerate(direction) if x != 0.0))
        for name, direction in zip(names, directions)
    ]
    try:
        return carried_out(
            survey,
            choice.name,
            "frozen",
            rows,
            "constant rows, tangent to the constraints at the initial state",
        )
    except (Dependent, Undetermined):
        text = (
            "the directions that are tangent at the initial state determine the motion at no "
            "sampled state"
        )
        raise AssumptionError(
            f"{survey.system.model.name}: choice '{choice.name}': {text}", "another initial state"
        ) from None


def tangent(survey: Survey) -> np.ndarray:
    """Orthonormal rows, nw × nv: the columns of the projector 1 − A⁺A on ker A at the base point,
    longest remainder first (a pivoted Gram–Schmidt).

    Any orthonormal basis of ker A would do; this one is made of the projector, which is unique, so
    that the same numbers come out on every machine. Raises AssumptionError where A loses rank at
    the initial state.
    """
    system = survey.system
    q = initial_state(system).q
    A = survey.solver.velocities(0.0, q, np.array(system.parameters))[0][list(survey.kept)]
    if len(A) and np.linalg.matrix_rank(
        A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), NONZERO), tol=RANK
    ) < len(A):
        raise AssumptionError(
            f"{system.model.name}: the constraints lose rank at the initial state: it is no "
            "base point"
        )
    projector: NDArray[np.float64] = (
        np.eye(system.v.numel()) - np.linalg.pinv(A) @ A if len(A) else np.eye(system.v.numel())
    )
    rows: list[np.ndarray] = []
    for _ in range(survey.freedom):
        lengths: NDArray[np.float64] = np.linalg.norm(projector, axis=0)
        # rounded, so that ties go the same way on every machine
        row = projector[:, int(np.argmax(np.round(lengths, 6)))]
        row = row / np.linalg.norm(row)
        projector = projector - np.outer(row, row @ projector)
        rows.append(row)
    return np.round(np.array(rows).reshape(len(rows), system.v.numel()), DIGITS)
