"""Roots of a tree that float freely: it does not feel where they are, how they are turned and how
fast they go."""

from __future__ import annotations

import casadi as ca

from derive.formulations.motion import Motion
from derive.formulations.structured.factors import entries
from derive.joints.rotations import cross, is_zero, rotated, transpose
from derive.mechanics.records import Link, System


def afloat(system: System) -> tuple[Link, ...]:
    """Roots with six degrees of freedom, velocity of the origin first, that carry no rotors."""
    held = [j for j in range(system.v.numel()) if system.M_extra[:, j].nnz()]
    return tuple(
        link
        for link in system.links
        if link.parent < 0
        and len(link.columns) == 6
        and not set(link.columns) & set(held)
        and all(is_zero(x) for x in link.b)
    )


def from_afloat(
    system: System, motion: Motion, link: Link, vdot: ca.SX, by_q: ca.SX, by_v: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """From a' back to u̇ = a' − ω × u + Rᵀ g."""
    linear, angular = list(link.columns[:3]), list(link.columns[3:])
    v = entries(motion.v)
    u, omega = [v[j] for j in linear], [v[j] for j in angular]
    fall = ca.vertcat(*rotated(transpose(link.R), system.gravity))
    vdot, by_q, by_v = ca.SX(vdot), ca.SX(by_q), ca.SX(by_v)
    vdot[linear] += fall - ca.vertcat(*cross(omega, u))
    by_q[linear, :] += ca.jacobian(fall, system.q)
    by_v[linear, linear] -= ca.skew(ca.vertcat(*omega))
    by_v[linear, angular] += ca.skew(ca.vertcat(*u))
    return vdot, by_q, by_v
