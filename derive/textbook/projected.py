"""The equations projected on the motions that the constraints allow, (Sᵀ M S) ẇ = Sᵀ (Q − h − M σ).

Source: Maggi 1896; Kane, Levinson, Dynamics, Theory and Applications, 1985.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import sympy

from derive.textbook.compose import operations
from derive.textbook.elimination import Elimination
from derive.textbook.layout import Rows
from derive.textbook.manuscript import Manuscript, sum_of
from derive.textbook.motion import force_column

SHORT = 40  # operations of an entry of M_w or f_w that is printed multiplied out
LONG_SUM = 30  # operations beyond which products of matrices are printed in two steps
MOST_SPEEDS = 6  # more quasi-velocities than this are not solved for on the page


def projected(doc: Manuscript) -> None:
    """M_w ẇ = f_w with M_w = SᵀM S (nw × nw) and f_w = Sᵀ (Q − h − M σ), its entries, and ẇ solved
    for. Each law that is printed is checked in numbers against the equations of the module."""
    if doc.equations.generalized_velocities or not doc.w:
        return
    doc.section("Equations without multipliers")
    if doc.terms.has("Y"):
        doc.say(
            "Since $!A\\,!S=!0$, multiplying from the left by $!S^T$ removes the multipliers "
            "(Maggi's equations; the columns of $!S$ are Kane's partial velocities):"
        )
    else:
        doc.say(
            "Multiplying from the left by $!S^T$ carries the equations over to the "
            "quasi-velocities (Maggi, Kane):"
        )
    _laws(doc)
    doc.mean(r"!M_w,\; !f_w", "mass matrix and force of the quasi-velocities: M_w ẇ = f_w")
    _mass(doc)
    _force(doc)
    _solved(doc)


def _laws(doc: Manuscript) -> None:
    M, S = doc.system.M, doc.terms.named("S")
    M_w, f_w = doc.terms.named("M_w"), doc.terms.named("f_w")
    doc.law("projected", r"!M_w\,!!w", r"!f_w", ca.mtimes(M_w, doc.terms.wdot) - f_w)
    doc.say("with the mass matrix and the force of the quasi-velocities")
    doc.law("M_w", r"!M_w", r"!S^T!M\,!S", M_w - ca.mtimes(S.T, ca.mtimes(M, S)))
    right = r"!S^T\left(!Q - !h - !M\,!\sigma\right)"
    doc.law("f_w", r"!f_w", right, f_w - ca.mtimes(S.T, _force_at_rest(doc)))


def _force_at_rest(doc: Manuscript) -> ca.SX:
    """Q − h − M σ: what is left of the forces where ẇ = 0."""
    s = doc.system
    return s.Q - s.h - ca.mtimes(s.M, doc.terms.named("sigma"))


def _mass(doc: Manuscript) -> None:
    """M_w: multiplied out where short, else over the entries of M and S."""
    M_w = doc.terms.named("M_w")
    short = doc.reader.whole(M_w, SHORT)
    if short is not None:
        doc.say("Multiplied out, the mass matrix is")
        doc.matrix("M_w", r"!M_w", "M^{w}", M_w, short, symmetric=True)
        return
    if not {"M", "S"} <= doc.entries.keys():
        return
    rows = _triple_product(doc.entries["S"], doc.entries["M"])
    if max(operations(x) for row in rows for x in row) > LONG_SUM:
        rows = _by_momenta(doc)
    doc.say("Written out over the entries above, the mass matrix is")
    doc.matrix("M_w", r"!M_w", "M^{w}", M_w, _upper_triangle(rows), symmetric=True)


def _by_momenta(doc: Manuscript) -> Rows:
    """Sᵀ P, where P = M S has been printed."""
    S = doc.entries["S"]
    doc.say("In two steps, with the momenta per quasi-velocity $!P=!M\\,!S$,")
    momenta = [sum_of(row, column) for row in doc.entries["M"] for column in zip(*S)]
    doc.matrix("P", r"!P", "P", ca.mtimes(doc.system.M, doc.terms.named("S")), momenta)
    doc.mean(r"!P", "momenta per quasi-velocity, M S")
    columns = list(zip(*doc.entries["P"]))
    return [[sum_of(s, p) for p in columns] for s in zip(*S)]


def _triple_product(S: Rows, M: Rows) -> Rows:
    """Sᵀ M S, its terms collected."""
    columns = list(zip(*S))
    momenta = [[sum_of(row, column) for row in M] for column in columns]
    return [[sympy.expand(sum_of(s, p)) for p in momenta] for s in columns]


def _upper_triangle(rows: Rows) -> list[sympy.Expr]:
    """Row by row, every entry as it stands above the diagonal."""
    n = len(rows)
    return [rows[min(i, j)][max(i, j)] for i in range(n) for j in range(n)]


def _force(doc: Manuscript) -> None:
    """f_w: multiplied out where short, else over the entries of F = Q − h − M σ."""
    f_w = doc.terms.named("f_w")
    short = doc.reader.whole(f_w, SHORT)
    if short is not None:
        doc.say("and the force is")
        force_column(doc, "f_w", "f^{w}", f_w, r"!f_w")
        return
    if not {"M", "S", "h", "Q", "sigma"} <= doc.entries.keys():
        return
    doc.say("and the force, with $!F=!Q-!h-!M\\,!\\sigma$,")
    Q, h, sigma = (_column(doc, name) for name in ("Q", "h", "sigma"))
    F = [x - y - sum_of(row, sigma) for x, y, row in zip(Q, h, doc.entries["M"])]
    doc.vector("F", "F", _force_at_rest(doc), F)
    doc.mean(r"!F", "forces on the generalized velocities where ẇ = 0, Q − h − M σ")
    doc.say("is")
    force = _column(doc, "F")
    doc.vector("f_w", "f^{w}", f_w, [sum_of(s, force) for s in zip(*doc.entries["S"])])


def _column(doc: Manuscript, name: str) -> list[sympy.Expr]:
    return [row[0] for row in doc.entries[name]]


def _solved(doc: Manuscript) -> None:
    """ẇ: a quotient, Cramer's rule for two, elimination for more."""
    if not {"M_w", "f_w"} <= doc.entries.keys():
        return
    if len(doc.w) > MOST_SPEEDS:
        doc.say("These linear equations are solved by an unrolled $!L\\,!D\\,!L^T$ decomposition.")
        return
    M, f = doc.entries["M_w"], _column(doc, "f_w")
    short = doc.reader.whole(doc.terms.wdot, SHORT)
    if short is not None:
        _explicit(doc, "Solved for the accelerations, the explicit equations of motion are")
        _accelerations(doc, short)
    elif _diagonal(M):
        _explicit(doc, "The equations are decoupled, and the explicit equations of motion are")
        _accelerations(doc, [x / M[k][k] for k, x in enumerate(f)])
    elif len(doc.w) == 2:
        _cramer(doc, M, f)
    else:
        _accelerations(doc, Elimination(doc, M, f).accelerations())


def _explicit(doc: Manuscript, several: str) -> None:
    doc.say("The explicit equation of motion is" if len(doc.w) == 1 else several)


def _diagonal(M: Rows) -> bool:
    return all(x == 0 for i, row in enumerate(M) for j, x in enumerate(row) if i != j)


def _cramer(doc: Manuscript, M: Rows, f: Sequence[sympy.Expr]) -> None:
    determinant = doc.notation.fresh("Delta", r"\Delta_{w}")
    doc.say("Solved by Cramer's rule, with the determinant")
    M_w = doc.terms.named("M_w")
    value = M_w[0, 0] * M_w[1, 1] - M_w[0, 1] * M_w[1, 0]
    doc.lines("determinant", [determinant], [M[0][0] * M[1][1] - M[0][1] ** 2], value)
    doc.mean(r"\Delta_{w}", "determinant of the mass matrix of the quasi-velocities")
    doc.say("the explicit equations of motion are")
    first = (M[1][1] * f[0] - M[0][1] * f[1]) / determinant
    second = (M[0][0] * f[1] - M[0][1] * f[0]) / determinant
    _accelerations(doc, [first, second])


def _accelerations(doc: Manuscript, expressions: Sequence[sympy.Expr]) -> None:
    doc.rates = [doc.notation.rate(symbol) for symbol in doc.w]
    doc.lines("wdot", doc.rates, expressions, doc.terms.wdot)
    for symbol, rate in zip(doc.w, doc.rates):
        doc.mean(doc.notation.latex[rate], f"rate of {symbol.name}")
