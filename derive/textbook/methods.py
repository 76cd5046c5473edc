"""What a formulation itself says: its principal equations in matrices, each of them checked against
what is compiled."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from derive.textbook.manuscript import Manuscript

FEW = 4  # pivots whose product is compared with the determinant of M


def method(doc: Manuscript) -> None:
    """The section of the formulation, where it has one of its own."""
    section = SECTIONS.get(doc.equations.formulation)
    if section is not None:
        section(doc)


def nonideal(doc: Manuscript) -> None:
    """Where a nonideal force depends on reactions: whose they are."""
    named = {x.name: x.value for x in doc.system.names}
    if "lam_ideal" not in named:
        return
    doc.say(
        "Some constraint does work that depends on a reaction. The reactions meant, "
        "$!\\lambda^\\circ$, are those of the ideal problem, in which no constraint does work of "
        "its own and the applied forces are $!Q^\\circ$:"
    )
    _ideal(doc, named["C"], named["lam_ideal"])
    doc.say(
        "They do not depend on what the constraints do, so $!Q=!Q^\\circ+!C(!\\lambda^\\circ)$ is "
        "explicit."
    )
    doc.mean(
        r"!\lambda^\circ,\; !Q^\circ,\; !C",
        "reactions and applied forces of the ideal problem, nonideal forces",
    )


def _ideal(doc: Manuscript, C: ca.SX, lam: ca.SX) -> None:
    s = doc.system
    if not s.definite:
        doc.state(
            r"!M\,!!v^\circ + !h", r"!Q^\circ + !A^T!\lambda^\circ,\qquad !A\,!!v^\circ = !\beta"
        )
        return
    force = s.Q - _at_reactions(doc, C, lam)
    free = _solved(s.M, force - s.h + ca.mtimes(s.A.T, lam))
    left = r"!A\,!M^{-1}\left(!Q^\circ - !h + !A^T!\lambda^\circ\right)"
    doc.law("ideal reactions", left, r"!\beta", ca.mtimes(s.A, free) - s.beta)


def _at_reactions(doc: Manuscript, C: ca.SX, lam: ca.SX) -> ca.SX:
    """C at these reactions, one for each constraint row."""
    names, rows = doc.system.symbols.names, doc.system.rows
    places = [i for i, row in enumerate(rows) if f"reaction.{row.name}" in names]
    symbols = [ca.SX(names[f"reaction.{rows[i].name}"]) for i in places]
    return ca.substitute(C, ca.vertcat(*symbols), lam[places, :])


def _solved(M: ca.SX, side: ca.SX) -> ca.SX:
    """M⁻¹ side, by elimination."""
    return ca.solve(ca.densify(M), ca.densify(side))


def _maggi(doc: Manuscript) -> None:
    s, S = doc.system, doc.terms.named("S")
    doc.section("Maggi's equations")
    doc.say(
        "Of the forces on the generalized velocities those along the constraint rows do no work on "
        "the motions $!S\\,!w$ that the constraints allow. So, with the mass matrix, the bias and "
        "the forces as they are written above:"
    )
    motion = ca.mtimes(s.M, doc.terms.vdot) + s.h - s.Q
    doc.law("Maggi", r"!S^T\left(!M\,!!v + !h - !Q\right)", r"!0", ca.mtimes(S.T, motion))
    doc.say(
        "as many equations as there are degrees of freedom; the columns of $!S$ are Kane's partial "
        "velocities."
    )


def _udwadia_kalaba(doc: Manuscript) -> None:
    s, free = doc.system, doc.terms.named("a")
    doc.section("Udwadia and Kalaba's equation")
    doc.say("Without the constraints the accelerations would be $!a$:")
    doc.law("free accelerations", r"!M\,!a", r"!Q - !h", ca.mtimes(s.M, free) - s.Q + s.h)
    doc.mean(r"!a", "accelerations without constraints, $!M^{-1}(!Q-!h)$")
    if s.rows:
        _fundamental(doc, s.M, free, r"!M")
        doc.say(
            "which is Gauss's principle: of all accelerations that satisfy $!A\\,!!v=!\\beta$ this "
            "is the nearest to $!a$."
        )


def _fundamental(doc: Manuscript, M: ca.SX, free: ca.SX, mass: str) -> None:
    """v̇ = a + M⁻¹ Aᵀ λ with G λ = β − A a, over the rows that are kept."""
    A, beta, G = doc.terms.named("A_kept"), doc.terms.named("beta_kept"), doc.terms.named("G")
    doc.say(
        "The constraints ask for $!\\beta$. What is missing is made up by forces along their rows:"
    )
    doc.law("G", r"!G", rf"!A\,{mass}^{{-1}}!A^T", G - ca.mtimes(A, _solved(M, A.T)))
    missing = beta - ca.mtimes(A, free)
    doc.law(
        "missing",
        r"!G\,!\lambda",
        r"!\beta - !A\,!a",
        ca.mtimes(G, doc.terms.named("lam_kept")) - missing,
    )
    doc.mean(r"!G", f"resistance of the constraint rows, $!A\\,{mass}^{{-1}}!A^T$")
    doc.say("The explicit equation of constrained motion is:")
    forces = ca.mtimes(A.T, _solved(G, missing))
    doc.law(
        "explicit equation",
        r"!!v",
        rf"!a + {mass}^{{-1}}!A^T\left(!A\,{mass}^{{-1}}!A^T\right)^{{+}}\left(!\beta - "
        r"!A\,!a\right)",
        doc.terms.vdot - free - _solved(M, forces),
    )


def _udwadia_phohomsiri(doc: Manuscript) -> None:
    doc.section("Udwadia and Phohomsiri's equation")
    doc.say(
        "The mass matrix may be singular here. The acceleration is unique where the rows of $!M$ "
        "and $!A$ together have full column rank. Then, with $!A^+$ the pseudo-inverse:"
    )
    s = doc.system
    if not s.rows:
        residual = ca.mtimes(s.M, doc.terms.vdot) - (s.Q - s.h)
        doc.law("stacked", r"!M\,!!v", r"!Q - !h", residual)
        return
    _stacked(doc)
    doc.say(
        "The same acceleration follows from a mass matrix that is never singular there, with a "
        "number $W_i$ for every row:"
    )
    _weighted(doc)
    _fundamental(doc, doc.terms.named("M_A"), doc.terms.named("a"), r"!M_A")


def _stacked(doc: Manuscript) -> None:
    """[(1 − A⁺A) M; A] v̇ = [(1 − A⁺A)(Q − h); β]."""
    s, A, beta = doc.system, doc.terms.named("A_kept"), doc.terms.named("beta_kept")
    motion = ca.mtimes(s.M, doc.terms.vdot) - (s.Q - s.h)
    tangent = motion - ca.mtimes(A.T, _solved(ca.mtimes(A, A.T), ca.mtimes(A, motion)))
    doc.law(
        "stacked",
        r"\begin{bmatrix} \left(!1-!A^+!A\right)!M \\ !A \end{bmatrix} !!v",
        r"\begin{bmatrix} \left(!1-!A^+!A\right)\left(!Q-!h\right) \\ !\beta \end{bmatrix}",
        ca.vertcat(tangent, ca.mtimes(A, doc.terms.vdot) - beta),
    )


def _weighted(doc: Manuscript) -> None:
    """M_A = M + Aᵀ W A, F_A = Q − h + Aᵀ W β, and a = M_A⁻¹ F_A."""
    s, named = doc.system, doc.terms.named
    A, W = named("A_kept"), named("W")
    doc.matrix("W", r"!W", "W", W)
    weighted = ca.mtimes(A.T, W)
    doc.law("M_A", r"!M_A", r"!M + !A^T!W\,!A", named("M_A") - s.M - ca.mtimes(weighted, A))
    force = s.Q - s.h + ca.mtimes(weighted, named("beta_kept"))
    doc.law("F_A", r"!F_A", r"!Q - !h + !A^T!W\,!\beta", named("F_A") - force)
    residual = ca.mtimes(named("M_A"), named("a")) - named("F_A")
    doc.law("free accelerations", r"!M_A\,!a", r"!F_A", residual)
    doc.mean(
        r"!W,\; !M_A,\; !F_A",
        "weights of the rows, mass matrix and force with the constraints added",
    )
    doc.mean(r"!a", "accelerations that $!M_A$ and $!F_A$ give by themselves")


def _recursive(doc: Manuscript) -> None:
    s, D = doc.system, doc.terms.named("D")
    doc.section("The recursion")
    doc.say(
        "The mass matrix is not inverted. From the tip to the base each joint is eliminated from "
        "the inertia of what it carries, $!M=!U\\,!D\\,!U^T$; its pivot is the inertia that it "
        "feels while all joints beyond it are free. From the base to the tip the accelerations "
        "follow one by one. Because $!U$ is triangular with ones:"
    )
    if s.written and s.M.size1() <= FEW:
        doc.law("determinant", r"\det !M", r"\prod_i D_i", ca.det(ca.densify(s.M)) - _product(D))
    else:
        doc.state(r"\det !M", r"\prod_i D_i")
    doc.say("The pivots, in the order of the generalized velocities, are:")
    doc.vector("D", "D", D)
    doc.mean(r"D_i", "pivots of the recursion, $!M=!U\\,!D\\,!U^T$")


def _product(column: ca.SX) -> ca.SX:
    result = ca.SX(1)
    for i in range(column.numel()):
        result = result * column[i]
    return result


SECTIONS: dict[str, Callable[[Manuscript], None]] = {
    "maggi": _maggi,
    "udwadia_kalaba": _udwadia_kalaba,
    "udwadia_phohomsiri": _udwadia_phohomsiri,
    "recursive": _recursive,
}
