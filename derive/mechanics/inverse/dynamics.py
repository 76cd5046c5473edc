"""M v̇ + h on a tree, in as few operations as its numbers allow.

Newton–Euler from base to tip and back, as in derive.mechanics.recursions.accelerations, with five
liberties that change no result:

* a link's point may be any point of the axis it turns about: the one that leaves the shorter arms;
* what a joint cannot feel is moved to the carrier (mass, first moment along the axis and one moment
  of inertia across it of a link that turns; the tensor of a link that slides), and of the moments
  across it the one that leaves fewest operations: the base parameters, folded in;
* links that turn about parallel axes, one after the other, are all seen from the axes before the
  first turn: angles and rates about the common axis add up;
* a body whose numbers are parameters may keep the point about which its file gives them;
* at the end of a branch axes may be turned about the joint's: so that the first moment has one
  entry, or not at all where the link looks the same from all sides.

Sources: Luh, Walker, Paul 1980; Khalil, Kleinfinger, Minimum operations and minimum parameters of
the dynamic models of tree structure robots, IEEE J. Robotics Automation 3 (1987) 517–526; Gautier,
Khalil 1990.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from derive.expressions.counting import cheapest
from derive.expressions.scalars import Scalar, Vector
from derive.joints.records import Rotation
from derive.joints.rotations import cross, dot, inverse, is_zero, merged, sum_of, times
from derive.mechanics.inverse.layouts import Layout
from derive.mechanics.inverse.moments import Spin, wrench
from derive.mechanics.inverse.stems import NONE, Pair, Stem, is_nothing, spun


def joint_forces_of_motion(
    layouts: Sequence[Layout], v: Sequence[Scalar], vdot: Sequence[Scalar], gravity: Vector
) -> list[Scalar]:
    """The generalised forces (nv), conjugate to v, that give the links v̇ against gravity: of the
    layouts the one with the fewest operations.

    `v`, `vdot` over all generalized velocities; `gravity` in ground axes, m/s².
    """
    return cheapest([_Motion(layout, (v, vdot, gravity)).forces() for layout in layouts])


@dataclass(frozen=True)
class _State:
    """Of a link. Before the turns: ω and ω̇ without what the row of parallel axes adds, which is
    `rate` and `second`, and a of P; `chain` leads back there. Own axes: `spin` and a."""

    omega: Vector
    alpha: Vector
    a: Vector
    rate: Vector
    second: Vector
    chain: Rotation
    spin: Spin
    own: Vector


class _Motion:
    """Of links in one of their layouts."""

    def __init__(
        self, layout: Layout, motion: tuple[Sequence[Scalar], Sequence[Scalar], Vector]
    ) -> None:
        self.stems, self.heads = layout.stems, layout.heads
        self.v, self.vdot, gravity = motion
        ground = Spin(list(NONE), list(NONE))
        self.ground = (ground, [-x for x in gravity])
        self.states: list[_State] = []
        for i in range(len(self.stems)):
            self.states.append(self._state(i))
        self.wrenches = [
            wrench(of, state.spin, state.own) for of, state in zip(layout.bodies, self.states)
        ]

    def _state(self, i: int) -> _State:
        stem = self.stems[i]
        carrier, a = self._carrier(stem.parent)
        swing = NONE if all(is_zero(x) for x in stem.arm) else carrier.swung(stem.arm)
        rates = [_combined(stem, values) for values in (self.v, self.vdot)]
        if self.heads[i] != i:
            return self._joined(i, swing, rates)
        back = inverse(stem.outer)
        start = (
            spun(back, carrier.omega),
            spun(back, carrier.alpha),
            spun(back, sum_of(a, swing)),
        )
        if stem.turn is not None:
            chain: Rotation = () if stem.unseen else (stem.turn,)
            found = _turned(start, (rates[0][0], rates[1][0]), chain)
        else:
            found = _moved_on(start, rates[0], rates[1])
        if is_nothing(stem.reach):
            return found
        return replace(found, own=sum_of(found.own, found.spin.swung(stem.reach)))

    def _joined(self, i: int, swing: Vector, rates: list[Pair]) -> _State:
        """To a row of parallel axes."""
        stem = self.stems[i]
        assert stem.turn is not None
        above = self.states[stem.parent]
        start = (above.omega, above.alpha, sum_of(above.a, spun(above.chain, swing)))
        chain: Rotation = () if stem.unseen else merged(above.chain, (stem.turn,))
        return _turned(
            start, (sum_of(above.rate, rates[0][0]), sum_of(above.second, rates[1][0])), chain
        )

    def _carrier(self, i: int) -> tuple[Spin, Vector]:
        return (self.states[i].spin, self.states[i].own) if i >= 0 else self.ground

    def forces(self) -> list[Scalar]:
        """From tip to base: each joint feels the wrench along its motion."""
        result: list[Scalar] = [0.0] * len(self.v)
        own = [(list(n), list(f)) for n, f in self.wrenches]
        row = [(list(NONE), list(NONE)) for _ in self.stems]  # of links beyond, before the turns
        for i in reversed(range(len(self.stems))):
            stem, state = self.stems[i], self.states[i]
            at_joint = sum_of(own[i][0], cross(stem.reach, own[i][1]))
            turned = spun(state.chain, at_joint), spun(state.chain, own[i][1])
            n, f = sum_of(turned[0], row[i][0]), sum_of(turned[1], row[i][1])
            for motion, j in zip(stem.motion, stem.columns):
                result[j] = dot([*motion[0], *motion[1]], [*n, *f])
            below = stem.parent
            if below < 0:
                continue
            if self.heads[i] == i:
                n, f = spun(stem.outer, n), spun(stem.outer, f)
                own[below] = _added(own[below], n, f, stem.arm)
            else:
                row[below] = _added(row[below], n, f, spun(self.states[below].chain, stem.arm))
        return result


def _combined(stem: Stem, values: Sequence[Scalar]) -> Pair:
    own = [values[j] for j in stem.columns]
    turn, slide = ([dot([m[k][i] for m in stem.motion], own) for i in range(3)] for k in (0, 1))
    return turn, slide


def _turned(start: tuple[Vector, Vector, Vector], rates: Pair, chain: Rotation) -> _State:
    """A link that turns about an axis of its own: ω̇ = Rᵀ ω̇_p + Rᵀ ω_p × e θ̇ + e θ̈."""
    back = inverse(chain)
    omega, alpha, a = (spun(back, x) for x in start)
    alpha = sum_of(sum_of(alpha, cross(omega, rates[0])), rates[1])
    spin = Spin(sum_of(omega, rates[0]), alpha)
    return _State(*start, rates[0], rates[1], chain, spin, a)


def _moved_on(start: tuple[Vector, Vector, Vector], rates: Pair, seconds: Pair) -> _State:
    """By any other joint, in the axes of the link."""
    omega, alpha, a = start
    turn, slide = rates
    twice = sum_of([times(2.0, x) for x in omega], turn)
    alpha = sum_of(sum_of(alpha, seconds[0]), cross(omega, turn))
    a = sum_of(sum_of(a, seconds[1]), cross(twice, slide))
    spin = Spin(sum_of(omega, turn), alpha)
    return _State(*start, turn, seconds[0], (), spin, a)


def _added(wrench: Pair, n: Vector, f: Vector, arm: Vector) -> Pair:
    return sum_of(wrench[0], sum_of(n, cross(arm, f))), sum_of(wrench[1], f)
