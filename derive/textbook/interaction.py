"""Mobile manipulators: the equations of the platform and of the arm, each as if alone, and what
couples them.

Source: Yu, Chen, A general approach to the dynamics of nonholonomic mobile manipulator systems, J.
Dyn. Sys. Meas. Control 124 (2002): the equations of either part are used as they are; R, δM and δC
are the interaction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from derive.mechanics.records import Inertia, Link, System
from derive.mechanics.system import inertial_forces
from derive.mechanics.tree import mass_matrix
from derive.textbook.manuscript import Manuscript

NOTHING = Inertia(0.0, [0.0] * 3, [[0.0] * 3 for _ in range(3)])


def interaction(doc: Manuscript) -> None:
    """R, δM and δC, where only the platform of a tree is held by constraints."""
    found = _parts(doc.system)
    if found is None:
        return
    v, arm = found  # indices of generalized velocities
    system = doc.system
    loads = [i for i, link in enumerate(system.links) if _carried(system.links, link, arm)]
    platform = [NOTHING if i in loads else link.inertia for i, link in enumerate(system.links)]
    alone = [link.inertia if i in loads else NOTHING for i, link in enumerate(system.links)]
    doc.section("Platform and arm")
    doc.say(
        "Only velocities $!v_v$ of the platform stand in the constraints, those of the arm, "
        "$!v_a$, do not. The equations of the platform without an arm, $!M_v$ and $!h_v$, and of "
        "the arm on ground that rests are used as they are; what couples them is $!R$, $\\delta!M$ "
        "and $\\delta!h$ (δC of Yu and Chen):"
    )
    M_v, dM = _mass(system, platform)[v, v], _mass(system, alone)[v, v]
    R, M_a = system.M[arm, v], system.M[arm, arm]
    h_v, dh = _bias(system, platform)[v], _bias(system, alone)[v]
    vdot, Q, h = doc.terms.vdot, system.Q, system.h
    upper = ca.mtimes(M_v + dM, vdot[v]) + ca.mtimes(R.T, vdot[arm]) + h_v + dh - Q[v]
    lower = ca.mtimes(R, vdot[v]) + ca.mtimes(M_a, vdot[arm]) + h[arm] - Q[arm]
    forces = ca.mtimes(system.A[:, v].T, doc.terms.lam)
    doc.law(
        "platform",
        r"\left(!M_v + \delta!M\right)!!v_v + !R^T!!v_a + !h_v + \delta!h",
        r"!Q_v + !A_v^T!\lambda",
        upper - forces,
    )
    doc.law("arm", r"!R\,!!v_v + !M_a\,!!v_a + !h_a", r"!Q_a", lower)
    doc.matrix("M_v", r"!M_v", r"M^{v}", M_v, symmetric=True)
    doc.matrix("dM", r"\delta!M", r"\delta M", dM, symmetric=True)
    doc.matrix("R_va", r"!R", r"R", R)
    doc.matrix("M_a", r"!M_a", r"M^{a}", M_a, symmetric=True)
    doc.say(
        "and, from velocities and gravity, the platform's bias alone and what the arm adds to it"
    )
    doc.vector("h_v", r"h^{v}", h_v)
    doc.vector("dh", r"\delta h", dh)
    doc.mean(
        r"!R,\; \delta!M,\; \delta!h",
        "interaction of platform and arm: inertia coupling, added mass, added bias",
    )


def _parts(system: System) -> tuple[list[int], list[int]] | None:
    """Generalized velocities in the constraint rows, and the others; None where this is no platform
    with an arm on it."""
    more = system.M_extra.nnz() or not ca.SX(system.h_extra).is_zero()
    if (
        more
        or not (system.rows and system.links and system.written)
        or any(row.position >= 0 for row in system.rows)
    ):
        return None
    held = {
        j
        for j in range(system.v.numel())
        if system.A[:, j].nnz() and not ca.SX(system.A[:, j]).is_zero()
    }
    arm = [j for j in range(system.v.numel()) if j not in held]
    inner = [link for link in system.links if set(link.columns) & held]
    hangs_right = all(not _carried(system.links, link, arm) for link in inner)
    return (sorted(held), arm) if arm and held and hangs_right else None


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
    return inertial_forces(
        replace(system, inertias=(tuple(inertias),)), ca.SX.zeros(system.v.numel())
    )
