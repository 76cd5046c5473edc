"""The directions that turn w into v = S w + R c, their block inverse, and what follows for v̇.

Source: Mirtaheri, Zohoor, Quasi-velocities definition in Lagrangian multibody dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import sympy

from derive.expressions.deferred import Deferred
from derive.textbook.choice import orthonormal, product_entry, themselves
from derive.textbook.dependent import dependent_columns
from derive.textbook.formulas.layout import ends, identity, sum_of
from derive.textbook.manuscript import Manuscript
from derive.textbook.records import Math

ALLOWED = "Velocities that the constraints allow"  # the title
SHORT = 20  # operations of an entry of σ that is printed whole


def directions(doc: Manuscript) -> None:
    """v = S w + R c: what every road writes motions in."""
    if doc.equations.generalized_velocities or not doc.w:
        return
    if themselves(doc) and not doc.terms.has("Y"):
        doc.entries["S"] = doc.exact["S"] = identity(len(doc.v))
        doc.check("S is one", doc.terms.named("S") - ca.SX.eye(len(doc.v)))
        return
    tied = doc.terms.has("Y")
    doc.section(ALLOWED if tied else "Generalized velocities over quasi-velocities")
    if not tied:
        doc.say(
            "There are no constraint rows, so the generalized velocities are $!v=!S\\,!w$ with "
            "$!S=!B^{-1}$:"
        )
        doc.matrix("S", r"!S", "S", doc.terms.named("S"))
    else:
        _repeated_rows(doc)
        _entries(doc)
    doc.mean(
        r"!S", "velocities per quasi-velocity (partial velocities), $!A\\,!S=!0$, $!B\\,!S=!1$"
    )
    _velocities(doc)


def inverse(doc: Manuscript) -> None:
    """Y = [A; B] and its block inverse [R S]."""
    if doc.equations.generalized_velocities or not doc.w or not doc.terms.has("Y"):
        return
    doc.section("Block inverse")
    _stacked(doc)
    _blocks(doc)
    _multiplied_out(doc)


def _stacked(doc: Manuscript) -> None:
    doc.say(
        "Following Mirtaheri and Zohoor, the constraint rows and the speed rows are stacked into "
        "one square matrix and inverted by blocks. It is regular where the pivots of "
        "the choice are not zero:"
    )
    doc.state(
        r"!Y\,!v",
        r"\begin{bmatrix} !A \\ !B \end{bmatrix} !v = \begin{bmatrix} !c \\ !w \end{bmatrix},"
        r" \qquad !Y^{-1} = \begin{bmatrix} !R & !S \end{bmatrix}",
    )
    doc.mean(r"!Y", "constraint rows $!A$ over speed rows $!B$")


def _repeated_rows(doc: Manuscript) -> None:
    """How many rows of A are not in Y."""
    dropped = len(doc.system.rows) - doc.terms.named("A").size1()
    if not dropped or doc.terms.has("E"):
        return
    if dropped == 1:
        doc.say("(1 row of A repeats the others and is left out here.)")
    else:
        doc.say(f"({dropped} rows of A repeat the others and are left out here.)")


def _blocks(doc: Manuscript) -> None:
    """The partition and the Schur complement, in matrices."""
    dependent = dependent_columns(doc)
    free = [j for j in range(len(doc.v)) if j not in dependent]
    doc.say(
        "Let {d} be the dependent velocities and {i} the others, and let the columns of "
        "$!A=[!A_1\\;!A_2]$ and $!B=[!B_1\\;!B_2]$ be sorted accordingly. With the Schur "
        "complement of $!A_1$:",
        d=Math(r"\mathbf{v}_1=" + _listing(doc, dependent)),
        i=Math(r"\mathbf{v}_2=" + _listing(doc, free)),
    )
    doc.state(r"!S'", r"!B_2 - !B_1\,!A_1^{-1}!A_2")
    doc.mean(r"!S'", "Schur complement of $!A_1$ in $!Y$")
    doc.say("With the velocities in the order $!v_1$, $!v_2$ the blocks of the inverse are:")
    _block_laws(doc, dependent, free)


def _block_laws(doc: Manuscript, dependent: list[int], free: list[int]) -> None:
    """S and R over the blocks, rows sorted like the velocities.

    Both are looked at times what they are divided by, S' and A₁: the inverse of a long matrix takes
    minutes.
    """

    def of_S() -> ca.SX:
        A, B, S = (doc.terms.named(x) for x in "ABS")
        ratio = ca.solve(A[:, dependent], A[:, free])
        schur = B[:, free] - ca.mtimes(B[:, dependent], ratio)
        return ca.mtimes(S[order, :], schur) - ca.vertcat(-ratio, ca.SX.eye(len(free)))

    def of_R() -> ca.SX:
        A, B, S, R = (doc.terms.named(x) for x in "ABSR")
        first = ca.vertcat(ca.SX.eye(len(dependent)), ca.SX(len(free), len(dependent)))
        along = ca.mtimes(S[order, :], B[:, dependent])
        return ca.mtimes(R[order, :], A[:, dependent]) - first + along

    order = [*dependent, *free]
    doc.law(
        "S by blocks",
        r"!S",
        r"\begin{bmatrix} -!A_1^{-1}!A_2 \\ !1 \end{bmatrix} !S'^{-1}",
        Deferred(of_S),
    )
    doc.law(
        "R by blocks",
        r"!R",
        r"\begin{bmatrix} !A_1^{-1} \\ !0 \end{bmatrix} - !S\,!B_1\,!A_1^{-1}",
        Deferred(of_R),
    )


def _listing(doc: Manuscript, columns: Sequence[int]) -> str:
    first, left_out, last = ends(columns)
    shown = [doc.notation.latex[doc.v[j]] for j in (*first, *last)]
    if left_out:
        shown.insert(len(first), r"\ldots")
    return r"\left(" + r",\, ".join(shown) + r"\right)"


def _entries(doc: Manuscript) -> None:
    """S and R as the elimination gives them."""
    doc.say(
        "The rows of $!A$ and $!B$ together fix the generalized velocities: $!A\\,!v=!c$ and "
        "$!B\\,!v=!w$ give $!v=!S\\,!w+!R\\,!c$. The columns of $!S$ are the directions that the "
        "constraints allow, $!A\\,!S=!0$ and $!B\\,!S=!1$; those of $!R$ are the directions that "
        "they forbid, $!A\\,!R=!1$ and $!B\\,!R=!0$."
    )
    if "S" not in doc.entries:
        doc.say("Eliminated one row at a time, with the pivots of the choice, they are:")
        doc.matrix("S", r"!S", "S", doc.terms.named("S"))
    doc.named_matrix("R", r"!R")
    doc.mean(r"!R", "velocities per unit of $!c$, $!A\\,!R=!1$, $!B\\,!R=!0$")


def _multiplied_out(doc: Manuscript) -> None:
    """Y Y⁻¹ = 1, block by block."""
    A, B = doc.terms.named("A"), doc.terms.named("B")
    nc, nw = A.size1(), B.size1()
    both = r"\begin{bmatrix}!R & !S\end{bmatrix}"

    def times_inverse(rows: ca.SX) -> ca.SX:
        return ca.mtimes(rows, ca.horzcat(doc.terms.named("R"), doc.terms.named("S")))

    doc.say("The inverse can be checked by multiplying out:")
    doc.law(
        "A Y⁻¹",
        rf"!A{both}",
        r"\begin{bmatrix}!1 & !0\end{bmatrix}",
        Deferred(lambda: times_inverse(A) - ca.horzcat(ca.SX.eye(nc), ca.SX(nc, nw))),
    )
    doc.law(
        "B Y⁻¹",
        rf"!B{both}",
        r"\begin{bmatrix}!0 & !1\end{bmatrix}",
        Deferred(lambda: times_inverse(B) - ca.horzcat(ca.SX(nw, nc), ca.SX.eye(nw))),
    )


def _velocities(doc: Manuscript) -> None:
    """v = S w + R c, row by row."""
    still = doc.system.c.is_zero()
    if "S" not in doc.entries or ("R" not in doc.entries and not still):
        return
    if doc.terms.has("E") and "E" not in doc.entries:
        return
    rows = [product_entry(doc, "S", j, doc.w) for j in range(len(doc.v))]
    c = doc.entries_of_independent("c") if doc.terms.has("Y") else []
    if any(c):
        rows = [x + sum_of(doc.entries["R"][j], c) for j, x in enumerate(rows)]
    own = [j for j, x in enumerate(rows) if x != doc.v[j]]
    if own:
        moving = "" if still else " + !R\\,!c"
        doc.say(f"So the generalized velocities are $!v=!S\\,!w{moving}$:")
        symbols = [doc.v[j] for j in own]
        doc.lines("v", symbols, [rows[j] for j in own], doc.terms.named("v")[own])


def accelerations(doc: Manuscript) -> None:
    """v̇ = S ẇ + σ, where σ solves Y σ = [β; ζ]; once on a page."""
    if doc.equations.generalized_velocities or not doc.w or not doc.first("accelerations"):
        return
    sigma = doc.terms.named("sigma")
    doc.mean(r"!\sigma", "accelerations where $!!w=!0$, $!!v=!S\\,!!w+!\\sigma$")
    if sigma.is_zero():
        doc.entries["sigma"] = [[sympy.Integer(0)]] * len(doc.v)
        if not themselves(doc):
            doc.say(
                "$!S$ is constant, so the accelerations are $!!v=!S\\,!!w+!\\sigma$ with "
                "$!\\sigma=!0$."
            )
        return
    zeta = -_along(doc, ca.mtimes(doc.terms.named("B"), doc.system.v))
    turning = not (ca.simplify(zeta).is_zero() or _unit_vector(doc))
    _sigma_in_words(doc, turning)
    _sigma_by_blocks(doc, zeta, turning)
    _sigma_entries(doc, zeta if turning else None)


def _sigma_in_words(doc: Manuscript, turning: bool) -> None:
    text = (
        "No inverse has to be differentiated for the accelerations: $!!v=!S\\,!!w+!\\sigma$, where "
        "$!\\sigma$ follows from $!A\\,!!v=!\\beta$ with the same directions"
    )
    if _unit_vector(doc):
        text += (
            " (a vector of unit length turns at right angles to itself, so the basis adds nothing)"
        )
    if turning:
        text += " and from the rates of the speed rows, $!\\zeta=-!!B\\,!v$"
    doc.say(f"{text}:")


def _sigma_by_blocks(doc: Manuscript, zeta: ca.SX, turning: bool) -> None:
    """σ = R β + S ζ."""
    parts: list[str] = []
    if doc.terms.has("Y"):
        parts.append(r"!R\,!\beta")
    if turning:
        parts.append(r"!S\,!\zeta")

    def residual() -> ca.SX:
        along_speeds = doc.terms.named("sigma") - ca.mtimes(doc.terms.named("S"), zeta)
        if not doc.terms.has("Y"):
            return along_speeds
        beta = doc.terms.of_independent(doc.system.beta)
        return along_speeds - ca.mtimes(doc.terms.named("R"), beta)

    doc.law("sigma by blocks", r"!\sigma", " + ".join(parts), Deferred(residual))


def _unit_vector(doc: Manuscript) -> bool:
    """One orthonormal basis vector and constraints at rest: B v = |s|² w, so Ḃ v is zero."""
    return orthonormal(doc) and len(doc.w) == 1 and doc.system.c.is_zero()


def _along(doc: Manuscript, expression: ca.SX) -> ca.SX:
    """d/dt along the motion."""
    s = doc.system
    return ca.jtimes(expression, ca.vertcat(s.t, s.q), ca.vertcat(1, s.qdot))


def _sigma_entries(doc: Manuscript, zeta: ca.SX | None) -> None:
    """Entries of σ: whole where short, else over the entries of R, β, S and ζ."""
    sigma = doc.terms.named("sigma")
    short = doc.reader.whole(sigma, SHORT)
    if short is not None:
        doc.say("The entries of $!\\sigma$ are:")
        doc.vector("sigma", r"\sigma", sigma, short)
        return
    if zeta is not None:
        doc.say("The rates of the speed rows are:")
        if not doc.vector("zeta", r"\zeta", zeta):
            return
        doc.mean(r"!\zeta", "rates of the speed rows, $-!!B\\,!v$")
    needed = {"S", "beta"}
    needed |= {"R"} if doc.terms.has("Y") else set()
    needed |= {"E"} if doc.terms.has("E") else set()
    if needed <= doc.entries.keys():
        doc.say("Multiplied out, the entries of $!\\sigma$ are:")
        entries = [_sigma_entry(doc, j, zeta is not None) for j in range(len(doc.v))]
        doc.vector("sigma", r"\sigma", sigma, entries)


def _sigma_entry(doc: Manuscript, j: int, turning: bool) -> sympy.Expr:
    zeta = [row[0] for row in doc.entries["zeta"]] if turning else []
    beta = doc.entries_of_independent("beta") if doc.terms.has("Y") else []
    of_rows = sum_of(doc.entries["R"][j], beta) if beta else 0
    return of_rows + sum_of(doc.entries["S"][j], zeta)
