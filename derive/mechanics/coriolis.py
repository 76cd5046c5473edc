"""A Coriolis matrix over quasi-velocities: C w are the velocity products and Ṁ_w = C + Cᵀ.

A link of inertia I with the twist V = Jᵢ w, both in its own axes, feels I V̇ + P V where P(V) holds
its momenta (n, f) as P = −[[n×, f×], [f×, 0]]: P V = V ×* I V and P is antisymmetric. So

    C = Σ Jᵢᵀ (I J̇ᵢ + P Jᵢ),   C + Cᵀ = Σ J̇ᵢᵀ I Jᵢ + Jᵢᵀ I J̇ᵢ = d/dt Σ Jᵢᵀ I Jᵢ = Ṁ_w,

whatever Jᵢ is: loops and nonholonomic constraints enter through Jᵢ = Jᵢ,v S alone. Column k is one
pass of Newton–Euler, with column k of S as velocities, that of Ṡ as accelerations, and the forces
handed down. Sources: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2011
(the matrix P); S. Echeandia, P. M. Wensing, J. Comput. Nonlinear Dyn. 16 (2021) (link by link).
"""

from __future__ import annotations

from collections.abc import Sequence

from derive.expressions.scalars import Scalar, Vector
from derive.joints.rotations import cross, difference
from derive.mechanics.motion import STILL, Numbers, child_numbers
from derive.mechanics.named_frames import rate_of
from derive.mechanics.records import Inertia, Link
from derive.mechanics.tree import Wrench, joint_forces, momentum, twists


def coriolis_column(
    links: Sequence[Link],
    inertias: Sequence[Inertia],
    v: Sequence[Scalar],
    along: Sequence[Scalar],
    turning: Sequence[Scalar],
) -> list[Scalar]:
    """The forces (nv) conjugate to v of one column: `along` is that column of S and `turning` its
    rate, while the links move with v."""
    motion = twists(links, v)
    momenta = [momentum(body, twist) for body, twist in zip(inertias, motion)]
    fields: list[Numbers] = []
    rates: list[Numbers] = []
    for link in links:
        above = fields[link.parent] if link.parent >= 0 else STILL
        before = rates[link.parent] if link.parent >= 0 else STILL
        rates.append(rate_of(link, above, before, [v[j] for j in link.columns], turning))
        fields.append(child_numbers(link, above, [along[j] for j in link.columns]))
    wrenches = [
        _wrench(body, rate, field, (n, f))
        for body, rate, field, (n, f) in zip(inertias, rates, fields, momenta)
    ]
    return joint_forces(links, wrenches, len(v))


def _wrench(body: Inertia, rate: Numbers, field: Numbers, momenta: Wrench) -> Wrench:
    """I J̇ + P J of one link: moment and force at its origin."""
    n, f = momentum(body, rate)
    (angular, linear), (omega, speed) = momenta, field
    moment: Vector = difference(difference(n, cross(angular, omega)), cross(linear, speed))
    return moment, difference(f, cross(linear, omega))
