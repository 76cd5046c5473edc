"""Roads that find all accelerations first: Lagrange's equations with multipliers, and Udwadia and
Kalaba's equation. The quasi-velocities are taken at the end.

Source: Lagrange 1788; Udwadia, Kalaba, Analytical Dynamics, 1996.
"""

from __future__ import annotations

import casadi as ca

from derive.textbook.forces import along, at_quasi_velocities
from derive.textbook.formulas.terms import Terms
from derive.textbook.inverse import accelerations
from derive.textbook.manuscript import Manuscript
from derive.textbook.methods import nonideal
from derive.textbook.motion import unprojected
from derive.textbook.projected import final
from derive.textbook.roads.records import Road


def _independent(terms: Terms) -> tuple[ca.SX, ca.SX]:
    """A and β of independent rows."""
    s = terms.system
    if not terms.has("Y"):
        return ca.SX(0, s.v.numel()), ca.SX(0, 1)
    return terms.named("A"), terms.of_independent(s.beta)


def _bordered(terms: Terms) -> tuple[ca.SX, ca.SX]:
    """[M −Aᵀ; A 0] and [Q − h; β]."""
    s, (A, beta) = terms.system, _independent(terms)
    count = A.size1()
    upper = ca.horzcat(s.M, -A.T)
    lower = ca.horzcat(A, ca.SX(count, count))
    return ca.vertcat(upper, lower), ca.vertcat(s.Q - s.h, beta)


def _speed_rates(terms: Terms, vdot: ca.SX) -> ca.SX:
    """ẇ = B v̇ + Ḃ v."""
    s, B = terms.system, terms.named("B")
    turning = ca.jtimes(ca.mtimes(B, s.v), ca.vertcat(s.t, s.q), ca.vertcat(1, s.qdot))
    return at_quasi_velocities(terms, ca.mtimes(B, vdot) + turning)


def _by_border(terms: Terms) -> ca.SX:
    matrix, side = _bordered(terms)
    solution = ca.solve(ca.densify(matrix), ca.densify(side))
    return _speed_rates(terms, solution[: terms.system.v.numel()])


def _by_free_motion(terms: Terms) -> ca.SX:
    s, (A, beta) = terms.system, _independent(terms)
    free = _over_mass(s.M, s.Q - s.h)
    if not A.size1():
        return _speed_rates(terms, free)
    missing = ca.solve(
        ca.densify(ca.mtimes(A, _over_mass(s.M, A.T))), ca.densify(beta - ca.mtimes(A, free))
    )
    return _speed_rates(terms, free + _over_mass(s.M, ca.mtimes(A.T, missing)))


def _over_mass(M: ca.SX, side: ca.SX) -> ca.SX:
    return ca.solve(ca.densify(M), ca.densify(side))


def _lagrange(doc: Manuscript) -> None:
    unprojected(doc)
    nonideal(doc)
    doc.section("The bordered system")
    terms = doc.terms
    if terms.has("Y"):
        doc.say(
            "The multipliers are unknowns like the accelerations. Together with $!A\\,!!v=!\\beta$ "
            "there are as many equations as unknowns:"
        )
        matrix, side = _bordered(terms)
        lam = _lam(terms)
        unknowns = ca.vertcat(terms.vdot, lam)
        residual = at_quasi_velocities(terms, ca.mtimes(matrix, unknowns) - side)
        doc.law(
            "bordered system",
            r"\begin{bmatrix} !M & -!A^T \\ !A & !0 \end{bmatrix}"
            r"\begin{bmatrix} !!v \\ !\lambda \end{bmatrix}",
            r"\begin{bmatrix} !Q - !h \\ !\beta \end{bmatrix}",
            residual,
        )
        doc.mean(r"!\lambda", "multipliers, forces along the constraint rows")
    else:
        doc.say("There are no multipliers: {motion} is solved as it is.", motion=doc.ref("motion"))
    _to_quasi_velocities(doc)
    final(doc)


def _lam(terms: Terms) -> ca.SX:
    """Multipliers of the independent rows."""
    s, R = terms.system, terms.named("R")
    return ca.mtimes(R.T, ca.mtimes(s.M, terms.vdot) + s.h - s.Q)


def _to_quasi_velocities(doc: Manuscript) -> None:
    terms = doc.terms
    doc.section("From accelerations to quasi-velocities")
    doc.say("The quasi-velocities are $!w=!B\\,!v$, so their rates follow from all accelerations:")
    residual = terms.wdot - _speed_rates(terms, terms.vdot)
    doc.law("rates of w", r"!!w", r"!B\,!!v + !!B\,!v", residual)
    if terms.has("Y"):
        doc.say(
            "Written the other way round, $!!v=!S\\,!!w+!\\sigma$, and multiplied by $!S^T$, the "
            "multipliers drop out because $!A\\,!S=!0$. The same equations remain that every other "
            "road leads to."
        )
    rate = along(terms, terms.named("v"), terms.wdot)
    doc.law("rates of v", r"!!v", r"!S\,!!w + !\sigma", terms.vdot - rate)
    accelerations(doc)


def _udwadia_kalaba(doc: Manuscript) -> None:
    unprojected(doc)
    nonideal(doc)
    doc.section("Udwadia and Kalaba's equation")
    terms, s = doc.terms, doc.system
    A, beta = _independent(terms)
    doc.say("Without the constraints the accelerations would be $!a$:")
    free = _over_mass(s.M, s.Q - s.h)
    doc.law(
        "free accelerations",
        r"!M\,!a",
        r"!Q - !h",
        at_quasi_velocities(terms, ca.mtimes(s.M, free) - s.Q + s.h),
    )
    doc.mean(r"!a", "accelerations without constraints, $!M^{-1}(!Q-!h)$")
    if A.size1():
        _corrected(doc, A, beta, free)
    _to_quasi_velocities(doc)
    final(doc)


def _corrected(doc: Manuscript, A: ca.SX, beta: ca.SX, free: ca.SX) -> None:
    terms, s = doc.terms, doc.system
    doc.say(
        "They miss $!A\\,!!v=!\\beta$ by $!\\beta-!A\\,!a$. Of all accelerations that do not, the "
        "mechanism takes the one nearest to $!a$ in the metric of $!M$ (Gauss's principle of least "
        "constraint):"
    )
    G = ca.mtimes(A, _over_mass(s.M, A.T))
    forces = ca.mtimes(A.T, ca.solve(ca.densify(G), ca.densify(beta - ca.mtimes(A, free))))
    residual = ca.mtimes(s.M, terms.vdot - free) - forces
    doc.law(
        "explicit equation",
        r"!M\left(!!v - !a\right)",
        r"!A^T\left(!A\,!M^{-1}!A^T\right)^{+}\left(!\beta - !A\,!a\right)",
        at_quasi_velocities(terms, residual),
    )


def _regular_mass(terms: Terms) -> str:
    if terms.system.definite:
        return ""
    return "its mass matrix is singular, and the accelerations without constraints do not exist"


LAGRANGE = Road(
    name="multipliers",
    title="Lagrange's equations with multipliers",
    about="accelerations and multipliers from one bordered system",
    source="Lagrange: Mécanique analytique, 1788",
    write=_lagrange,
    accelerations=_by_border,
    unknowns=lambda terms: terms.system.v.numel() + _independent(terms)[0].size1(),
    needs="one linear system in all accelerations and multipliers, symmetric and indefinite",
    fails="where rows of A repeat each other; velocities and positions drift from the constraints",
)
UDWADIA_KALABA = Road(
    name="udwadia_kalaba",
    title="Udwadia and Kalaba's equation",
    about="free accelerations, corrected by the least that the constraints ask for",
    source="Udwadia, Kalaba: Analytical Dynamics, 1996",
    write=_udwadia_kalaba,
    accelerations=_by_free_motion,
    unknowns=lambda terms: terms.system.v.numel(),
    needs="M⁻¹ and a pseudo-inverse of A M⁻¹ Aᵀ; repeated rows do no harm to it",
    fails="where M is singular; velocities and positions drift from the constraints",
    misfit=_regular_mass,
)
