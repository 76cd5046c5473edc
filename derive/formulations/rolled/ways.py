"""What each function that can be rolled sweeps over, reads and gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Vector
from derive.mechanics.loops.forward_dynamics import forward_dynamics
from derive.mechanics.loops.inverse_dynamics import inverse_dynamics
from derive.mechanics.loops.products import Along, Weights, adjoint_product, forward_product
from derive.mechanics.loops.records import Joint, Read, Sweep
from derive.mechanics.loops.sweeps import Rows
from derive.mechanics.records import System


@dataclass(frozen=True)
class AtLink:
    """What stands for the numbers of the link at hand: its state, its inputs, of which kinds take
    the first ones, and what a function is given besides."""

    q: ca.SX
    v: ca.SX
    u: ca.SX
    rate: ca.SX
    dq: ca.SX
    dv: ca.SX
    du: ca.SX
    y_q: ca.SX
    y_v: ca.SX

    @classmethod
    def with_inputs(cls, inputs: int) -> AtLink:
        """With as many inputs as a link has at most."""
        names = ("q", "v", "u", "rate", "dq", "dv", "du", "y_q", "y_v")
        sizes = {"u": inputs, "du": inputs}
        return cls(*(ca.SX.sym(name, sizes.get(name, 1)) for name in names))

    @property
    def reads(self) -> tuple[Read, ...]:
        """Of the state and the inputs."""
        return (
            Read("q", self.q, "x", "coordinate"),
            Read("v", self.v, "x", "velocity"),
            *(Read(f"u{k}", self.u[k], "u", f"input{k}") for k in range(self.u.numel())),
        )


@dataclass(frozen=True)
class Places:
    """By link its coordinate, velocity and inputs, among those of the system."""

    size: int  # of q, and of v
    size_of_u: int
    coordinates: tuple[int, ...]
    velocities: tuple[int, ...]
    of_inputs: tuple[tuple[int, ...], ...]

    @property
    def state(self) -> dict[str, tuple[int, ...]]:
        """In x, and in what is laid out like it."""
        return self.like_state("coordinate", "velocity", 0)

    def like_state(self, q: str, v: str, first: int) -> dict[str, tuple[int, ...]]:
        """In (q, v) that begins there."""
        return {q: _from(self.coordinates, first), v: _from(self.velocities, first + self.size)}

    def inputs(self, name: str, first: int) -> dict[str, tuple[int, ...]]:
        """In u that begins there; where a link has less of them, any."""
        most = max(map(len, self.of_inputs))
        return {
            f"{name}{k}": tuple(first + (own[k] if k < len(own) else 0) for own in self.of_inputs)
            for k in range(most)
        }


def _from(places: tuple[int, ...], first: int) -> tuple[int, ...]:
    return tuple(first + place for place in places)


_Made = tuple[tuple[Sweep, ...], Rows]


@dataclass(frozen=True)
class Way:
    """A function: what acts at the joints, its sweeps, and what it reads and gives besides."""

    force: Callable[[System], ca.SX]
    sweeps: Callable[[list[Joint], Vector, AtLink], _Made]
    reads: Callable[[AtLink], tuple[Read, ...]]
    indices: Callable[[Places], dict[str, tuple[int, ...]]]


def _all_forces(system: System) -> ca.SX:
    return system.Q - system.h_extra


def _forces_without_inputs(system: System) -> ca.SX:
    idle = ca.substitute(system.Q, system.u, ca.SX.zeros(system.u.numel()))
    return idle - system.h_extra


def _forces_of_a_potential(system: System) -> ca.SX:
    return -system.h_extra


WAYS: dict[str, Way] = {
    "dynamics": Way(
        _all_forces,
        lambda joints, gravity, own: forward_dynamics(joints, gravity),
        lambda own: (),
        lambda at: {},
    ),
    "bias": Way(
        _forces_of_a_potential,
        lambda joints, gravity, own: inverse_dynamics(joints, gravity, 0.0),
        lambda own: (),
        lambda at: {"force": at.velocities},
    ),
    "inverse_dynamics": Way(
        _forces_without_inputs,
        lambda joints, gravity, own: inverse_dynamics(joints, gravity, own.rate),
        lambda own: (Read("a", own.rate, "x", "rate"),),
        lambda at: {"force": at.velocities, "rate": _from(at.velocities, 2 * at.size)},
    ),
    "dynamics_forward": Way(
        _all_forces,
        lambda joints, gravity, own: forward_product(
            joints, gravity, Along(own.q, own.v, own.u, own.dq, own.dv, own.du)
        ),
        lambda own: (
            Read("dq", own.dq, "x", "coordinate_change"),
            Read("dv", own.dv, "x", "velocity_change"),
            *(Read(f"du{k}", own.du[k], "x", f"input_change{k}") for k in range(own.du.numel())),
        ),
        lambda at: (
            at.like_state("coordinate_change", "velocity_change", 2 * at.size)
            | at.inputs("input_change", 4 * at.size)
        ),
    ),
    "dynamics_adjoint": Way(
        _all_forces,
        lambda joints, gravity, own: adjoint_product(
            joints, gravity, Weights(own.q, own.v, own.u, own.y_q, own.y_v)
        ),
        lambda own: (
            Read("y_q", own.y_q, "x", "coordinate_weight"),
            Read("y_v", own.y_v, "x", "velocity_weight"),
        ),
        lambda at: (
            at.like_state("coordinate_weight", "velocity_weight", 2 * at.size)
            | at.inputs("slope", 2 * at.size)
        ),
    ),
}
