"""Twists and their rates from base to tip, as linear forms.

In a link's own frame, with ω_p, v_p of the parent, the joint point at a (parent) and b (link),
relative twist (ω_J, v_J):
    ω = Rᵀ ω_p + ω_J            u = Rᵀ (v_p + ω_p × a) + v_J            v = u − ω × b
Rates of these components (not of the vectors):
    ω̇ = Rᵀ ω̇_p − ω_J × Rᵀ ω_p + H_ω v̇
    u̇ = Rᵀ (v̇_p + ω̇_p × a) + Rᵀ ω_p × v_J − ω_J × Rᵀ (v_p + ω_p × a) + H_v v̇
so that velocities and their rates have the same coefficients and differ by velocity products alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from derive.expressions.scalars import Scalar, Vector
from derive.joints.rotations import cross, dot, minus, plus, sum_of, times
from derive.joints.rotations import rotated as rotated_vector
from derive.mechanics.links import carried
from derive.mechanics.records import Link, Numbers, Rod, RowForm, TwistTerm
from derive.mechanics.recursions.forms import Form, added, constant, crossed, dotted, rotated, total

Twist = tuple[list[Form], list[Form]]  # three forms of ω, three of v

REST: Twist = ([{}, {}, {}], [{}, {}, {}])
STILL: Numbers = ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])


@dataclass(frozen=True)
class Products:
    """The velocity products in a link's rates: what stands beside Rᵀ(…) and H v̇."""

    angular: Vector
    linear: Vector


def parent_part(link: Link, parent: Twist) -> Twist:
    """Rᵀ ω_p and Rᵀ (v_p + ω_p × a) as forms."""
    omega, velocity = parent
    return rotated(link.R, omega), rotated(link.R, added(velocity, crossed(omega, link.a)))


def joint_part(link: Link, joint: Sequence[Form]) -> Twist:
    """H v_J as forms, from one form per joint velocity."""
    weights = [[column[i] for column in link.motion] for i in range(6)]
    forms = [total(zip(row, joint)) for row in weights]
    return forms[:3], forms[3:]


def twist(link: Link, before: Twist, joint: Twist) -> Twist:
    """The link's twist (ω, v) at its own origin, in its frame, from what the parent hands on and
    what the joint adds: ω = Rᵀ ω_p + ω_J, v = u − ω × b."""
    omega = added(before[0], joint[0])
    at_joint = added(before[1], joint[1])
    return omega, shifted(link, omega, at_joint)


def shifted(link: Link, omega: list[Form], at_joint: list[Form]) -> list[Form]:
    """u − ω × b."""
    return added(at_joint, crossed(omega, [-x for x in link.b]))


def velocity_products(link: Link, parent: Numbers, joint_velocities: Vector) -> Products:
    """−ω_J × Rᵀ ω_p and Rᵀ ω_p × v_J − ω_J × Rᵀ (v_p + ω_p × a), from the velocities' values.

    They are the rates of components in a turning frame: what is left of ω̇ and u̇ where all v̇ are
    zero and the parent's rates are taken off.
    """
    omega, velocity = carried(parent, link.R, link.a)
    relative = [dot([column[i] for column in link.motion], joint_velocities) for i in range(6)]
    turn, slide = relative[:3], relative[3:]
    return Products(cross(omega, turn), sum_of(cross(omega, slide), cross(velocity, turn)))


def with_products(before: Twist, products: Products) -> Twist:
    """The parent's part of a twist's rate with the link's velocity products added; the joint's own
    H v̇ is what is still missing."""
    return (
        added(before[0], [constant(x) for x in products.angular]),
        added(before[1], [constant(x) for x in products.linear]),
    )


def child_numbers(link: Link, parent: Numbers, joint_velocities: Vector) -> Numbers:
    """The link's twist in numbers, by the same recursion."""
    before = carried(parent, link.R, link.a)
    relative = [dot([column[i] for column in link.motion], joint_velocities) for i in range(6)]
    omega = sum_of(before[0], relative[:3])
    at_joint = sum_of(before[1], relative[3:])
    return omega, sum_of(at_joint, cross(link.b, omega))


def row_form(row: RowForm, twists: Mapping[int, Twist], joints: dict[int, Form]) -> Form:
    """Σ direction · (v + ω × point) + moment · ω + Σ coefficients v, as one form (the row's value
    is not in it). With rates of twists in place of twists it is the row's rate, but for
    `row_products`."""
    parts = [(1.0, _term_form(term, twists[term.link])) for term in row.terms if term.link >= 0]
    parts += [(coefficient, joints[j]) for j, coefficient in row.coefficients]
    return total(parts)


def _term_form(term: TwistTerm, motion: Twist) -> Form:
    omega, velocity = motion
    at_point = added(velocity, crossed(omega, term.point))
    return total([(1.0, dotted(term.direction, at_point)), (1.0, dotted(term.moment, omega))])


def row_number(row: RowForm, numbers: Sequence[Numbers], v: Sequence[Scalar]) -> Scalar:
    """The same in numbers, from the links' twists: A v of the row."""
    total: Scalar = 0.0
    for term in row.terms:
        if term.link >= 0:
            omega, velocity = numbers[term.link]
            at_point = sum_of(velocity, cross(omega, term.point))
            total = plus(total, plus(dot(term.direction, at_point), dot(term.moment, omega)))
    own = [j for j, _ in row.coefficients]
    return plus(total, dot([x for _, x in row.coefficients], [v[j] for j in own]))


def row_products(row: RowForm, numbers: Sequence[Numbers]) -> Scalar:
    """What the turning of the directions and the moving of the points add to the row's rate.

    A direction n fixed in the ground turns with ṅ = −ω × n in the link, so ṅ·x = n·(ω × x) for the
    point's velocity x. The line of a rod e turns besides with ė = (ẋ − e e·ẋ)/|x|, x from its
    beginning to its end.
    """
    result: Scalar = _turning_of_rod(row, row.rod, numbers) if row.rod else 0.0
    for term in row.terms:
        if term.link < 0 or term.fixed == "body":
            continue
        omega, velocity = numbers[term.link]
        at_point = sum_of(velocity, cross(omega, term.point))
        if term.fixed == "ground":
            result = result + dot(term.direction, cross(omega, at_point))
        else:
            moving = dot(term.direction, cross(omega, term.point_rate)) + dot(
                term.moment_rate, omega
            )
            result = result + dot(term.direction_rate, at_point) + moving
    return result


def _turning_of_rod(row: RowForm, rod: Rod, numbers: Sequence[Numbers]) -> Scalar:
    """ė·ẋ = (ẋ·ẋ − (e·ẋ)²)/|x|."""
    moved: Vector = [0.0, 0.0, 0.0]
    for term, (sign, R) in zip(row.terms, rod.ends):
        omega, velocity = numbers[term.link]
        at_point = sum_of(velocity, cross(omega, term.point))
        moved = sum_of(moved, [times(sign, x) for x in rotated_vector(R, at_point)])
    along = dot(rod.direction, moved)
    return minus(dot(moved, moved), times(along, along)) / rod.length
