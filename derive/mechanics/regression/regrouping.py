"""Which standard parameters act together at a joint: by structure, after Gautier & Khalil.

Of a body that turns about an axis, the mass, the first moment along the axis and one moment of
inertia across it look the same from the body that carries the joint; of a body that slides, the
whole tensor. Carried down to the base they leave fewer numbers with the same Y π, for every motion
and so for loops and rolling too. (Gautier & Khalil 1990, Direct calculation of minimum set of
inertial parameters of serial robots.)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca

from derive.expressions.scalars import Scalar
from derive.mechanics.links import NOTHING, moved, regrouped
from derive.mechanics.records import Inertia, Link, System
from derive.mechanics.regression.inertial_rows import inertia_of, ten_of
from derive.mechanics.regression.regressor import (
    INERTIAL,
    Group,
    groups,
    parameters,
)


@dataclass(frozen=True)
class Regrouping:
    """`sums` (nb × np): the regrouped parameters per standard one; `frames` (nb × np): the same
    numbers of each group alone, in the axes of its joint and about the joint's point, so that
    Y = Z · frames with the columns Z of the regrouped ones. Both over the model's parameters."""

    sums: ca.SX
    frames: ca.SX


def regrouping(system: System) -> Regrouping:
    """By the joints alone; rows of what is not inertia are those of a unit matrix."""
    known = parameters(system)
    pi = ca.SX.sym("pi", len(known))
    named: dict[tuple[str, str], Scalar] = {(x.owner, x.kind): pi[k] for k, x in enumerate(known)}
    own = {g.place.link: _of_link(g, named) for g in groups(system)}
    links = tuple(replace(link, inertia=own.get(i, NOTHING)) for i, link in enumerate(system.links))
    together = regrouped(links)
    kinds = {x.kind for x in known}
    places = [k for k, name in enumerate(INERTIAL) if name in kinds]
    sums: list[Scalar] = []
    frames: list[Scalar] = []
    for group in groups(system):
        i = group.place.link
        sums += [_about_joint(links[i], together[i])[k] for k in places]
        frames += [_about_joint(links[i], own[i])[k] for k in places]
    others = [pi[k] for k, x in enumerate(known) if x.kind not in INERTIAL]
    return Regrouping(_linear([*sums, *others], pi), _linear([*frames, *others], pi))


def _of_link(group: Group, named: dict[tuple[str, str], Scalar]) -> Inertia:
    """The group's own parameters in the axes of its link."""
    ten = [named.get((group.body, kind), 0.0) for kind in INERTIAL]
    return moved(inertia_of(ten), group.place.rotation, [0.0, 0.0, 0.0])


def _about_joint(link: Link, own: Inertia) -> list[Scalar]:
    return ten_of(moved(own, (), [-x for x in link.b]))


def _linear(values: list[Scalar], pi: ca.SX) -> ca.SX:
    return ca.jacobian(ca.vertcat(*values), pi) if values else ca.SX(0, pi.numel())
