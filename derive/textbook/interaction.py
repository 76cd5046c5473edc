"""Mobile manipulators: the equations of the platform and of the arm, each as if alone, and what
couples them.

Source: Yu, Chen, A general approach to the dynamics of nonholonomic mobile manipulator systems, J.
Dyn. Sys. Meas. Control 124 (2002): the equations of either part are used as they are; their R
(here M_av), δM and δC (here δh) are the interaction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from derive.mechanics.inverse.layouts import layouts
from derive.mechanics.records import Inertia, Link, System
from derive.mechanics.recursions.tree import mass_matrix
from derive.mechanics.system import inertial_forces
from derive.textbook.manuscript import Manuscript

NOTHING = Inertia(0.0, [0.0] * 3, [[0.0] * 3 for _ in range(3)])


@dataclass(frozen=True)
class _Parts:
    """Indices of the generalized velocities in the constraint rows, and of the others."""

    platform: list[int]
    arm: list[int]


@dataclass(frozen=True)
class _Coupling:
    """The platform's M and h alone, what the arm adds to them, and what couples the two."""

    M_v: ca.SX
    dM: ca.SX
    h_v: ca.SX
    dh: ca.SX
    M_av: ca.SX
    M_a: ca.SX


def interaction(doc: Manuscript) -> None:
    """M_av, δM and δh, where only the platform of a tree is held by constraints: what the arm adds
    to the platform's equations, and what couples the two."""
    parts = _parts(doc.system)
    if parts is None:
        return
    coupling = _coupling(doc.system, parts)
    doc.section("Platform and arm")
    doc.say(
        "Only velocities $!v_v$ of the platform stand in the constraints, those of the arm, "
        "$!v_a$, do not. The equations of the platform without an arm, $!M_v$ and $!h_v$, and of "
        "the arm on ground that rests are used as they are; what couples them is $!M_{av}$, "
        "$\\delta!M$ and $\\delta!h$ (R, δM and δC of Yu and Chen):"
    )
    _laws(doc, parts, coupling)
    doc.matrix("M_v", r"!M_v", r"M^{v}", coupling.M_v, symmetric=True)
    doc.matrix("dM", r"\delta!M", r"\delta M", coupling.dM, symmetric=True)
    doc.matrix("M_av", r"!M_{av}", r"M^{av}", coupling.M_av)
    doc.matrix("M_a", r"!M_a", r"M^{a}", coupling.M_a, symmetric=True)
    doc.say(
        "and, from velocities and gravity, the platform's bias alone and what the arm adds to it"
    )
    doc.vector("h_v", r"h^{v}", coupling.h_v)
    doc.vector("dh", r"\delta h", coupling.dh)
    doc.mean(
        r"!M_{av},\; \delta!M,\; \delta!h",
        "interaction of platform and arm: inertia coupling, added mass, added bias",
    )


def _coupling(system: System, parts: _Parts) -> _Coupling:
    """From the same tree without the arm's masses, and without the platform's."""
    v, arm = parts.platform, parts.arm
    platform: list[Inertia] = []
    load: list[Inertia] = []
    for link in system.links:
        of_arm = _carried(system.links, link, arm)
        platform.append(NOTHING if of_arm else link.inertia)
        load.append(link.inertia if of_arm else NOTHING)
    return _Coupling(
        M_v=_mass(system, platform)[v, v],
        dM=_mass(system, load)[v, v],
        h_v=_bias(system, platform)[v],
        dh=_bias(system, load)[v],
        M_av=system.M[arm, v],
        M_a=system.M[arm, arm],
    )


def _laws(doc: Manuscript, parts: _Parts, coupling: _Coupling) -> None:
    """One equation for the platform and one for the arm."""
    v, arm, c, system = parts.platform, parts.arm, coupling, doc.system
    vdot, Q, h = doc.terms.vdot, system.Q, system.h
    motion = ca.mtimes(c.M_v + c.dM, vdot[v]) + ca.mtimes(c.M_av.T, vdot[arm]) + c.h_v + c.dh
    forces = ca.mtimes(system.A[:, v].T, doc.terms.lam)
    doc.law(
        "platform",
        r"\left(!M_v + \delta!M\right)!!v_v + !M_{av}^T!!v_a + !h_v + \delta!h",
        r"!Q_v + !A_v^T!\lambda",
        motion - Q[v] - forces,
    )
    motion = ca.mtimes(c.M_av, vdot[v]) + ca.mtimes(c.M_a, vdot[arm]) + h[arm]
    doc.law("arm", r"!M_{av}\,!!v_v + !M_a\,!!v_a + !h_a", r"!Q_a", motion - Q[arm])


def _parts(system: System) -> _Parts | None:
    """None where this is no platform with an arm on it."""
    if not _is_plain_tree(system) or any(row.position >= 0 for row in system.rows):
        return None
    indices = range(system.v.numel())
    tied = [j for j in indices if not ca.SX(system.A[:, j]).is_zero()]
    arm = [j for j in indices if j not in tied]
    if not tied or not arm:
        return None
    # an arm that carries part of the platform is none
    inner = [link for link in system.links if set(link.columns) & set(tied)]
    if any(_carried(system.links, link, arm) for link in inner):
        return None
    return _Parts(tied, arm)


def _is_plain_tree(system: System) -> bool:
    """All inertia is that of links, their equations are written out, and something is tied."""
    more = system.M_extra.nnz() or not ca.SX(system.h_extra).is_zero()
    return bool(not more and system.rows and system.links and system.written)


def _carried(links: Sequence[Link], link: Link, arm: Sequence[int]) -> bool:
    """Is the link, or one that carries it, moved by a velocity of the arm?"""
    while True:
        if set(link.columns) & set(arm):
            return True
        if link.parent < 0:
            return False
        link = links[link.parent]


def _mass(system: System, inertias: Sequence[Inertia]) -> ca.SX:
    """M of the same tree with other inertias."""
    rows = mass_matrix(system.links, inertias, system.v.numel())
    return ca.vertcat(*(ca.horzcat(*(ca.SX(x) for x in row)) for row in rows))


def _bias(system: System, inertias: Sequence[Inertia]) -> ca.SX:
    """h of the same tree with other inertias."""
    links = tuple(replace(link, inertia=own) for link, own in zip(system.links, inertias))
    changed = replace(system, links=links, layouts=layouts(links))
    return inertial_forces(changed, ca.SX.zeros(system.v.numel()))
