"""The choice of quasi-velocities: w = B v, why, the pivots in their order and their guards."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import casadi as ca
import sympy

from derive.choices.records import Guard
from derive.model.constraint_records import Rolling
from derive.textbook.formulas.compose import operations
from derive.textbook.formulas.layout import Rows, ends, identity, sum_of
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words
from derive.textbook.records import Math, Run, Runs, Text

WRITTEN_OUT = 14  # operations of a sum that is not abbreviated by the symbols of its coefficients
DEEP = 3  # levels down to which B and Sᵀ are compared


def choice(doc: Manuscript) -> None:
    """w = B v, why, the pivots in order and the guards."""
    doc.section("Choice of quasi-velocities")
    if doc.equations.generalized_velocities:
        doc.say("No choice is made: {reason}.", reason=doc.equations.reason)
        return
    if not doc.w:
        _nothing(doc)
        return
    _reason(doc)
    _meanings(doc)
    if themselves(doc):
        doc.say("They are the generalized velocities themselves: $!w=!v$ and $!B=!1$.")
        doc.entries["B"] = doc.exact["B"] = identity(len(doc.v))
    elif orthonormal(doc):
        _basis(doc)
    else:
        _rows(doc)
    _pivots(doc)
    if not orthonormal(doc):
        _guards(doc)


def _nothing(doc: Manuscript) -> None:
    """Without freedom the constraints say all of the motion, and no equation of it is solved."""
    doc.say(
        "The constraints leave no freedom: there is nothing to choose. The generalized velocities "
        "and accelerations follow from the constraints alone, $!v=!A^+!c$ and $!!v=!A^+!\\beta$, "
        "with the pseudo-inverse $!A^+$, which is $!A^{-1}$ where no row repeats others."
    )
    doc.mean(r"!A^+", "pseudo-inverse of the constraint rows, which have full column rank")


def _reason(doc: Manuscript) -> None:
    nv, nw = len(doc.v), len(doc.w)
    what = "combinations of the generalized velocities that need not be rates of anything"
    if nw == 1:
        what = "a combination of the generalized velocities that need not be a rate of anything"
    every = _counted(nv, "generalized velocity", "generalized velocities")
    free = f"Of the {every}, {_counted(nv - nw, 'is', 'are')} tied by constraints and "
    free += f"{_counted(nw, 'is', 'are')} free."
    if nv == nw:
        free = "No constraint ties the generalized velocities; all are free."
    doc.say(
        f"{free} The free motion is described by "
        f"{_counted(nw, 'quasi-velocity', 'quasi-velocities')} $!w=!B\\,!v$, {what} "
        "(Kane's generalised speeds). The choice “{name}” was taken because {reason}.",
        name=doc.equations.choice,
        reason=doc.equations.reason,
    )


def _meanings(doc: Manuscript) -> None:
    """Of the quasi-velocities that are no generalized velocities."""
    state = doc.equations.argument("x")
    units = state.units[len(doc.q) :]
    for symbol, name, unit in zip(doc.w, doc.equations.w, units):
        if symbol not in doc.v:
            doc.mean(doc.notation.latex[symbol], "quasi-velocity {name}", unit, name=name)
    doc.mean(r"!w,\; !B", "quasi-velocities and their rows, $!w=!B\\,!v$")


def _counted(n: int, one: str, many: str) -> str:
    return f"{n} {one if n == 1 else many}"


def themselves(doc: Manuscript) -> bool:
    """Whether the quasi-velocities are the generalized velocities, in their order."""
    return doc.w == doc.v


def orthonormal(doc: Manuscript) -> bool:
    """Whether B is Sᵀ by construction."""
    B, S = doc.terms.named("B"), doc.terms.named("S")
    if not doc.terms.has("Y") or B.is_constant() or B.shape != S.T.shape:
        return False
    return bool(ca.is_equal(B, S.T, DEEP))


def _basis(doc: Manuscript) -> None:
    """An orthonormal basis, printed as the columns of S."""
    doc.say(
        "The rows of $!B$ are an orthonormal basis of the motions that the constraints allow, "
        "so that $!B=!S^T$; each basis vector is divided by its length, after what it shares "
        "with the others was taken away."
    )
    _guards(doc)
    doc.say("The basis vectors are the columns of:")
    if doc.matrix("S", r"!S", "S", doc.terms.named("S")):
        doc.entries["B"] = transposed(doc.entries["S"])
        doc.exact["B"] = transposed(doc.exact["S"])


def transposed(rows: Rows) -> Rows:
    """Columns as rows."""
    return [list(column) for column in zip(*rows)]


def _rows(doc: Manuscript) -> None:
    """The speeds over the generalized velocities."""
    listing = Math(",\\; ".join(doc.notation.latex[symbol] for symbol in doc.w))
    what = "The quasi-velocity {w} is" if len(doc.w) == 1 else "The quasi-velocities {w} are"
    doc.say(f"{what} $!w=!B\\,!v$, with:", w=listing)
    if not doc.matrix("B", r"!B", "B", doc.terms.named("B")):
        return
    own = [k for k, symbol in enumerate(doc.w) if symbol not in doc.v]
    if own:
        doc.say("Written out:")
        rows = [product_entry(doc, "B", k, doc.v) for k in own]
        doc.lines("w", [doc.w[k] for k in own], rows, doc.terms.w[own])


def product_entry(doc: Manuscript, matrix: str, k: int, column: Sequence[sympy.Expr]) -> sympy.Expr:
    """Entry k of matrix · column: written out where that is still short, else over the symbols of
    the matrix's entries."""
    exact = sum_of(doc.exact[matrix][k], column)
    return exact if operations(exact) <= WRITTEN_OUT else sum_of(doc.entries[matrix][k], column)


def _pivots(doc: Manuscript) -> None:
    if not doc.equations.pivots:
        if not themselves(doc):
            doc.say("No elimination is needed.")
        return
    if orthonormal(doc):
        return
    doc.say(
        "Choosing $!B$ is choosing how to eliminate. From base to tip, each row of $!A$ and $!B$ "
        "is solved as soon as all velocities in it have been reached. It gives one of them, "
        "divided by the factor of that velocity, which is called the pivot. In this order:"
    )
    doc.items(doc.equations.pivots, lambda x: _with_symbols(doc, x))
    if any("sampled" in x for x in doc.equations.pivots):
        doc.say("Sampled states are random states that the constraints admit.")
    contacts = [words(x.name) for x in doc.system.model.constraints if isinstance(x, Rolling)]
    told = words(" ".join(doc.equations.pivots))
    if any(f"{name} {axis}" in told for name in contacts for axis in "xyz"):
        doc.say(
            "Of a contact x, y and z are the components of its velocity along the axes of the "
            "body. All three are zero, which is what its rows, normal, forward and sideways, say "
            "together; in these axes the pivots are simpler."
        )


def _with_symbols(doc: Manuscript, text: str) -> Runs:
    """A sentence in which velocities are called as the file calls them."""
    velocities = zip((x.name for x in doc.system.model.velocities), doc.v)
    symbols = dict(velocities) | dict(zip(doc.equations.w, doc.w))
    known = "|".join(re.escape(name) for name in sorted(symbols, key=len, reverse=True))
    pieces = re.split(rf"(?<![\w.])({known})(?![\w.(])", text) if known else [text]
    return tuple(
        Math(doc.notation.latex[symbols[piece]]) if k % 2 else Text(words(piece))
        for k, piece in enumerate(pieces)
        if piece
    )


def _guards(doc: Manuscript) -> None:
    """Every function that divides by a pivot watches it."""
    dynamics = doc.terms.function("dynamics")
    guards: Sequence[Guard] = dynamics.guards if dynamics else ()
    if not guards:
        if doc.equations.pivots:
            doc.say(
                "No pivot can vanish, so nothing has to be watched while the motion is integrated."
            )
        return
    doc.say(
        "These quantities must stay away from zero; the generated code watches them and reports "
        "where they do not:"
    )
    watch(doc, guards, lambda k: f"D_{{{k}}}")


def watch(doc: Manuscript, guards: Sequence[Guard], latex: Callable[[int], str]) -> None:
    """Each guard and how far from zero it has to stay; the first of very many. `latex` is the
    symbol of guard 1, 2 …"""
    first, left_out, last = ends(guards)
    for k, guard in enumerate(first, 1):
        _watched(doc, guard, latex(k))
    if left_out:
        doc.say(f"The other {left_out + len(last)} are watched in the same way.")


def _watched(doc: Manuscript, guard: Guard, latex: str) -> None:
    symbol = doc.notation.fresh(f"{latex}[]", latex)
    latex = doc.notation.latex[symbol]
    entries = doc.read(ca.SX(guard.value))
    if entries is None:
        doc.too_long(latex)
        return
    doc.lines(f"guard {guard.name}", [symbol], entries, ca.SX(guard.value))
    bound = Math(rf"\left|{latex}\right| \ge {power_of_ten(guard.tolerance)}")
    text: list[Run] = [Text("It has to satisfy "), bound, Text(" (")]
    doc.add((*text, *_with_symbols(doc, guard.name), Text(").")))
    doc.reader.name(ca.SX(guard.value), [symbol])
    doc.mean(latex, "guard, {name}", name=words(guard.name))


def power_of_ten(x: float) -> str:
    """Two digits, as a LaTeX product with a power of ten where it takes one."""
    mantissa, _, exponent = f"{x:.2g}".partition("e")
    if not exponent:
        return mantissa
    power = f"10^{{{int(exponent)}}}"
    return power if mantissa == "1" else rf"{mantissa} \cdot {power}"
