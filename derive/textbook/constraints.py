"""The constraints: φ = 0, A v = c and A v̇ = β."""

from __future__ import annotations

import sympy

from derive.mechanics.records import Row
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words
from derive.textbook.records import Math, Runs, Text


def constraints(doc: Manuscript) -> None:
    """φ, A v = c and β."""
    system = doc.system
    doc.section("Constraints")
    if not system.rows:
        doc.say("There are none: the generalized velocities are independent of each other.")
        return
    _positions(doc)
    doc.say("Every constraint is one row of equations that are linear in the velocities:")
    doc.state(r"!A\,!v", r"!c")
    doc.mean(r"!A,\; !c", "constraint rows, $!A\\,!v=!c$")
    doc.table(("row", "constraint", "kind"), [_row(i, row) for i, row in enumerate(system.rows)])
    doc.say("The coefficients are:")
    doc.matrix("A", r"!A", "A", system.A)
    _moving(doc)
    _differentiated(doc)
    if doc.terms.has("E"):
        _combined(doc)


def _differentiated(doc: Manuscript) -> None:
    """β."""
    doc.say(
        "Differentiating once more gives $!A\\,!!v=!\\beta$ with $!\\beta=!!c-!!A\\,!v$, a "
        "directional derivative along the motion:"
    )
    doc.mean(r"!\beta", "right side of the constraint rows for accelerations, $!A\\,!!v=!\\beta$")
    shown = doc.vector("beta", r"\beta", doc.system.beta)
    if shown and all(row == [0] for row in doc.entries["beta"]):
        doc.say("Here $!\\beta=!0$.")


def _combined(doc: Manuscript) -> None:
    """E, where rows that repeat others are kept."""
    doc.say(
        "Some rows repeat others, and all are kept. With $!A=!L\\,!A_k$ and $!A_k$ independent "
        "rows, the pseudo-inverse $!E=!L^+$ makes independent rows of all; $!E\\,!A$, $!E\\,!c$ "
        "and $!E\\,!\\beta$ are what is meant by $!A$, $!c$ and $!\\beta$ in the following, and "
        "multipliers of these rows are those of all by $!E^T$."
    )
    doc.matrix("E", r"!E", "E", doc.terms.named("E"))
    doc.mean(r"!E", "independent combinations of the constraint rows")


def _positions(doc: Manuscript) -> None:
    """φ."""
    system = doc.system
    if not system.phi.numel():
        doc.say("All constraints are nonholonomic: they tie velocities, not positions.")
        return
    doc.say("The positions have to satisfy $!\\Phi(!q,t)=!0$, with:")
    doc.vector("phi", r"\Phi", system.phi)
    doc.mean(r"!\Phi", "position constraints, $!\\Phi=!0$")


def _row(i: int, row: Row) -> tuple[Runs, ...]:
    index, name = (Text(str(i + 1)),), (Text(words(row.name)),)
    if row.position < 0:
        return index, name, (Text("nonholonomic"),)
    position = Math(rf"\Phi_{{{row.position + 1}}}")
    return index, name, (Text("holonomic, the rate of "), position)


def _moving(doc: Manuscript) -> None:
    """c."""
    if doc.system.c.is_zero():
        doc.entries["c"] = [[sympy.Integer(0)]] * len(doc.system.rows)
        doc.say("No constraint moves by itself: $!c=!0$.")
        return
    doc.say("Some of them move by themselves, with the velocities:")
    doc.vector("c", "c", doc.system.c)
