"""Where every road ends: M_w ẇ + h_w = f_w, with M_w = Sᵀ M S, h_w = Sᵀ (h + M σ), f_w = Sᵀ Q, and
the same solved for ẇ.

Source: Maggi 1896; Kane, Levinson, Dynamics, Theory and Applications, 1985.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import sympy

from derive.textbook.choice import themselves
from derive.textbook.elimination import Elimination
from derive.textbook.forces import balance, column_bias, column_force
from derive.textbook.formulas.compose import operations
from derive.textbook.formulas.layout import Rows, sum_of
from derive.textbook.inverse import accelerations
from derive.textbook.manuscript import Manuscript
from derive.textbook.motion import bias, force_column, held_by_bias
from derive.textbook.names import per_second
from derive.textbook.records import Math

SHORT = 40  # operations of an entry of M_w, h_w or f_w that is printed multiplied out
LONG_SUM = 30  # operations beyond which products of matrices are printed in two steps
MOST_SPEEDS = 6  # more quasi-velocities than this are not solved for on the page
FINAL = r"!M_w\,!!w + !h_w"


def final(doc: Manuscript) -> None:
    """The boxed equations, their entries, and ẇ solved for. Nothing where there is no choice."""
    if doc.equations.generalized_velocities or not doc.w:
        return
    doc.section("Final equations")
    if not doc.system.written:
        doc.say(
            "Written out, the mass matrix would have more entries than can be read: the equations "
            "are solved joint by joint, by the recursion, and never formed."
        )
        return
    doc.say("Collected by the rates of the quasi-velocities, the equations of motion are:")
    doc.law("projected", FINAL, r"!f_w", balance(doc.terms, doc.terms.wdot), boxed=True)
    doc.mean(
        r"!M_w,\; !h_w,\; !f_w",
        "mass matrix, bias and applied force of the quasi-velocities, $!M_w\\,!!w+!h_w=!f_w$",
    )
    if themselves(doc) and not doc.terms.has("Y"):
        _terms_from_above(doc)
    else:
        _projected_terms(doc)
    _solved(doc)


def _terms_from_above(doc: Manuscript) -> None:
    """Where S is one."""
    bias(doc)
    doc.say("They are those from above: $!M_w=!M$, $!h_w=!h$ and $!f_w=!Q$.")
    s = doc.system
    doc.check("M_w law", doc.terms.named("M_w") - s.M)
    doc.check("h_w law", column_bias(doc.terms) - s.h)
    doc.check("f_w law", column_force(doc.terms) - s.Q)
    for name, above in (("M_w", "M"), ("h_w", "h"), ("f_w", "Q")):
        if above in doc.entries:
            doc.entries[name] = doc.entries[above]


def _projected_terms(doc: Manuscript) -> None:
    M, S = doc.system.M, doc.terms.named("S")
    doc.say("The mass matrix of the quasi-velocities is that of the directions $!S$:")
    doc.law("M_w law", r"!M_w", r"!S^T!M\,!S", doc.terms.named("M_w") - ca.mtimes([S.T, M, S]))
    _mass(doc)
    doc.say("The bias collects what is left where $!!w=!0$, the force what is applied:")
    _column_laws(doc)
    _origins(doc)
    _columns(doc)


def _column_laws(doc: Manuscript) -> None:
    """h_w and f_w; that the module's own force is their difference is what the last one checks."""
    h_w, f_w = column_bias(doc.terms), column_force(doc.terms)
    whole = doc.terms.named("f_w") if doc.terms.has("f_w") else f_w - h_w
    doc.law("h_w law", r"!h_w", r"!S^T\left(!h + !M\,!\sigma\right)", f_w - h_w - whole)
    doc.law("f_w law", r"!f_w", r"!S^T!Q", f_w - ca.mtimes(doc.terms.named("S").T, doc.system.Q))


def _origins(doc: Manuscript) -> None:
    """What h and σ are, on roads that did without them so far."""
    if doc.has_told("bias"):
        return
    origins = (
        f"Here $!h$ holds {held_by_bias(doc)}, and $!Q$ what is "
        "applied, each along its generalized velocity"
    )
    doc.mean(r"!M,\; !h,\; !Q", "mass matrix, bias, applied forces")
    if doc.has_told("accelerations"):
        doc.say(f"{origins}.")
        return
    doc.say(f"{origins}; $!\\sigma$ is $!!v$ where $!!w=!0$.")
    doc.mean(r"!\sigma", "accelerations where $!!w=!0$, $!!v=!S\\,!!w+!\\sigma$")


def _mass(doc: Manuscript) -> None:
    """M_w: multiplied out where short, else over the entries of M and S."""
    M_w = doc.terms.named("M_w")
    short = doc.reader.whole(M_w, SHORT)
    if short is not None:
        doc.matrix("M_w", r"!M_w", "M^{w}", M_w, short, symmetric=True)
        return
    if not {"M", "S"} <= doc.entries.keys():
        doc.too_long(r"\mathbf{M}_w")
        return
    rows = _triple_product(doc.entries["S"], doc.entries["M"])
    if max(operations(x) for row in rows for x in row) > LONG_SUM:
        rows = _by_momenta(doc)
    doc.say("Over the entries above it is:")
    doc.matrix("M_w", r"!M_w", "M^{w}", M_w, _upper_triangle(rows), symmetric=True)


def _by_momenta(doc: Manuscript) -> Rows:
    """Sᵀ P, where P = M S has been printed."""
    S = doc.entries["S"]
    doc.say("In two steps, the momenta per quasi-velocity are $!P=!M\\,!S$:")
    momenta = [sum_of(row, column) for row in doc.entries["M"] for column in zip(*S)]
    doc.matrix("P", r"!P", "P", ca.mtimes(doc.system.M, doc.terms.named("S")), momenta)
    doc.mean(r"!P", "momenta per quasi-velocity, $!M\\,!S$")
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


def _columns(doc: Manuscript) -> None:
    """h_w and f_w: multiplied out where short, else over the entries of h, M, σ and Q."""
    h_w, f_w = column_bias(doc.terms), column_force(doc.terms)
    short = doc.reader.whole(h_w, SHORT)
    if short is None:
        accelerations(doc)
        bias(doc)
        _bias_in_steps(doc, h_w)
    elif doc.vector("h_w", "h^{w}", h_w, short):
        _said_if_none(doc, "h_w", r"!h_w")
    short = doc.reader.whole(f_w, SHORT)
    if short is not None:
        force_column(doc, "f_w", "f^{w}", f_w, r"!f_w", short)
    elif {"S", "Q"} <= doc.entries.keys():
        force = _column(doc, "Q")
        doc.vector("f_w", "f^{w}", f_w, [sum_of(s, force) for s in zip(*doc.entries["S"])])


def _said_if_none(doc: Manuscript, name: str, bold: str) -> None:
    if all(row[0] == 0 for row in doc.entries[name]):
        doc.say(f"${bold}=!0$: there is none.")


def _bias_in_steps(doc: Manuscript, h_w: ca.SX) -> None:
    """Over h_σ = h + M σ."""
    if not {"M", "S", "h", "sigma"} <= doc.entries.keys():
        doc.too_long(r"\mathbf{h}_w")
        return
    doc.say(
        "In two steps, the bias where $!!w=!0$ is $!h_\\sigma=!h+!M\\,!\\sigma$, and "
        "$!h_w=!S^T!h_\\sigma$:"
    )
    h, sigma = _column(doc, "h"), _column(doc, "sigma")
    bias = [x + sum_of(row, sigma) for x, row in zip(h, doc.entries["M"])]
    s = doc.system
    value = s.h + ca.mtimes(s.M, doc.terms.named("sigma"))
    doc.vector("h_sigma", r"h^{\sigma}", value, bias)
    doc.mean(r"!h_\sigma", "bias in the generalized velocities where $!!w=!0$, $!h+!M\\,!\\sigma$")
    at_rest = _column(doc, "h_sigma")
    doc.vector("h_w", "h^{w}", h_w, [sum_of(s, at_rest) for s in zip(*doc.entries["S"])])


def _column(doc: Manuscript, name: str) -> list[sympy.Expr]:
    return [row[0] for row in doc.entries[name]]


def _solved(doc: Manuscript) -> None:
    """ẇ: a quotient, Cramer's rule for two, elimination for more."""
    if not {"M_w", "h_w", "f_w"} <= doc.entries.keys() or len(doc.w) > MOST_SPEEDS:
        doc.say(
            "Solved for $!!w$ by a symmetric decomposition, $!M_w=!L\\,!D\\,!L^T$, the equations "
            "of motion are explicit:"
        )
        residual = balance(doc.terms, doc.terms.wdot)
        doc.law("explicit", r"!!w", r"!M_w^{-1}\left(!f_w - !h_w\right)", residual, boxed=True)
        return
    M = doc.entries["M_w"]
    f = [x - y for x, y in zip(_column(doc, "f_w"), _column(doc, "h_w"))]
    # where the bias took two steps, its quotient is longer still
    short = None if "h_sigma" in doc.entries else doc.reader.whole(doc.terms.wdot, SHORT)
    if short is not None:
        _explicit(doc, "Solved for the accelerations, the explicit equations of motion are:")
        _accelerations(doc, short)
    elif _diagonal(M):
        _explicit(doc, "The equations are decoupled. Solved for the accelerations they are:")
        _accelerations(doc, [x / M[k][k] for k, x in enumerate(f)])
    elif len(doc.w) == 2:
        _cramer(doc, M, f)
    else:
        _accelerations(doc, Elimination(doc, M, f).accelerations())


def _explicit(doc: Manuscript, several: str) -> None:
    doc.say("The explicit equation of motion is:" if len(doc.w) == 1 else several)


def _diagonal(M: Rows) -> bool:
    return all(x == 0 for i, row in enumerate(M) for j, x in enumerate(row) if i != j)


def _cramer(doc: Manuscript, M: Rows, f: Sequence[sympy.Expr]) -> None:
    determinant = doc.notation.fresh("Delta", r"\Delta_{w}")
    doc.say("Cramer's rule solves them, with the determinant:")
    M_w = doc.terms.named("M_w")
    value = M_w[0, 0] * M_w[1, 1] - M_w[0, 1] * M_w[1, 0]
    doc.lines("determinant", [determinant], [M[0][0] * M[1][1] - M[0][1] ** 2], value)
    latex = doc.notation.latex[determinant]
    doc.mean(latex, "determinant of the mass matrix of the quasi-velocities")
    doc.say("The explicit equations of motion are:")
    first = (M[1][1] * f[0] - M[0][1] * f[1]) / determinant
    second = (M[0][0] * f[1] - M[0][1] * f[0]) / determinant
    _accelerations(doc, [first, second])


def _accelerations(doc: Manuscript, expressions: Sequence[sympy.Expr]) -> None:
    doc.rates = [doc.notation.rate(symbol) for symbol in doc.w]
    doc.lines("wdot", doc.rates, expressions, doc.terms.wdot, boxed=True)
    units = doc.equations.argument("x").units[doc.equations.speeds]
    for symbol, rate, unit in zip(doc.w, doc.rates, units):
        of = Math(doc.notation.latex[symbol])
        doc.mean(doc.notation.latex[rate], "rate of {of}", per_second(unit), of=of)
