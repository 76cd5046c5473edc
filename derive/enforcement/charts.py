"""Enforcements that integrate fewer coordinates: before every evaluation the others are solved from
the constraints.

With directions E (m × nq) that are frozen between changes of the chart, q ← q − Eᵀ (∂ψ/∂q Eᵀ)⁻¹ ψ
until ψ = 0: what E does not span is integrated, what it spans follows. Where the state holds all
generalized velocities, v ← v − Fᵀ (A Fᵀ)⁻¹ (A v − c) likewise.
"""

from derive.enforcement.records import Enforcement, Options
from derive.formulations.manifold import keeps_velocities
from derive.formulations.records import Equations


def _refusal(equations: Equations, options: Options) -> str:
    return (
        ""
        if _needs(equations)
        else "there is nothing to solve: no position constraints, and A v = c holds in these "
        "quasi-velocities"
    )


def _needs(equations: Equations) -> tuple[str, ...]:
    known = {request.name for request in equations.requests}
    return tuple(
        name
        for name in ("closure", "slip")
        if name in known and (name == "closure" or keeps_velocities(equations))
    )


PARTITIONING = Enforcement(
    name="partitioning",
    about="independent coordinates are integrated, dependent ones solved by Newton's method; "
    "chosen anew where others are better",
    source="R. A. Wehage, E. J. Haug: Generalized coordinate partitioning for dimension "
    "reduction, J. Mech. Design 104, 1982",
    level="stages",
    refusal=_refusal,
    needs=_needs,
)

SELECTIVE = Enforcement(
    name="selective",
    about="as partitioning, with the coordinates selected once for the whole run",
    source="A. A. Nada, A. H. Bashiri: Selective generalized coordinates partitioning for "
    "multibody systems",
    level="stages",
    refusal=_refusal,
    needs=_needs,
    stop="the coordinates that were selected at the start may be: partitioning selects anew",
)

TANGENT = Enforcement(
    name="tangent",
    about="coordinates in the tangent space at a base point are integrated, normal ones solved "
    "with a frozen, updated inverse",
    source="E. J. Haug: An ordinary differential equation formulation for multibody dynamics: "
    "nonholonomic constraints",
    level="stages",
    refusal=_refusal,
    needs=_needs,
)
