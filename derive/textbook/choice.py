"""The choice of quasi-velocities and the block inverse that turns it into v = S w + R c (Mirtaheri
& Zohoor)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb

import casadi as ca
import numpy as np
import sympy

from derive.choices.records import Guard
from derive.states.closing import Kinematics
from derive.states.sampling import states
from derive.textbook.author import Author
from derive.textbook.compose import operations
from derive.textbook.records import Math, Text

SAMPLES = 12
MOST_SUBSETS = 300
WRITTEN_OUT = 14  # operations of a sum that is not abbreviated by the symbols of its coefficients


def choice(a: Author) -> None:
    """w = B v, why, the pivots in order and the guards."""
    equations = a.equations
    a.section("Choice of quasi-velocities")
    if a.free_velocities:
        a.say("No choice is made: {reason}.", reason=equations.reason)
        return
    if not a.w:
        a.say("The constraints leave no freedom: there is nothing to choose.")
        return
    nv, nw = len(a.v), len(a.w)
    a.say(
        f"Of the {_counted(nv, 'generalized velocity', 'generalized velocities')}, {_counted(nv - nw, 'is', 'are')} tied by constraints and "
        f"{_counted(nw, 'is', 'are')} free. The free motion is described by {_counted(nw, 'quasi-velocity', 'quasi-velocities')} "
        "$!w=!B\\,!v$, combinations of the generalized velocities that need not be rates of anything "
        "(Kane's generalised speeds). The choice “{name}” was taken because {reason}.",
        name=equations.choice,
        reason=equations.reason,
    )
    units = next(x for x in equations.arguments if x.name == "x").units[len(a.q) :]
    for s, name, unit in zip(a.w, equations.w, units):
        if s not in a.v:
            a.mean(a.names[s], f"quasi-velocity {name}", unit)
    a.mean(r"!w,\; !B", "quasi-velocities, w = B v")
    _rows(a)
    _pivots(a)
    if not _orthonormal(a):
        _guards(a)


def _counted(n: int, one: str, many: str) -> str:
    return f"{n} {one if n == 1 else many}"


def _orthonormal(a: Author) -> bool:
    """B is Sᵀ by construction."""
    B, S = a.named("B"), a.named("S")
    return (
        a.has("Y") and not B.is_constant() and B.shape == S.T.shape and bool(ca.is_equal(B, S.T, 3))
    )


def _rows(a: Author) -> None:
    """The speeds over the generalized velocities."""
    B = a.named("B")
    if _orthonormal(a):
        a.say(
            "The rows of $!B$ are an orthonormal basis of the motions that the constraints allow, so that "
            "$!B=!S^T$; each basis vector is divided by its length, after what it shares with the others was taken away."
        )
        _guards(a)
        a.say("The basis vectors are the columns of")
        if a.matrix("S", r"!S", "S", a.named("S")):
            for table in (a.entries, a.exact):
                table["B"] = [list(column) for column in zip(*table["S"])]
        return
    a.say("The quasi-velocities are")
    if not a.matrix("B", r"!B", "B", B):
        return
    own = [k for k, s in enumerate(a.w) if s not in a.v]
    if own:
        a.say("or, row by row,")
        rows = [shorter(sum_of(a.exact["B"][k], a.v), sum_of(a.entries["B"][k], a.v)) for k in own]
        a.lines("w", [a.w[k] for k in own], rows, a.w_symbols[own])


def _pivots(a: Author) -> None:
    if not a.equations.pivots:
        a.say("No elimination is needed.")
    if not a.equations.pivots or _orthonormal(a):
        return
    a.say(
        "Choosing $!B$ is choosing how to eliminate. Walking from base to tip, each row is solved as soon as all "
        "velocities in it have been reached; in this order"
    )
    a.items((Text(x),) for x in a.equations.pivots)


def _guards(a: Author) -> None:
    """Every function that divides by a pivot watches it."""
    dynamics = a.function("dynamics")
    guards: Sequence[Guard] = dynamics.guards if dynamics else ()
    if not guards:
        if a.equations.pivots:
            a.say(
                "No pivot can vanish, so nothing has to be watched while the motion is integrated."
            )
        return
    a.say(
        "These quantities must stay away from zero; the generated code watches them and reports where they do not:"
    )
    for k, guard in enumerate(guards):
        watched(a, guard, f"D_{{{k + 1}}}")


def watched(a: Author, guard: Guard, latex: str) -> None:
    """A guard and how far from zero it has to stay."""
    symbol = a.fresh(f"{latex}[]", latex)
    found = a.read(ca.SX(guard.value))
    if found is None:
        a.too_long(latex)
        return
    a.lines(f"guard {guard.name}", [symbol], found, ca.SX(guard.value))
    bound = Math(rf"\left|{latex}\right| \ge {power_of_ten(guard.tolerance)}")
    a.say("with {bound} ({name}).", bound=bound, name=guard.name)
    a.reader.name(ca.SX(guard.value), [symbol])
    a.mean(latex, f"guard: {guard.name}")


def power_of_ten(x: float) -> str:
    mantissa, _, exponent = f"{x:.2g}".partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


def inverse(a: Author) -> None:
    """Y = [A; B], its block inverse [R S], and what follows for v and v̇."""
    if a.free_velocities or not a.w:
        return
    a.section("Block inverse")
    if not a.has("Y"):
        a.say("There are no constraint rows, so $!v=!S\\,!w$ with $!S=!B^{-1}$:")
        a.matrix("S", r"!S", "S", a.named("S"))
    else:
        _stacked(a)
        _entries(a)
    a.mean(r"!S", "velocities per quasi-velocity (partial velocities), A S = 0, B S = 1")
    _velocities(a)
    _rates(a)


def _stacked(a: Author) -> None:
    """The partition and the Schur complement, in matrices."""
    A, B = a.named("A"), a.named("B")
    dependent = _dependent(a, A, B)
    free = [j for j in range(len(a.v)) if j not in dependent]
    a.say(
        "Following Mirtaheri and Zohoor, the constraint rows and the speed rows are stacked into one square matrix and inverted "
        "by blocks. It is regular where the pivots above are not zero:"
    )
    a.state(
        r"!Y\,!v",
        r"\begin{bmatrix} !A \\ !B \end{bmatrix} !v = \begin{bmatrix} !c \\ !w \end{bmatrix},"
        r" \qquad !Y^{-1} = \begin{bmatrix} !R & !S \end{bmatrix}",
    )
    a.mean(r"!Y", "constraint rows over speed rows, [A; B]")
    if dropped := len(a.system.rows) - A.size1():
        repeats = _counted(dropped, "row of A repeats", "rows of A repeat")
        if not a.has("E"):
            a.say(f"({repeats} the others and {'is' if dropped == 1 else 'are'} left out here.)")
    a.say(
        "Let {d} be the dependent velocities and {i} the others, and let the columns of $!A=[!A_1\\;!A_2]$ and "
        "$!B=[!B_1\\;!B_2]$ be sorted accordingly. With the Schur complement of $!A_1$,",
        d=Math(r"\mathbf{v}_1=" + _listing(a, dependent)),
        i=Math(r"\mathbf{v}_2=" + _listing(a, free)),
    )
    A1, A2, B1, B2 = A[:, dependent], A[:, free], B[:, dependent], B[:, free]
    schur = B2 - ca.mtimes(B1, ca.solve(A1, A2))
    a.state(r"!S'", r"!B_2 - !B_1\,!A_1^{-1}!A_2")
    a.mean(r"!S'", "Schur complement of A₁ in Y")
    a.say("the blocks of the inverse are, for the velocities in this order,")
    S = ca.vertcat(-ca.mtimes(ca.solve(A1, A2), ca.inv(schur)), ca.inv(schur))
    order = [*dependent, *free]
    a.law(
        "S by blocks",
        r"!S",
        r"\begin{bmatrix} -!A_1^{-1}!A_2 \\ !1 \end{bmatrix} !S'^{-1}",
        a.named("S")[order, :] - S,
    )
    first = ca.vertcat(ca.inv(A1), ca.SX(len(free), len(dependent)))
    a.law(
        "R by blocks",
        r"!R",
        r"\begin{bmatrix} !A_1^{-1} \\ !0 \end{bmatrix} - !S\,!B_1\,!A_1^{-1}",
        a.named("R")[order, :] - first + ca.mtimes(S, ca.mtimes(B1, ca.inv(A1))),
    )


def _listing(a: Author, columns: Sequence[int]) -> str:
    return r"\left(" + r",\, ".join(a.names[a.v[j]] for j in columns) + r"\right)"


def _dependent(a: Author, A: ca.SX, B: ca.SX) -> list[int]:
    """Columns with a regular A₁ at sampled states: those the speeds leave over, else the best
    conditioned ones."""
    nv, nc = A.size2(), A.size1()
    chosen = [a.v.index(s) for s in a.w if s in a.v]
    if len(chosen) == nv - nc:
        return [j for j in range(nv) if j not in chosen]
    sampled = _sampled(a)
    if comb(nv, nc) > MOST_SUBSETS:
        return _greedy(sampled, nc)
    return list(
        max(
            combinations(range(nv), nc),
            key=lambda s: (round(_smallest(sampled, s), 3), [-j for j in s]),
        )
    )


def _sampled(a: Author) -> list[np.ndarray]:
    """A at consistent states, rows scaled to length one."""
    system = a.system
    solver, found = Kinematics(system), states(system, SAMPLES)
    matrices = [solver.velocities(t, q, p)[0] for t, q, p in zip(found.t, found.q, found.p)]
    rows = [A[a.kept] for A in matrices]
    return [A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), 1e-12) for A in rows]


def _smallest(sampled: Sequence[np.ndarray], columns: Sequence[int]) -> float:
    return min(float(np.linalg.svd(A[:, list(columns)])[1][-1]) for A in sampled)


def _greedy(sampled: Sequence[np.ndarray], count: int) -> list[int]:
    """Column by column, the one whose remainder is largest in the worst sample."""
    rest, found = [A.copy() for A in sampled], []
    for _ in range(count):
        sizes = np.min([np.linalg.norm(A, axis=0) for A in rest], axis=0)
        found.append(
            int(
                max(
                    (j for j in range(len(sizes)) if j not in found),
                    key=lambda j: (round(float(sizes[j]), 6), -j),
                )
            )
        )
        units = [A[:, found[-1]] / max(float(np.linalg.norm(A[:, found[-1]])), 1e-12) for A in rest]
        rest = [A - np.outer(e, e @ A) for A, e in zip(rest, units)]
    return sorted(found)


def _entries(a: Author) -> None:
    """S and R as the elimination gives them."""
    A, B, S, R = (a.named(x) for x in "ABSR")
    if "S" not in a.entries:
        a.say("Carried out one row at a time with the pivots above, this gives")
        a.matrix("S", r"!S", "S", S)
    a.say("and, for the multipliers and for constraints that move,")
    a.matrix("R", r"!R", "R", R)
    a.mean(r"!R", "velocities per unit of c, A R = 1, B R = 0")
    one, nothing = ca.SX.eye(A.size1()), ca.SX(A.size1(), B.size1())
    a.say("The inverse can be checked by multiplying out:")
    a.law("A Y⁻¹", r"!A\begin{bmatrix}!R & !S\end{bmatrix}", r"\begin{bmatrix}!1 & !0\end{bmatrix}",
          ca.mtimes(A, ca.horzcat(R, S)) - ca.horzcat(one, nothing))  # fmt: skip
    a.law("B Y⁻¹", r"!B\begin{bmatrix}!R & !S\end{bmatrix}", r"\begin{bmatrix}!0 & !1\end{bmatrix}",
          ca.mtimes(B, ca.horzcat(R, S)) - ca.horzcat(nothing.T, ca.SX.eye(B.size1())))  # fmt: skip


def _velocities(a: Author) -> None:
    """v = S w + R c, row by row."""
    if "S" not in a.entries or ("R" not in a.entries and not a.system.c.is_zero()):
        return
    if a.has("E") and "E" not in a.entries:
        return
    c = a.entries_of_independent("c") if a.has("Y") else []
    rows = [
        shorter(sum_of(a.exact["S"][j], a.w), sum_of(a.entries["S"][j], a.w))
        for j in range(len(a.v))
    ]
    if any(c):
        rows = [x + sum_of(a.entries["R"][j], c) for j, x in enumerate(rows)]
    shown = [j for j, x in enumerate(rows) if x != a.v[j]]
    if shown:
        moving = "" if a.system.c.is_zero() else " + !R\\,!c"
        a.say(f"So the generalized velocities are $!v=!S\\,!w{moving}$, that is")
        a.lines("v", [a.v[j] for j in shown], [rows[j] for j in shown], a.named("v")[shown])


def shorter(exact: sympy.Expr, over_symbols: sympy.Expr) -> sympy.Expr:
    """Written out where that is still short."""
    return exact if operations(exact) <= WRITTEN_OUT else over_symbols


def sum_of(weights: Sequence[sympy.Expr], terms: Sequence[sympy.Expr]) -> sympy.Expr:
    return sympy.Add(*[x * y for x, y in zip(weights, terms)])


def _rates(a: Author) -> None:
    """v̇ = S ẇ + σ, where σ solves Y σ = [β; γ]."""
    sigma = a.named("sigma")
    a.mean(r"!\sigma", "v̇ where ẇ = 0: v̇ = S ẇ + σ")
    if sigma.is_zero():
        a.entries["sigma"] = [[sympy.Integer(0)]] * len(a.v)
        a.say("$!S$ is constant, so the accelerations are $!!v=!S\\,!!w$.")
        return
    gamma = -_along(a, ca.mtimes(a.named("B"), a.system.v))
    turning = not (ca.simplify(gamma).is_zero() or _unit_vector(a))
    a.say(
        "No inverse has to be differentiated for the accelerations: $!!v=!S\\,!!w+!\\sigma$, "
        "where $!\\sigma$ follows from $!A\\,!!v=!\\beta$ with the same inverse"
        + (
            " (a vector of unit length turns at right angles to itself, so the basis adds nothing)"
            if _unit_vector(a)
            else ""
        )
        + (" and from the rates of the speed rows, $!\\gamma=-!!B\\,!v$," if turning else "")
    )
    tied = a.has("Y")
    parts = [r"!R\,!\beta"] * tied + [r"!S\,!\gamma"] * turning
    total = ca.mtimes(a.named("S"), gamma) + (
        ca.mtimes(a.named("R"), a.of_independent(a.system.beta)) if tied else 0
    )
    a.law("sigma by blocks", r"!\sigma", " + ".join(parts), sigma - total)
    _sigma(a, gamma if turning else None)


def _unit_vector(a: Author) -> bool:
    """One orthonormal basis vector and constraints at rest: B v = |s|² w, so Ḃ v is zero."""
    return _orthonormal(a) and len(a.w) == 1 and a.system.c.is_zero()


def _along(a: Author, expression: ca.SX) -> ca.SX:
    """d/dt along the motion."""
    s = a.system
    return ca.jtimes(expression, ca.vertcat(s.t, s.q), ca.vertcat(1, s.qdot))


def _sigma(a: Author, gamma: ca.SX | None) -> None:
    """Entries of σ: whole where short, else over the entries of R, β, S and γ."""
    sigma = a.named("sigma")
    short = a.reader.whole(sigma, 20)
    if short is not None:
        a.say("Its entries are")
        a.vector("sigma", r"\sigma", sigma, short)
        return
    if gamma is not None:
        a.say("Here the rates of the speed rows are")
        if not a.vector("gamma", r"\gamma", gamma):
            return
        a.mean(r"!\gamma", "rates of the speed rows, −Ḃ v")
    needed = ["S", "beta", *(["R"] if a.has("Y") else []), *(["E"] if a.has("E") else [])]
    if all(x in a.entries for x in needed):
        a.say("that is")
        a.vector(
            "sigma",
            r"\sigma",
            sigma,
            [_sigma_entry(a, j, gamma is not None) for j in range(len(a.v))],
        )


def _sigma_entry(a: Author, j: int, turning: bool) -> sympy.Expr:
    gamma = [row[0] for row in a.entries["gamma"]] if turning else []
    beta = a.entries_of_independent("beta") if a.has("Y") else []
    return (sum_of(a.entries["R"][j], beta) if beta else 0) + sum_of(a.entries["S"][j], gamma)
