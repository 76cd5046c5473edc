"""Energies, and how they change along a motion."""

from __future__ import annotations

import casadi as ca
import sympy

from derive.mechanics.recursions.tree import kinetic_energy
from derive.model.load_records import BallSpring, Bushing, Contact, JointSpring, PointSpring
from derive.textbook.kinematics import components_of, numbers_in_symbols
from derive.textbook.manuscript import Manuscript
from derive.textbook.motion import applied, mass

STORING = (JointSpring, BallSpring, PointSpring, Bushing, Contact)  # loads that have a potential


def energies(doc: Manuscript) -> None:
    """T with its mass matrix, V, and the applied forces."""
    doc.section("Energies and forces")
    if _by_links(doc):
        doc.say("The kinetic energy of all links is:")
        _kinetic_of_links(doc)
    else:
        doc.say("The kinetic energy is:")
        _kinetic(doc)
    mass(doc)
    _potential(doc)
    applied(doc)


def _potential(doc: Manuscript) -> None:
    system = doc.system
    if system.V.is_zero():
        doc.say("There is no potential energy.")
        return
    doc.say(f"The potential energy{_of(doc)} is:")
    doc.scalar("V", "V", system.V, "potential energy", "J")


def _of(doc: Manuscript) -> str:
    """Where the potential energy comes from; a formula of the file needs no such word."""
    model = doc.system.model
    sources = ["gravity"] if model.gravity is not None else []
    sources += ["springs"] if any(isinstance(x, STORING) for x in model.loads) else []
    sources += ["first-order states"] if any(x.energy is not None for x in model.states) else []
    if not doc.system.links or not sources:
        return ""
    return f" of {' and '.join(filter(None, [', '.join(sources[:-1]), sources[-1]]))}"


def _by_links(doc: Manuscript) -> bool:
    """Whether all energy is that of links, and all their twists have been printed."""
    twists = components_of(doc)
    symbols = {symbol for formula in doc.printed for symbol in formula.left}
    only_links = doc.system.M_extra.nnz() == 0 and doc.system.model.kinetic is None
    return bool(twists) and only_links and all(x.symbol in symbols for x in twists)


def _kinetic(doc: Manuscript) -> None:
    doc.scalar("T", "T", doc.system.T, "kinetic energy", "J")


def _kinetic_of_links(doc: Manuscript) -> None:
    """Over the links' twists, one after the other."""
    twists = numbers_in_symbols(doc.system, components_of(doc))
    parts = [
        doc.reader.whole(ca.SX(kinetic_energy([link], [twist])))
        for link, twist in zip(doc.system.links, twists)
    ]
    readable = [part[0] for part in parts if part is not None]
    if len(readable) < len(parts):
        return _kinetic(doc)
    doc.mean("T", "kinetic energy", "J")
    symbol = doc.notation.fresh("T", "T")
    doc.lines("T", [symbol], [sympy.Add(*readable)], ca.SX(doc.system.T))


def power(doc: Manuscript) -> None:
    """d(T + V)/dt = P + λᵀ c, or the same of Jacobi's integral T₂ − T₀ + V."""
    system, still = doc.system, doc.system.c.is_zero()
    doc.section("Energy and power")
    if not system.homogeneous:
        doc.say(
            "The kinetic energy has terms that are linear in the rates or free of them. What is in "
            "balance is therefore Jacobi's integral, without the former and with the latter "
            "reversed:"
        )
        doc.scalar("H", "H", system.energy, "Jacobi's integral", "J")
    conserved = "the energy" if system.homogeneous else "Jacobi's integral"
    subject = "the energy" if system.homogeneous else "it"
    doc.say(
        f"Along a motion {subject} changes by the power of the forces that have no potential"
        + (":" if still else ", and of constraints that move:")
    )
    _law_of_power(doc, still)
    if system.power.is_zero():
        doc.say(f"Here $P=0$: {conserved} is conserved." if still else "Here $P=0$.")
        return
    doc.say("The power is:")
    doc.scalar("P", "P", system.power, "power of the forces without potential", "W")


def _law_of_power(doc: Manuscript, still: bool) -> None:
    system = doc.system
    balanced = r"\left(T+V\right)" if system.homogeneous else doc.called("H", "H")
    left = r"\frac{\mathrm{d}}{\mathrm{d}t}" + balanced
    right = "P" if still else r"P + !\lambda^T!c"
    if doc.terms.function("power") is None:
        doc.state(left, right)
        return
    moving = ca.dot(doc.terms.lam, system.c) if system.rows else 0
    doc.law("power", left, right, _energy_rate(doc) - system.power - moving)


def _energy_rate(doc: Manuscript) -> ca.SX:
    """d(T + V)/dt, or that of Jacobi's integral, with v̇ from the equations."""
    s = doc.system
    at_rest = ca.jtimes(s.energy, ca.vertcat(s.t, s.q), ca.vertcat(1, s.qdot))
    moving = at_rest + ca.jtimes(s.energy, s.v, doc.terms.vdot)
    return moving + ca.jtimes(s.energy, s.z, s.zdot) if s.model.states else moving
