"""Feedback on the constraint quasi-velocities: q̇ = N (v + R (−α φ)) instead of N v, so that φ̇ =
−α φ; w is as it was.

v = S w + R c, B R = 0: only the velocities across the constraints change, and only in q̇.
Nonholonomic rows stay met.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from derive.enforcement.records import Enforcement, Options
from derive.formulations.derivatives import derivatives
from derive.formulations.manifold import keeps_velocities
from derive.formulations.records import Equations


def _refusal(equations: Equations, options: Options) -> str:
    if not any(row.position >= 0 for row in equations.system.rows):
        return "there are no position constraints that could drift"
    if keeps_velocities(equations):
        return "the velocities drift too in this formulation; use baumgarte"
    if not equations.offers("pull"):
        return "no row of the position constraints says anything about the motion"
    return ""


def _fed_back(equations: Equations, options: Options) -> Equations:
    """q̇ + α N R (−φ) in the place of q̇; derivatives on request follow the changed function."""
    pull = equations.request("pull").function
    shift = (options.alpha or 0.0) * pull.result.value
    dynamics = equations.function("dynamics")
    # only q̇ is changed: ẇ stays that of mechanics, so no force is invented
    value = dynamics.result.value + ca.vertcat(
        shift, ca.SX.zeros(len(equations.w) + len(equations.z))
    )
    fed = replace(
        dynamics,
        about=f"{dynamics.about}; q̇ pulls φ to zero",
        result=replace(dynamics.result, value=value),
    )
    functions = tuple(fed if function is dynamics else function for function in equations.functions)
    own = {request.name for request in derivatives(equations.arguments, functions)}
    others = tuple(request for request in equations.requests if request.name not in own)
    return replace(
        equations,
        functions=functions,
        requests=(*others, *derivatives(equations.arguments, functions)),
    )


FEEDBACK = Enforcement(
    name="feedback",
    about="the constraint quasi-velocities are fed back, so that violations of positions decay "
    "at the rate alpha",
    source="quasi-velocities u_c = c − α φ after Mirtaheri & Zohoor; W. Blajer, MSD 9, 2003, on "
    "the projective criterion",
    level="rates",
    refusal=_refusal,
    equations=_fed_back,
)
