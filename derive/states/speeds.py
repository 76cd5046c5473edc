"""Declared quasi-velocities as rows of the velocities: what holds or guesses them by name needs."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.records import System
from derive.states.scales import Scales


def speed_rows(system: System) -> dict[str, ca.SX]:
    """Quasi-velocities are linear in v: the row of each over (t, q, p), by name."""
    s = system.symbols
    formulas = {x.name: ca.SX(s.scalar(x.formula)) for x in system.model.speeds}
    # formulas may speak of q̇ = N v
    over_v = {name: ca.substitute(w, s.qd, system.qdot) for name, w in formulas.items()}
    return {name: ca.jacobian(w, system.v) for name, w in over_v.items()}


def rows_in_own_units(system: System, own: Scales) -> ca.Function | None:
    """(t, q, p) → all rows, with everything in the model's own units; None where the file declares
    no quasi-velocities."""
    model = system.model
    if not model.speeds:
        return None
    q, v, w = (
        ca.DM(own.all_of(x.unit for x in items))
        for items in (model.coordinates, model.velocities, model.speeds)
    )
    free = system.given[: len(system.own_parameters)]
    p = ca.DM(own.all_of(x.unit for x in free))
    place = [system.t, system.q, system.own_p]
    rows = ca.vertcat(*speed_rows(system).values())
    rows = ca.mtimes(ca.mtimes(ca.diag(1 / w), rows), ca.diag(v))
    (rows,) = ca.substitute([rows], place, [own.time * system.t, q * system.q, p * system.own_p])
    return ca.Function("speeds", place, [ca.densify(rows)])
