"""The equations of motion, one for every generalized velocity."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import sympy

from derive.textbook.manuscript import Manuscript


def unprojected(doc: Manuscript) -> None:
    """M v̇ + h = Q + Aᵀ λ, and h."""
    system = doc.system
    doc.section("Equations with multipliers" if system.rows else "Equations of motion")
    forces = ""
    if system.rows:
        forces = " The multipliers $!\\lambda$ are forces along the constraint rows."
    right = r"!Q + !A^T!\lambda" if system.rows else "!Q"
    whose = "Newton and Euler's equations of all bodies" if system.links else "Lagrange's equations"
    doc.say(f"Collected for the generalized velocities, {whose} are as follows.{forces}")
    doc.law("motion", r"!M\,!!v + !h", right, _balance(doc))
    bias(doc)
    doc.mean(r"!M,\; !h,\; !Q", "mass matrix, bias, applied forces")


def mass(doc: Manuscript) -> None:
    """M, T = ½ vᵀ M v."""
    energy, law = "the kinetic energy", r"T=\tfrac{1}{2}\,!v^T!M\,!v"
    if not doc.system.homogeneous:
        energy = "the part of the kinetic energy that is quadratic in the rates"
        law = r"T_2=\tfrac{1}{2}\,!v^T!M\,!v"
    origin = ", put together from composite bodies (Walker and Orin)" if doc.system.links else ""
    doc.say(
        f"Written in the generalized velocities {energy} is ${law}$ with the symmetric mass matrix "
        f"$!M${origin}:"
    )
    doc.matrix("M", r"!M", "M", doc.system.M, symmetric=True)


def applied(doc: Manuscript) -> None:
    """Q."""
    if doc.system.Q.is_zero():
        doc.vector("Q", "Q", doc.system.Q)
        doc.say("There are no applied forces: $!Q=!0$.")
        return
    doc.say("The applied forces, each along its generalized velocity, are:")
    force_column(doc, "Q", "Q", doc.system.Q, r"!Q")


def bias(doc: Manuscript) -> None:
    """h; once on a page."""
    if not doc.first("bias"):
        return
    origin = ""
    if doc.system.links:
        origin = " (Newton and Euler's equations from tip to base with $!!v=!0$)"
    doc.say(f"The bias $!h$ collects {held_by_bias(doc)}{origin}:")
    force_column(doc, "h", "h", doc.system.h, r"!h")


def held_by_bias(doc: Manuscript) -> str:
    """What stands in h: forces of springs and contacts are in Q."""
    if doc.system.model.potential is None:
        return "velocity products and gravity"
    return "velocity products, gravity and the forces of the potential"


def force_column(
    doc: Manuscript,
    name: str,
    stem: str,
    value: ca.SX,
    bold: str,
    entries: Sequence[sympy.Expr] | None = None,
) -> None:
    """Its entries, or that there are none."""
    if doc.vector(name, stem, value, entries) and all(row[0] == 0 for row in doc.entries[name]):
        doc.say(f"${bold}=!0$: there are none.")


def _balance(doc: Manuscript) -> ca.SX:
    """M v̇ + h − Q − Aᵀ λ."""
    s = doc.system
    constraint = ca.mtimes(s.A.T, doc.terms.lam) if s.rows else 0
    return ca.mtimes(s.M, doc.terms.vdot) + s.h - s.Q - constraint


def bordered(doc: Manuscript) -> None:
    """The augmented system: Lagrange's equations of the first kind."""
    if not doc.equations.generalized_velocities:
        return
    s = doc.system
    doc.say(
        "Together with the constraints they are one bordered system, solved for accelerations and "
        "multipliers at once:"
    )
    if not s.rows:
        doc.law("solved", r"!M\,!!v", r"!Q - !h", _balance(doc))
        return
    doc.law(
        "bordered system",
        r"\begin{bmatrix} !M & -!A^T \\ !A & !0 \end{bmatrix}"
        r"\begin{bmatrix} !!v \\ !\lambda \end{bmatrix}",
        r"\begin{bmatrix} !Q - !h \\ !\beta \end{bmatrix}",
        ca.vertcat(_balance(doc), ca.mtimes(s.A, doc.terms.vdot) - s.beta),
    )
