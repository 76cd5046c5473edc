"""The block inversion of Mirtaheri and Zohoor, and Maggi's equations: both multiply Newton and
Euler's equations by Sᵀ; they differ in where S comes from."""

from __future__ import annotations

import casadi as ca

from derive.textbook.charts import charts
from derive.textbook.choice import themselves
from derive.textbook.complement import complement
from derive.textbook.forces import along, solved
from derive.textbook.formulas.terms import Terms
from derive.textbook.interaction import interaction
from derive.textbook.inverse import accelerations, inverse
from derive.textbook.manuscript import Manuscript
from derive.textbook.methods import method, nonideal
from derive.textbook.motion import bordered, unprojected
from derive.textbook.multipliers import multipliers
from derive.textbook.projected import final
from derive.textbook.roads.records import Road


def _write(doc: Manuscript) -> None:
    inverse(doc)
    accelerations(doc)
    charts(doc)
    unprojected(doc)
    nonideal(doc)
    method(doc)
    interaction(doc)
    complement(doc)
    bordered(doc)
    _projection(doc)
    final(doc)
    multipliers(doc)


def _projection(doc: Manuscript) -> None:
    """Sᵀ from the left."""
    if doc.equations.generalized_velocities or not doc.w or not doc.system.written:
        return
    if themselves(doc) and not doc.terms.has("Y"):
        return
    doc.section("Projection")
    if doc.terms.has("Y"):
        doc.say(
            "Since $!A\\,!S=!0$, multiplying {motion} by $!S^T$ from the left removes the "
            "multipliers; inserting $!!v=!S\\,!!w+!\\sigma$ leaves the rates of the "
            "quasi-velocities alone:",
            motion=doc.ref("motion"),
        )
    else:
        doc.say(
            "Multiplying {motion} by $!S^T$ from the left carries it over to the quasi-velocities:",
            motion=doc.ref("motion"),
        )
    doc.law(
        "projection",
        r"!S^T\left(!M\,!S\,!!w + !M\,!\sigma + !h - !Q\right)",
        "!0",
        _left(doc.terms, doc.terms.wdot),
    )


def _left(terms: Terms, wdot: ca.SX) -> ca.SX:
    """Sᵀ (M (S ẇ + σ) + h − Q), with the inverse of [A; B] carried out by blocks."""
    s, S = terms.system, terms.named("S")
    vdot = ca.mtimes(S, wdot) + terms.named("sigma")
    return ca.mtimes(S.T, ca.mtimes(s.M, vdot) + s.h - s.Q)


def _solution(terms: Terms) -> ca.SX:
    wdot = ca.SX.sym("wdot", terms.w.numel())
    return solved(terms, _left(terms, wdot), wdot)


def _maggi(doc: Manuscript) -> None:
    unprojected(doc)
    nonideal(doc)
    doc.section("Maggi's equations")
    doc.say(
        "Forces along the constraint rows do no work on the motions $!S\\,!w$ that the constraints "
        "allow, $!S^T!A^T=!0$. Of {motion} each column of $!S$ therefore leaves one equation "
        "without multipliers (d'Alembert's principle in Lagrange's form):",
        motion=doc.ref("motion"),
    )
    s, S = doc.system, doc.terms.named("S")
    forces = ca.mtimes(s.M, doc.terms.vdot) + s.h - s.Q
    doc.law("Maggi", r"!S^T\left(!M\,!!v + !h - !Q\right)", r"!0", ca.mtimes(S.T, forces))
    doc.say(
        "They are solved together with the kinematic equations $!v=!S\\,!w+!R\\,!c$, whose rate "
        "along the motion is:"
    )
    rate = along(doc.terms, doc.terms.named("v"), doc.terms.wdot)
    doc.law(
        "rate of v",
        r"!!v",
        r"\frac{\mathrm{d}}{\mathrm{d}t}\left(!S\,!w + !R\,!c\right)",
        doc.terms.vdot - rate,
    )
    accelerations(doc)
    final(doc)
    multipliers(doc)


def _maggi_left(terms: Terms, wdot: ca.SX) -> ca.SX:
    """Sᵀ (M v̇ + h − Q), v̇ differentiated and not by σ."""
    s, S = terms.system, terms.named("S")
    vdot = along(terms, terms.named("v"), wdot)
    return ca.mtimes(S.T, ca.mtimes(s.M, vdot) + s.h - s.Q)


def _maggi_solution(terms: Terms) -> ca.SX:
    wdot = ca.SX.sym("wdot", terms.w.numel())
    return solved(terms, _maggi_left(terms, wdot), wdot)


BLOCK_INVERSION = Road(
    name="block_inversion",
    title="block inversion",
    about="[A; B] stacked and inverted by blocks; the equations projected on S",
    source="Mirtaheri, Zohoor: Quasi-velocities definition in Lagrangian multibody dynamics",
    write=_write,
    accelerations=_solution,
    unknowns=lambda terms: terms.w.numel(),
    needs="one inverse of [A; B] by blocks; no matrix is differentiated",
    fails="where a pivot of the choice vanishes: another choice of B moves that place",
    left=_left,
)
MAGGI = Road(
    name="maggi",
    title="Maggi's equations",
    about="the equations with multipliers, projected on the motions that the constraints allow",
    source="Maggi: Principii della teoria matematica del movimento dei corpi, 1896",
    write=_maggi,
    accelerations=_maggi_solution,
    unknowns=lambda terms: terms.w.numel(),
    needs="a basis S of the allowed motions, and its rate along the motion",
    fails="where the basis S is not defined; positions drift unless they are projected",
    left=_maggi_left,
)
