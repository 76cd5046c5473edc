"""Choice d: B = NᵀM with the columns of N a basis of ker A, so that w = NᵀM v are momenta along the
free directions.

W = [R S] is then mass-orthogonal, RᵀM S = 0: the kinetic energy of w and of moving constraints do
not mix. With N from the best partition (v = N ν + v₀ for its speeds ν, v₀ the part that moving
constraints give) and G = NᵀM N,
    v = N G⁻¹ (w − NᵀM v₀) + v₀,    ẇ = Nᵀ (Q − h) + Ḃ v,    S = N G⁻¹,    SᵀM S = G⁻¹.
ẇ needs no inverse at all, v needs that of G.
"""

from __future__ import annotations

import casadi as ca

from derive.choices.explicit import Explicit
from derive.choices.ranking import judged
from derive.choices.reduction import Reduction, symbols_for
from derive.choices.resolution import Resolved, resolved
from derive.choices.survey import Survey, direction_names
from derive.diagnostics import AssumptionError
from derive.expressions.counting import operations
from derive.expressions.scalars import Vector
from derive.mechanics.elimination.solve import ldl_solution, scalars
from derive.mechanics.records import System
from derive.model.records import Choice, Span


def mass_orthogonal(survey: Survey, choice: Choice) -> Resolved:
    """The choice w = NᵀM v of momenta along the free directions, in N s or N m s where those are
    plain velocities. Raises AssumptionError where M is not written out, or where no partition
    exists that N could be taken from."""
    system = survey.system
    if not system.written:
        raise AssumptionError(
            f"{system.model.name}: choice '{choice.name}' needs the mass matrix, which so long "
            "a chain leaves out"
        )
    base = resolved(survey, Choice("auto", "auto", (), Span(0, 0))).reduction
    reduction, explicit = _in_momenta(system, base)
    ranking = judged(survey, choice.name, "mass_orthogonal", reduction.names, reduction, explicit)
    reason = (
        "momenta along the free directions: the kinetic energy is block-diagonal, and ẇ "
        "needs no inverse"
    )
    return Resolved(ranking, reduction, explicit, reason)


def _in_momenta(system: System, base: Reduction) -> tuple[Reduction, Explicit]:
    """v and σ over the momenta w, from S and v₀ of a partition: see the head of this module."""
    names = direction_names(system, len(base.names))
    w, N = symbols_for(names), base.S
    B = ca.mtimes(N.T, system.M)
    inverse = _inverse(ca.mtimes(B, N))
    given = ca.substitute(base.v, base.w, ca.SX.zeros(base.w.numel()))
    nu = ca.mtimes(inverse, w - ca.mtimes(B, given))
    v, turned = ca.mtimes(N, nu) + given, ca.substitute(base.sigma, base.w, nu)
    # Ḃ v, as the derivative of B v along the motion with v held
    turning = ca.jtimes(
        ca.mtimes(B, system.v), ca.vertcat(system.t, system.q), ca.vertcat(1, system.qdot)
    )
    turning = ca.substitute(turning, system.v, v)
    S = ca.mtimes(N, inverse)
    sigma = turned - ca.mtimes(S, turning + ca.mtimes(B, turned))
    reduction = Reduction(
        names=names, w=w, B=B, S=S, v=v, sigma=sigma, walked=None, guards=base.guards,
        pivots=(*base.pivots, *(() if not names else ("NᵀM N of these is positive definite",))),
        kept=base.kept, constant_pivots=base.constant_pivots,
    )  # fmt: skip
    return reduction, _explicit(system, reduction, N, inverse, turning)


def _explicit(
    system: System, reduction: Reduction, N: ca.SX, inverse: ca.SX, turning: ca.SX
) -> Explicit:
    S, sigma, v = reduction.S, reduction.sigma, reduction.v
    force = ca.substitute(system.Q - system.h, system.v, v)
    wdot = ca.mtimes(N.T, force) + turning
    qdot = ca.substitute(system.qdot, system.v, v)
    f_w = ca.mtimes(S.T, force - ca.mtimes(system.M, sigma))
    count = operations(qdot, wdot)
    return Explicit(
        qdot=qdot,
        operations=count,
        gathered="momenta: no inverse in ẇ",
        wdot=wdot,
        vdot=ca.densify(ca.mtimes(S, wdot) + sigma),
        mass=inverse,
        force=f_w,
    )


def _inverse(G: ca.SX) -> ca.SX:
    """Of a positive definite matrix, by L D Lᵀ."""
    n = G.size1()
    sides: list[Vector] = [[1.0 if i == k else 0.0 for i in range(n)] for k in range(n)]
    columns = ldl_solution(scalars(G), sides, list(reversed(range(n)))).x
    return ca.horzcat(*[ca.vertcat(*x) for x in columns]) if n else ca.SX(0, 0)
