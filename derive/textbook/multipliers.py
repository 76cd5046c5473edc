"""Multipliers, recovered after the motion: λ = Rᵀ (M v̇ + h − Q)."""

from __future__ import annotations

import casadi as ca
import sympy

from derive.expressions.deferred import Deferred
from derive.textbook.formulas.layout import sum_of
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words
from derive.textbook.records import Math, Runs, Text


def multipliers(doc: Manuscript) -> None:
    """What they are, whose they are, and their entries."""
    rows = doc.system.rows
    if not rows:
        return
    doc.section("Multipliers")
    doc.mean(r"!\lambda", "multipliers, forces along the constraint rows")
    if doc.equations.generalized_velocities:
        doc.say("The multipliers are part of the solution of the bordered system.")
        return
    if not doc.terms.has("R"):
        doc.say("No constraint row restricts the motion: the multipliers are zero.")
        return
    _law(doc)
    doc.table(("multiplier", "constraint row"), [_row(i, x.name) for i, x in enumerate(rows)])
    if doc.terms.has("E"):
        doc.say(
            "Of rows that repeat each other these are, of all multipliers with the same "
            "$!A^T!\\lambda$, the least."
        )
        return
    if len(doc.terms.independent) < len(rows):
        doc.say("The multipliers of rows that repeat others are zero.")
    accelerations = doc.rates or not doc.w
    if {"M", "S", "R", "h", "Q", "sigma"} <= doc.entries.keys() and accelerations:
        _recovered(doc)


def _missing(doc: Manuscript) -> ca.SX:
    """ρ = M v̇ + h − Q: what the constraints have to add to the applied forces."""
    s = doc.system
    return ca.mtimes(s.M, doc.terms.vdot) + s.h - s.Q


def _law(doc: Manuscript) -> None:
    inverse = "$!A\\,!R=!1$" if doc.w else "the inverse $!R=!A^{-1}$ of its independent rows"
    doc.say(
        "The multipliers are not needed for the motion; they are recovered afterwards. What the "
        f"constraints have to add is $!\\rho=!M\\,!!v+!h-!Q$, and {inverse} gives:"
    )
    if not doc.w:
        doc.mean(r"!R", "inverse of the independent rows of $!A$")
        doc.mean(r"!\rho", "forces of the constraints, $!M\\,!!v+!h-!Q$")
    combined = doc.terms.has("E")
    right = r"!E^T!R^T!\rho" if combined else r"!R^T!\rho"
    doc.law("lambda", r"!\lambda", right, Deferred(lambda: _residual(doc)))


def _residual(doc: Manuscript) -> ca.SX:
    terms = doc.terms
    along_rows = ca.mtimes(terms.named("R").T, _missing(doc))
    if terms.has("E"):
        return terms.lam - ca.mtimes(terms.named("E").T, along_rows)
    return terms.lam[terms.independent] - along_rows


def _row(i: int, name: str) -> tuple[Runs, Runs]:
    return (Math(rf"\lambda_{{{i + 1}}}"),), (Text(words(name)),)


def _recovered(doc: Manuscript) -> None:
    """v̇, ρ and λ, entry by entry."""
    accelerations = _accelerations(doc)
    doc.say("So the forces of the constraints on the generalized velocities are:")
    h, Q = ([row[0] for row in doc.entries[name]] for name in ("h", "Q"))
    forces = [
        sum_of(row, accelerations) + bias - force
        for row, bias, force in zip(doc.entries["M"], h, Q)
    ]
    doc.vector("rho", r"\rho", _missing(doc), forces)
    doc.mean(r"!\rho", "forces of the constraints on the generalized velocities, $!M\\,!!v+!h-!Q$")
    doc.say("The multipliers are:")
    forces = [row[0] for row in doc.entries["rho"]]
    rows = doc.terms.independent
    symbols = [doc.notation.fresh(f"lam[{i + 1}]", rf"\lambda_{{{i + 1}}}") for i in rows]
    along_rows = [sum_of(column, forces) for column in zip(*doc.entries["R"])]
    doc.lines("lam", symbols, along_rows, doc.terms.lam[rows, :])


def _accelerations(doc: Manuscript) -> list[sympy.Expr]:
    """Prints those that are no ẇ; the symbols of all, zero for those that are zero."""
    sigma = [row[0] for row in doc.entries["sigma"]]
    expressions = [sum_of(row, doc.rates) + x for row, x in zip(doc.entries["S"], sigma)]
    rates = [doc.notation.rate(symbol) for symbol in doc.v]
    own = [j for j, rate in enumerate(rates) if rate not in doc.rates]
    if own:
        doc.say("Written out, the accelerations are:")
        symbols = [rates[j] for j in own]
        doc.lines("vdot", symbols, [expressions[j] for j in own], doc.terms.vdot[own])
    return [
        rate if rate in doc.rates or x != 0 else sympy.Integer(0)
        for rate, x in zip(rates, expressions)
    ]
