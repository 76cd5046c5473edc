"""Along which axes the points of closures meet or shift, where rows repeat others.

p₂ − p₁ = 0 says the same along any axes, but not row by row. Two bodies that turn about one line
and meet at a point of it once more say nothing along the line: along axes that turn with them that
is always the same row, or the same part of each; along the ground's it is one row here and another
there. Then no rows that are kept for good are independent wherever all of them are. Where a rod
turns in the bush of a loop that moves in a plane, it is across the rod's axes that they change; and
where the bush turns as well, across the axes of both, not of what carries them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from derive.diagnostics import HamelError
from derive.mechanics.records import System
from derive.mechanics.recursions.tree import nearest_carrier
from derive.mechanics.system import ideal_system
from derive.model.records import Closure
from derive.model.rows import closure_parts
from derive.states.closing import Kinematics, closed, nominal
from derive.states.independence import independent, share
from derive.states.limits import AXES_SAMPLES, BETTER, FEW_CLOSURES, GAP, POOR, SIDES
from derive.states.sampling import row_lengths, states
from derive.states.sparse import Sparse, clearly_independent


def well_turned(ideal: System, forces: ca.SX) -> tuple[System, ca.SX]:
    """The ideal system and the forces beside it, as `ideal_system` gives them, with the points of
    closures along axes in which the same rows repeat others everywhere. They stay along the
    ground's where these serve, and where a force or an output uses the reactions along them."""
    turnable = _turnable(ideal, forces)
    if not turnable or not _may_repeat(ideal):
        return ideal, forces
    best = _share(ideal)
    found, sides = (ideal, forces), dict[str, int]()
    for names, side in _trials(turnable, SIDES[: 2 if ideal.model.plane else None]):
        if best >= POOR:
            break
        tried = {**sides, **dict.fromkeys(names, side)}
        turned = _along(ideal, tried)
        own = _share(turned[0])
        if own > BETTER * best:
            best, found, sides = own, turned, tried
    return found


def _trials(turnable: Sequence[str], sides: Sequence[int]) -> Iterator[tuple[Sequence[str], int]]:
    """All closures along other axes than they are, then, of a few, one by one."""
    yield from ((turnable, side) for side in sides)
    if 1 < len(turnable) <= FEW_CLOSURES:
        yield from (((name,), side) for name in turnable for side in sides)


def _along(ideal: System, sides: Mapping[str, int]) -> tuple[System, ca.SX]:
    """The mechanics anew, with these closures along the axes of their first or second frame, or of
    the body next to both that carries them."""
    model = ideal.model
    closures = [
        replace(x, along=sides[x.name], seen_from=_carrier(ideal, x)) if x.name in sides else x
        for x in model.closures
    ]
    return ideal_system(replace(model, closures=tuple(closures)), ideal.constants)


def _carrier(ideal: System, closure: Closure) -> str:
    """A body of the link next to both bodies that carries both, or the ground."""
    places = dict(ideal.places)
    first, second = (places[body].link for body in closure.bodies)
    carrier, _ = nearest_carrier(ideal.links, first, second)
    return next(body for body, place in ideal.places if place.link == carrier)


def _turnable(ideal: System, forces: ca.SX) -> list[str]:
    """Closures with points that meet or shift, whose reactions nothing in the model uses."""
    used = ca.vertcat(forces, *[value for _, value, _ in ideal.outputs])
    reactions = {x.name() for x in ca.symvar(used)}
    reacting = {
        row.name.partition(".")[0]
        for row in ideal.rows
        if ideal.symbols.reactions([row.name]).name() in reactions
    }
    return [x.name for x in ideal.model.closures if _has_axes(ideal, x) and x.name not in reacting]


def _has_axes(ideal: System, closure: Closure) -> bool:
    parts = closure_parts(closure.type, ideal.model.plane)
    return bool(parts) and parts[0] in ("x", "y", "z", "shift1")


def _may_repeat(ideal: System) -> bool:
    """Whether rows repeat others where the file starts, once it is closed: cheaper to see than at
    states all over, and no row that repeats others everywhere does not do so there."""
    solver, p = Kinematics(ideal), np.array(ideal.parameters, dtype=float)
    q = closed(solver, 0.0, nominal(ideal), p)
    if q is None:
        return True
    rows = solver.velocity_terms(0.0, q, p)[0]
    if isinstance(rows, Sparse) and clearly_independent(rows):
        return False
    A = rows.full()[0] if isinstance(rows, Sparse) else rows
    # GAP is of eigenvalues of A Aᵀ, which are squares
    return bool(np.linalg.matrix_rank(A, tol=np.sqrt(GAP) * np.linalg.norm(A)) < len(A))


def _share(ideal: System) -> float:
    """What the rows that would be kept have of the independence of all; 1 where it is not known."""
    solver = Kinematics(ideal)
    try:
        found = states(ideal, AXES_SAMPLES, solver=solver)
    except HamelError:
        return 1.0
    if not len(found.t):
        return 1.0
    A = solver.rows(found.t, found.q, found.p)[0]
    rows, every = A / row_lengths(A)[:, None], range(len(ideal.rows))
    return share(rows, independent(rows, every), every)
