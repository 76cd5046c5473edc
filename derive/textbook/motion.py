"""Energies, the equations of motion before and after projection, and the multipliers."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import sympy

from derive.mechanics.motion import Numbers
from derive.mechanics.tree import kinetic_energy
from derive.textbook import names
from derive.textbook.author import Author, Rows
from derive.textbook.choice import sum_of
from derive.textbook.compose import operations
from derive.textbook.kinematics import Component, numbers_in_symbols
from derive.textbook.records import Math, Text

SHORT = 40  # operations of an entry of M_w or f_w that is printed multiplied out
LONG_SUM = 30  # operations beyond which products of matrices are printed in two steps
MOST_SPEEDS = 6  # more quasi-velocities than this are not solved for on the page


def energies(a: Author, found: Sequence[Component]) -> None:
    """T and V."""
    system = a.system
    a.section("Energies")
    a.say("The kinetic energy" + (" of all links is" if _by_links(a, found) else " is"))
    if _by_links(a, found):
        _kinetic(a, numbers_in_symbols(system, found))
    else:
        a.scalar("T", "T", system.T, "kinetic energy", "J")
    if system.V.is_zero():
        a.say("There is no potential energy.")
    else:
        a.say(
            "and the potential energy of gravity and springs is"
            if system.links
            else "and the potential energy is"
        )
        a.scalar("V", "V", system.V, "potential energy", "J")


def _by_links(a: Author, found: Sequence[Component]) -> bool:
    """Whether all energy is that of links, and all their twists have been printed."""
    shown = {symbol for formula in a.printed for symbol in formula.left}
    only_links = a.system.M_extra.nnz() == 0 and a.system.model.kinetic is None
    return bool(found) and only_links and all(x.symbol in shown for x in found)


def _kinetic(a: Author, numbers: Sequence[Numbers]) -> None:
    """Over the links' twists, one after the other."""
    system = a.system
    parts = [a.reader.whole(ca.SX(kinetic_energy([x], [n]))) for x, n in zip(system.links, numbers)]
    whole = [x[0] for x in parts if x is not None]
    if len(whole) < len(parts):
        a.scalar("T", "T", system.T, "kinetic energy", "J")
        return
    a.mean("T", "kinetic energy", "J")
    symbol, total = a.fresh("T", "T"), sympy.Add(*whole)
    a.lines("T", [symbol], [total], ca.SX(system.T))


def unprojected(a: Author) -> None:
    """M, h, Q: one equation for every generalized velocity."""
    system = a.system
    a.section("Equations of motion")
    forces = (
        ", with the multipliers $!\\lambda$ as forces along the constraint rows,"
        if system.rows
        else ""
    )
    a.say(f"Collected for the generalized velocities, the equations of motion are{forces}")
    left = r"!M\,!!v + !h"
    right = r"!Q" + (r" + !A^T!\lambda" if system.rows else "")
    a.law("motion", left, right, _balance(a))
    origin = " (composite bodies, Walker and Orin)" if system.links else ""
    a.say(f"The mass matrix{origin} is symmetric, with $T=\\tfrac{{1}}{{2}}\\,!v^T!M\\,!v$:")
    a.matrix("M", r"!M", "M", system.M, symmetric=True)
    origin = (
        " (Newton and Euler's equations from tip to base with $!!v=!0$)" if system.links else ""
    )
    a.say(f"The bias $!h$ collects velocity products, gravity and potential forces{origin}:")
    _vector(a, "h", "h", system.h, r"!h")
    a.say("The applied forces are")
    _vector(a, "Q", "Q", system.Q, r"!Q")
    a.mean(r"!M,\; !h,\; !Q", "mass matrix, bias, applied forces: M v̇ + h = Q + Aᵀ λ")


def _vector(a: Author, name: str, stem: str, value: ca.SX, bold: str) -> None:
    if a.vector(name, stem, value) and all(row[0] == 0 for row in a.entries[name]):
        a.say(f"${bold}=!0$: there are none.")


def _balance(a: Author) -> ca.SX:
    """M v̇ + h − Q − Aᵀ λ."""
    s = a.system
    constraint = ca.mtimes(s.A.T, a.lam) if s.rows else 0
    return ca.mtimes(s.M, a.vdot) + s.h - s.Q - constraint


def bordered(a: Author) -> None:
    """The augmented system: Lagrange's equations of the first kind."""
    s = a.system
    a.say(
        "Together with the constraints they are one bordered system, solved for accelerations and multipliers at once:"
    )
    if not s.rows:
        a.law("solved", r"!M\,!!v", r"!Q - !h", _balance(a))
        return
    residual = ca.vertcat(_balance(a), ca.mtimes(s.A, a.vdot) - s.beta)
    a.law(
        "bordered system",
        r"\begin{bmatrix} !M & -!A^T \\ !A & !0 \end{bmatrix}"
        r"\begin{bmatrix} !!v \\ !\lambda \end{bmatrix}",
        r"\begin{bmatrix} !Q - !h \\ !\beta \end{bmatrix}",
        residual,
    )


def projected(a: Author) -> None:
    """(Sᵀ M S) ẇ = Sᵀ (Q − h − M σ)."""
    if not a.w:
        return
    s, S = a.system, a.named("S")
    a.section("Equations without multipliers")
    a.say(
        "Since $!A\\,!S=!0$, multiplying from the left by $!S^T$ removes the multipliers "
        "(Maggi's equations; the columns of $!S$ are Kane's partial velocities):"
        if a.has("Y")
        else "Multiplying from the left by $!S^T$ carries the equations over to the quasi-velocities (Maggi, Kane):"
    )
    a.law("projected", r"!M_w\,!!w", r"!f_w", ca.mtimes(a.named("M_w"), a.wdot) - a.named("f_w"))
    a.say("with the mass matrix and the force of the quasi-velocities")
    a.law(
        "M_w",
        r"!M_w",
        r"!S^T!M\,!S",
        a.named("M_w") - ca.mtimes(S.T, ca.mtimes(s.M, S)),
    )
    force = s.Q - s.h - ca.mtimes(s.M, a.named("sigma"))
    law = r"!S^T\left(!Q - !h - !M\,!\sigma\right)"
    a.law("f_w", r"!f_w", law, a.named("f_w") - ca.mtimes(S.T, force))
    a.mean(r"!M_w,\; !f_w", "mass matrix and force of the quasi-velocities: M_w ẇ = f_w")
    _mass(a)
    _force(a)
    _solved(a)


def _mass(a: Author) -> None:
    M_w = a.named("M_w")
    short = a.reader.whole(M_w, SHORT)
    if short is not None:
        a.say("Multiplied out, the mass matrix is")
        a.matrix("M_w", r"!M_w", "M^{w}", M_w, short, symmetric=True)
        return
    if not {"M", "S"} <= a.entries.keys():
        return
    found = _triple(a.entries["S"], a.entries["M"])
    if max(operations(x) for row in found for x in row) > LONG_SUM:
        a.say("In two steps, with the momenta per quasi-velocity $!P=!M\\,!S$,")
        P = [[sum_of(row, column) for column in zip(*a.entries["S"])] for row in a.entries["M"]]
        a.matrix(
            "P", r"!P", "P", ca.mtimes(a.system.M, a.named("S")), [x for row in P for x in row]
        )
        a.mean(r"!P", "momenta per quasi-velocity, M S")
        found = [[sum_of(c, d) for d in zip(*a.entries["P"])] for c in zip(*a.entries["S"])]
    a.say("Written out over the entries above, the mass matrix is")
    n = len(found)
    a.matrix(
        "M_w",
        r"!M_w",
        "M^{w}",
        M_w,
        [found[min(i, j)][max(i, j)] for i in range(n) for j in range(n)],
        symmetric=True,
    )


def _triple(S: Rows, M: Rows) -> Rows:
    """Sᵀ M S, its terms collected."""
    columns = list(zip(*S))
    return [
        [sympy.expand(sum_of(x, [sum_of(row, y) for row in M])) for y in columns] for x in columns
    ]


def _force(a: Author) -> None:
    f_w = a.named("f_w")
    short = a.reader.whole(f_w, SHORT)
    if short is not None:
        a.say("and the force is")
        _vector(a, "f_w", "f^{w}", f_w, r"!f_w")
        return
    if not {"M", "S", "h", "Q", "sigma"} <= a.entries.keys():
        return
    s = a.system
    a.say("and the force, with $!F=!Q-!h-!M\\,!\\sigma$,")
    Q, h, sigma = ([row[0] for row in a.entries[x]] for x in ("Q", "h", "sigma"))
    F = [x - y - sum_of(row, sigma) for x, y, row in zip(Q, h, a.entries["M"])]
    a.vector("F", "F", s.Q - s.h - ca.mtimes(s.M, a.named("sigma")), F)
    a.mean(r"!F", "forces on the generalized velocities where ẇ = 0, Q − h − M σ")
    a.say("is")
    a.vector(
        "f_w",
        "f^{w}",
        f_w,
        [sum_of(c, [row[0] for row in a.entries["F"]]) for c in zip(*a.entries["S"])],
    )


def _solved(a: Author) -> None:
    """ẇ: a quotient, Cramer's rule for two, elimination for more."""
    if not {"M_w", "f_w"} <= a.entries.keys():
        return
    M, f, n = a.entries["M_w"], [row[0] for row in a.entries["f_w"]], len(a.w)
    if n > MOST_SPEEDS:
        a.say("These linear equations are solved by an unrolled $!L\\,!D\\,!L^T$ decomposition.")
        return
    short = a.reader.whole(a.wdot, SHORT)
    if short is not None:
        a.say(
            "The explicit equation of motion is"
            if n == 1
            else "Solved for the accelerations, the explicit equations of motion are"
        )
        return _accelerations(a, short)
    if _diagonal(M):
        a.say(
            "The explicit equation of motion is"
            if n == 1
            else "The equations are decoupled, and the explicit equations of motion are"
        )
        return _accelerations(a, [x / M[k][k] for k, x in enumerate(f)])
    if n == 2:
        return _cramer(a, M, f)
    _decomposed(a, M, f)


def _diagonal(M: Rows) -> bool:
    return all(x == 0 for i, row in enumerate(M) for j, x in enumerate(row) if i != j)


def _cramer(a: Author, M: Rows, f: list[sympy.Expr]) -> None:
    determinant = a.fresh("Delta", r"\Delta_{w}")
    a.say("Solved by Cramer's rule, with the determinant")
    M_w = a.named("M_w")
    value = M_w[0, 0] * M_w[1, 1] - M_w[0, 1] * M_w[1, 0]
    a.lines("determinant", [determinant], [M[0][0] * M[1][1] - M[0][1] ** 2], value)
    a.mean(r"\Delta_{w}", "determinant of the mass matrix of the quasi-velocities")
    a.say("the explicit equations of motion are")
    _accelerations(
        a,
        [
            (M[1][1] * f[0] - M[0][1] * f[1]) / determinant,
            (M[0][0] * f[1] - M[0][1] * f[0]) / determinant,
        ],
    )


def _accelerations(a: Author, found: list[sympy.Expr]) -> None:
    a.rates = [a.fresh(f"rate[{s.name}]", names.dotted(a.names[s])) for s in a.w]
    a.lines("wdot", a.rates, found, a.wdot)
    for s, rate in zip(a.w, a.rates):
        a.mean(a.names[rate], f"rate of {s.name}")


def _decomposed(a: Author, M: Rows, f: list[sympy.Expr]) -> None:
    """Symmetric elimination M = L D Lᵀ, last quasi-velocity first, in named steps."""
    a.say(
        "Solved by symmetric elimination, $!M_w=!L\\,!D\\,!L^T$ from the last quasi-velocity to the first, "
        "with pivots $\\delta_k$, factors $\\ell_{ik}$ and right-hand sides $\\eta_k$:"
    )
    n = len(f)
    steps = _Steps(a)
    A, b = [list(row) for row in M], list(f)
    values, sides = (
        [[a.named("M_w")[i, j] for j in range(n)] for i in range(n)],
        [a.named("f_w")[i] for i in range(n)],
    )
    factors: dict[tuple[int, int], sympy.Expr] = {}
    for k in reversed(range(n)):
        A[k][k] = steps.named(f"delta[{k + 1}]", rf"\delta_{{{k + 1}}}", A[k][k], values[k][k])
        b[k] = steps.named(f"eta[{k + 1}]", rf"\eta_{{{k + 1}}}", b[k], sides[k])
        for i in range(k):
            factor, exact = A[i][k] / A[k][k], values[i][k] / values[k][k]
            factors[i, k] = steps.named(
                f"l[{i + 1},{k + 1}]", rf"\ell_{{{i + 1}{k + 1}}}", factor, exact
            )
            b[i], sides[i] = b[i] - factors[i, k] * b[k], sides[i] - exact * sides[k]
            for j in range(i, k):
                A[i][j] = A[j][i] = A[i][j] - factors[i, k] * A[j][k]
                values[i][j] = values[j][i] = values[i][j] - exact * values[j][k]
    steps.show()
    a.mean(
        r"\delta_{k},\; \ell_{ik},\; \eta_{k}",
        "pivots, factors and right-hand sides of the elimination of M_w",
    )
    a.say("and the explicit equations of motion are, one after the other,")
    rates = [a.fresh(f"rate[{s.name}]", names.dotted(a.names[s])) for s in a.w]
    _accelerations(
        a, [b[k] / A[k][k] - sum_of([factors[i, k] for i in range(k)], rates[:k]) for k in range(n)]
    )


class _Steps:
    """Named steps of an elimination, shown together."""

    def __init__(self, author: Author) -> None:
        self.author = author
        self.found: list[tuple[sympy.Symbol, sympy.Expr, ca.SX]] = []

    def named(self, name: str, latex: str, x: sympy.Expr, value: ca.SX) -> sympy.Expr:
        """A symbol for x, or x itself where it is a number or a symbol."""
        if x.is_Number or x.is_Symbol:
            return x
        symbol = self.author.fresh(name, latex)
        self.found.append((symbol, x, value))
        return symbol

    def show(self) -> None:
        if self.found:
            symbols, shown, values = zip(*self.found)
            self.author.lines("elimination", symbols, shown, ca.vertcat(*values))


def multipliers(a: Author) -> None:
    """λ = Rᵀ (M v̇ + h − Q)."""
    system = a.system
    if not system.rows:
        return
    a.section("Multipliers")
    a.mean(r"!\lambda", "multipliers, forces along the constraint rows: M v̇ + h = Q + Aᵀ λ")
    if a.free_velocities:
        a.say("The multipliers are part of the solution of the bordered system.")
        return
    a.say(
        "The multipliers are not needed for the motion; they are recovered afterwards. What the constraints have to add is "
        "$!\\rho=!M\\,!!v+!h-!Q$, and since $!A\\,!R=!1$,"
    )
    rho = ca.mtimes(system.M, a.vdot) + system.h - system.Q
    if a.has("E"):
        a.law(
            "lambda",
            r"!\lambda",
            r"!E^T!R^T!\rho",
            a.lam - ca.mtimes(a.named("E").T, ca.mtimes(a.named("R").T, rho)),
        )
    else:
        a.law("lambda", r"!\lambda", r"!R^T!\rho", a.lam[a.kept] - ca.mtimes(a.named("R").T, rho))
    a.table(
        ("multiplier", "constraint row"), [_row(i, row.name) for i, row in enumerate(system.rows)]
    )
    if a.has("E"):
        a.say(
            "Of rows that repeat each other these are, of all multipliers with the same $!A^T!\\lambda$, the least."
        )
        return
    if len(a.kept) < len(system.rows):
        a.say("The multipliers of rows that repeat others are zero.")
    if {"M", "S", "R", "h", "Q", "sigma"} <= a.entries.keys() and (a.rates or not a.w):
        _recovered(a, rho)


def _row(i: int, name: str) -> tuple:
    return (Math(rf"\lambda_{{{i + 1}}}"),), (Text(name),)


def _recovered(a: Author, rho: ca.SX) -> None:
    """v̇, ρ and λ, entry by entry."""
    sigma, h, Q = ([row[0] for row in a.entries[x]] for x in ("sigma", "h", "Q"))
    found = [sum_of(row, a.rates) + x for row, x in zip(a.entries["S"], sigma)]
    rates = [_rate(a, j) for j in range(len(a.v))]
    own = [j for j, s in enumerate(rates) if s not in a.rates]
    if own:
        a.say("Written out, the accelerations are")
        a.lines("vdot", [rates[j] for j in own], [found[j] for j in own], a.vdot[own])
    vdot = [x if x in a.rates or found[j] != 0 else sympy.Integer(0) for j, x in enumerate(rates)]
    a.say("the forces that are missing are")
    a.vector(
        "rho", r"\rho", rho, [sum_of(row, vdot) + x - y for row, x, y in zip(a.entries["M"], h, Q)]
    )
    a.mean(r"!\rho", "forces of the constraints on the generalized velocities, M v̇ + h − Q")
    a.say("and the multipliers are")
    column = [row[0] for row in a.entries["rho"]]
    symbols = [a.fresh(f"lam[{i + 1}]", rf"\lambda_{{{i + 1}}}") for i in a.kept]
    a.lines("lam", symbols, [sum_of(c, column) for c in zip(*a.entries["R"])], a.lam[a.kept])


def _rate(a: Author, j: int) -> sympy.Symbol:
    return a.fresh(f"rate[{a.v[j].name}]", names.dotted(a.names[a.v[j]]))


def power(a: Author) -> None:
    """d(T + V)/dt = P."""
    a.section("Energy and power")
    found, integral = a.function("power"), not a.system.homogeneous
    if integral:
        a.say(
            "The kinetic energy has terms that are linear in the rates or free of them. What is in "
            "balance is therefore Jacobi's integral, without the former and with the latter "
            "reversed,"
        )
        a.scalar("H", "H", a.system.energy, "Jacobi's integral", "J")
    a.say("Along a motion " + ("it" if integral else "the energy")
        + " changes by the power of the forces that have no potential" + (
        ", and of constraints that move:" if not a.system.c.is_zero() else ":"))  # fmt: skip
    right = r"P" + ("" if a.system.c.is_zero() else r" + !\lambda^T!c")
    rate = _energy_rate(a)
    moving = ca.dot(a.lam, a.system.c) if a.system.rows else 0
    left = r"\frac{\mathrm{d}}{\mathrm{d}t}" + ("H" if integral else r"\left(T+V\right)")
    if found is None:
        a.state(left, right)
    else:
        a.law("power", left, right, rate - a.system.power - moving)
    if a.system.power.is_zero():
        conserved = "Jacobi's integral" if integral else "the energy"
        still = a.system.c.is_zero()
        a.say(f"Here $P=0$: {conserved} is conserved." if still else "Here $P=0$.")
        return
    a.say("with the power")
    a.scalar("P", "P", a.system.power, "power of the forces without potential", "W")


def _energy_rate(a: Author) -> ca.SX:
    """d(T + V)/dt, or that of Jacobi's integral, with v̇ from the equations."""
    s = a.system
    total = s.energy
    return ca.jtimes(total, ca.vertcat(s.t, s.q), ca.vertcat(1, s.qdot)) + ca.jtimes(
        total, s.v, a.vdot
    )


def outputs(a: Author) -> None:
    if not a.system.outputs:
        return
    a.section("Outputs")
    a.say("The model's outputs are")
    for name, value, unit in a.system.outputs:
        rows = [row.name for row in a.system.rows]
        if ca.depends_on(value, a.system.symbols.reactions(rows)):
            shown = [row for row in rows if ca.depends_on(value, a.system.symbols.reactions([row]))]
            a.say(
                "{name}: the multipliers $!\\lambda$ of {rows};", name=name, rows=", ".join(shown)
            )
            continue
        count = value.numel()
        labels = (
            [names.symbol(name)]
            if count == 1
            else [f"{names.upright(name)}_{{{k + 1}}}" for k in range(count)]
        )
        symbols = [a.fresh(f"output {name}[{k + 1}]", latex) for k, latex in enumerate(labels)]
        found = a.read(value)
        if found is None:
            a.too_long(labels[0])
        else:
            a.lines(f"output {name}", symbols, found, ca.densify(value))
        for latex in labels:
            a.mean(latex, f"output {name}", unit)
