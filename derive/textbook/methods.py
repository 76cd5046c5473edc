"""What a formulation itself says: its principal equations in matrices, each of them checked against
what is compiled."""

from __future__ import annotations

import casadi as ca

from derive.textbook.author import Author

FEW = 4  # pivots whose product is compared with the determinant of M


def method(a: Author) -> None:
    """The section of the formulation, where it has one of its own."""
    found = {
        "maggi": _maggi,
        "udwadia_kalaba": _udwadia_kalaba,
        "udwadia_phohomsiri": _udwadia_phohomsiri,
        "recursive": _recursive,
    }.get(a.equations.formulation)
    if found is not None:
        found(a)


def nonideal(a: Author) -> None:
    """Where a nonideal force depends on reactions: whose they are."""
    named = {x.name: x.value for x in a.system.names}
    if "lam_ideal" not in named:
        return
    a.say(
        "Some constraint does work that depends on a reaction. The reactions meant, $!\\lambda^\\circ$, are those of the ideal "
        "problem, in which no constraint does work of its own and the applied forces are $!Q^\\circ$:"
    )
    _ideal(a, named["C"], named["lam_ideal"])
    a.say(
        "They do not depend on what the constraints do, so $!Q=!Q^\\circ+!C(!\\lambda^\\circ)$ is explicit."
    )
    a.mean(
        r"!\lambda^\circ,\; !Q^\circ,\; !C",
        "reactions and applied forces of the ideal problem, nonideal forces",
    )


def _ideal(a: Author, C: ca.SX, lam: ca.SX) -> None:
    s = a.system
    if not s.definite:
        a.state(
            r"!M\,!!v^\circ + !h", r"!Q^\circ + !A^T!\lambda^\circ,\qquad !A\,!!v^\circ = !\beta"
        )
        return
    symbols = {
        i: x
        for i, row in enumerate(s.rows)
        if (x := s.symbols.names.get(f"reaction.{row.name}")) is not None
    }
    force = s.Q - ca.substitute(
        C, ca.vertcat(*[ca.SX(x) for x in symbols.values()]), lam[list(symbols)]
    )
    free = _solved(s.M, force - s.h + ca.mtimes(s.A.T, lam))
    left = r"!A\,!M^{-1}\left(!Q^\circ - !h + !A^T!\lambda^\circ\right)"
    a.law("ideal reactions", left, r"!\beta", ca.mtimes(s.A, free) - s.beta)


def _solved(M: ca.SX, side: ca.SX) -> ca.SX:
    return ca.solve(ca.densify(M), ca.densify(side))


def _maggi(a: Author) -> None:
    s, S = a.system, a.named("S")
    a.section("Maggi's equations")
    a.say(
        "Of the forces on the generalized velocities those along the constraint rows do no work on the motions $!S\\,!w$ that the "
        "constraints allow. So, with the mass matrix, the bias and the forces as they are written above,"
    )
    motion = ca.mtimes(s.M, a.vdot) + s.h - s.Q
    a.law("Maggi", r"!S^T\left(!M\,!!v + !h - !Q\right)", r"!0", ca.mtimes(S.T, motion))
    a.say(
        "as many equations as there are degrees of freedom; the columns of $!S$ are Kane's partial velocities."
    )


def _udwadia_kalaba(a: Author) -> None:
    s, free = a.system, a.named("a")
    a.section("Udwadia and Kalaba's equation")
    a.say("Without the constraints the accelerations would be $!a$,")
    a.law("free accelerations", r"!M\,!a", r"!Q - !h", ca.mtimes(s.M, free) - s.Q + s.h)
    a.mean(r"!a", "accelerations without constraints, M⁻¹ (Q − h)")
    if s.rows:
        _fundamental(a, s.M, free, r"!M")
        a.say(
            "which is Gauss's principle: of all accelerations that satisfy $!A\\,!!v=!\\beta$ this is the nearest to $!a$."
        )


def _fundamental(a: Author, M: ca.SX, free: ca.SX, mass: str) -> None:
    """v̇ = a + M⁻¹ Aᵀ λ with G λ = β − A a, over the rows that are kept."""
    A, beta, G = a.named("A_kept"), a.named("beta_kept"), a.named("G")
    a.say(
        "The constraints ask for $!\\beta$. What is missing is made up by forces along their rows,"
    )
    a.law("G", r"!G", rf"!A\,{mass}^{{-1}}!A^T", G - ca.mtimes(A, _solved(M, A.T)))
    missing = beta - ca.mtimes(A, free)
    a.law(
        "missing", r"!G\,!\lambda", r"!\beta - !A\,!a", ca.mtimes(G, a.named("lam_kept")) - missing
    )
    a.mean(r"!G", f"resistance of the constraint rows, A {mass.replace('!', '')}⁻¹ Aᵀ")
    a.say("and the explicit equation of constrained motion is")
    forces = ca.mtimes(A.T, _solved(G, missing))
    a.law(
        "explicit equation",
        r"!!v",
        rf"!a + {mass}^{{-1}}!A^T\left(!A\,{mass}^{{-1}}!A^T\right)^{{+}}\left(!\beta - !A\,!a\right)",
        a.vdot - free - _solved(M, forces),
    )


def _udwadia_phohomsiri(a: Author) -> None:
    s, A, beta = a.system, a.named("A_kept"), a.named("beta_kept")
    a.section("Udwadia and Phohomsiri's equation")
    a.say(
        "The mass matrix may be singular here. The acceleration is unique where the rows of $!M$ and $!A$ together have full "
        "column rank; then, with $!A^+$ the pseudo-inverse,"
    )
    force = s.Q - s.h
    if s.rows:
        motion = ca.mtimes(s.M, a.vdot) - force
        tangent = motion - ca.mtimes(A.T, _solved(ca.mtimes(A, A.T), ca.mtimes(A, motion)))
        a.law(
            "stacked",
            r"\begin{bmatrix} \left(!1-!A^+!A\right)!M \\ !A \end{bmatrix} !!v",
            r"\begin{bmatrix} \left(!1-!A^+!A\right)\left(!Q-!h\right) \\ !\beta \end{bmatrix}",
            ca.vertcat(tangent, ca.mtimes(A, a.vdot) - beta),
        )
    else:
        a.law("stacked", r"!M\,!!v", r"!Q - !h", ca.mtimes(s.M, a.vdot) - force)
        return
    a.say(
        "The same acceleration follows from a mass matrix that is never singular there, with a number $W_i$ for every row:"
    )
    W = a.named("W")
    weighted = ca.mtimes(A.T, W)
    a.matrix("W", r"!W", "W", W)
    a.law("M_A", r"!M_A", r"!M + !A^T!W\,!A", a.named("M_A") - s.M - ca.mtimes(weighted, A))
    a.law(
        "F_A",
        r"!F_A",
        r"!Q - !h + !A^T!W\,!\beta",
        a.named("F_A") - force - ca.mtimes(weighted, beta),
    )
    a.law(
        "free accelerations",
        r"!M_A\,!a",
        r"!F_A",
        ca.mtimes(a.named("M_A"), a.named("a")) - a.named("F_A"),
    )
    a.mean(
        r"!W,\; !M_A,\; !F_A",
        "weights of the rows, mass matrix and force with the constraints added",
    )
    a.mean(r"!a", "accelerations that M_A and F_A give by themselves")
    _fundamental(a, a.named("M_A"), a.named("a"), r"!M_A")


def _recursive(a: Author) -> None:
    s, D = a.system, a.named("D")
    a.section("The recursion")
    a.say(
        "The mass matrix is not inverted. From the tip to the base each joint is eliminated from the inertia of what it carries, "
        "$!M=!U\\,!D\\,!U^T$; its pivot is the inertia that it feels while all joints beyond it are free. From the base to "
        "the tip the accelerations follow one by one. Because $!U$ is triangular with ones,"
    )
    if s.written and s.M.size1() <= FEW:
        a.law("determinant", r"\det !M", r"\prod_i D_i", ca.det(ca.densify(s.M)) - _product(D))
    else:
        a.state(r"\det !M", r"\prod_i D_i")
    a.say("with the pivots, in the order of the generalized velocities,")
    a.vector("D", "D", D)
    a.mean(r"D_i", "pivots of the recursion, M = U D Uᵀ")


def _product(column: ca.SX) -> ca.SX:
    result = ca.SX(1)
    for i in range(column.numel()):
        result = result * column[i]
    return result
