"""What each function that can be rolled sweeps over, reads and gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Matrix, Vector
from derive.mechanics.loops.forward_dynamics import forward_dynamics, numbered_name
from derive.mechanics.loops.inverse_dynamics import inverse_dynamics
from derive.mechanics.loops.products import Along, Weights, adjoint_product, forward_product
from derive.mechanics.loops.records import Joint, Read, Sweep
from derive.mechanics.loops.sweeps import Rows
from derive.mechanics.records import System


@dataclass(frozen=True)
class AtLink:
    """What stands for the numbers of the link at hand: its state and its inputs, of which kinds
    take the first ones, and what a function is given besides."""

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
    def with_most(cls, coordinates: int, velocities: int, inputs: int) -> AtLink:
        """With as many of each as a link has at most."""
        q, v, u = (dict.fromkeys(names.split(), size) for names, size in (
            ("q dq y_q", coordinates), ("v rate dv y_v", velocities), ("u du", inputs),
        ))  # fmt: skip
        return cls(**{name: ca.SX.sym(name, size) for name, size in (q | v | u).items()})

    @property
    def reads(self) -> tuple[Read, ...]:
        """Of the state and the inputs."""
        return (
            *each("q", self.q, "x", "coordinate"),
            *each("v", self.v, "x", "velocity"),
            *_inputs("u", self.u, "u", "input"),
        )


def each(name: str, symbols: ca.SX, argument: str, index: str) -> tuple[Read, ...]:
    """A number for each coordinate or velocity of a joint."""
    return tuple(
        Read(numbered_name(name, k), symbols[k], argument, numbered_name(index, k))
        for k in range(symbols.numel())
    )


def _inputs(name: str, symbols: ca.SX, argument: str, index: str) -> tuple[Read, ...]:
    numbers = range(symbols.numel())
    return tuple(Read(f"{name}{k}", symbols[k], argument, f"{index}{k}") for k in numbers)


@dataclass(frozen=True)
class Places:
    """By link its coordinates, velocities and inputs, among those of the system."""

    size_of_q: int
    size_of_v: int
    coordinates: tuple[tuple[int, ...], ...]
    velocities: tuple[tuple[int, ...], ...]
    of_inputs: tuple[tuple[int, ...], ...]

    @property
    def size(self) -> int:
        """Of (q, v)."""
        return self.size_of_q + self.size_of_v

    @property
    def state(self) -> dict[str, tuple[int, ...]]:
        """In x, and in what is laid out like it."""
        return self.like_state("coordinate", "velocity", 0)

    def like_state(self, q: str, v: str, first: int) -> dict[str, tuple[int, ...]]:
        """In (q, v) that begins there."""
        return self._of_joints(q, self.coordinates, first) | self.of_velocities(
            v, first + self.size_of_q
        )

    def of_velocities(self, name: str, first: int) -> dict[str, tuple[int, ...]]:
        """In what has an entry for each velocity and begins there."""
        return self._of_joints(name, self.velocities, first)

    def _of_joints(
        self, name: str, places: tuple[tuple[int, ...], ...], first: int
    ) -> dict[str, tuple[int, ...]]:
        most = range(max(map(len, places)))
        return {numbered_name(name, k): _from(places, k, first) for k in most}

    def inputs(self, name: str, first: int) -> dict[str, tuple[int, ...]]:
        """In u that begins there."""
        most = max(map(len, self.of_inputs))
        return {f"{name}{k}": _from(self.of_inputs, k, first) for k in range(most)}


def _from(places: tuple[tuple[int, ...], ...], k: int, first: int) -> tuple[int, ...]:
    """Number k of each link; where a link has less of them, that of the first which has."""
    any_other = next(own[k] for own in places if k < len(own))
    return tuple(first + (own[k] if k < len(own) else any_other) for own in places)


_Made = tuple[tuple[Sweep, ...], Rows]


@dataclass(frozen=True)
class Way:
    """A function: what acts at the joints, its sweeps, and what it reads and gives besides; and
    whether its sweeps know of what acts on links by themselves."""

    force: Callable[[System], ca.SX]
    sweeps: Callable[[list[Joint], Vector, Matrix, AtLink], _Made]
    reads: Callable[[AtLink], tuple[Read, ...]]
    indices: Callable[[Places], dict[str, tuple[int, ...]]]
    pushes: bool = True
    idle: bool = False  # inputs count as zero


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
        lambda joints, gravity, ground, own: forward_dynamics(joints, gravity, ground),
        lambda own: (),
        lambda at: {},
    ),
    "bias": Way(
        _forces_of_a_potential,
        lambda joints, gravity, ground, own: inverse_dynamics(
            joints, gravity, ground, [0.0] * own.rate.numel()
        ),
        lambda own: (),
        lambda at: at.of_velocities("force", 0),
    ),
    "inverse_dynamics": Way(
        _forces_without_inputs,
        lambda joints, gravity, ground, own: inverse_dynamics(
            joints, gravity, ground, [*ca.vertsplit(own.rate)]
        ),
        lambda own: each("a", own.rate, "x", "rate"),
        lambda at: at.of_velocities("force", 0) | at.of_velocities("rate", at.size),
        idle=True,
    ),
    "dynamics_forward": Way(
        _all_forces,
        lambda joints, gravity, ground, own: forward_product(
            joints, gravity, Along(own.q, own.v, own.u, own.dq, own.dv, own.du)
        ),
        lambda own: (
            *each("dq", own.dq, "x", "coordinate_change"),
            *each("dv", own.dv, "x", "velocity_change"),
            *_inputs("du", own.du, "x", "input_change"),
        ),
        lambda at: (
            at.like_state("coordinate_change", "velocity_change", at.size)
            | at.inputs("input_change", 2 * at.size)
        ),
        pushes=False,
    ),
    "dynamics_adjoint": Way(
        _all_forces,
        lambda joints, gravity, ground, own: adjoint_product(
            joints, gravity, Weights(own.q, own.v, own.u, own.y_q, own.y_v)
        ),
        lambda own: (
            *each("y_q", own.y_q, "x", "coordinate_weight"),
            *each("y_v", own.y_v, "x", "velocity_weight"),
        ),
        lambda at: (
            at.like_state("coordinate_weight", "velocity_weight", at.size)
            | at.inputs("slope", at.size)
        ),
        pushes=False,
    ),
}
