"""One state of a model, spelled out: numbers by name, rates, joint motions and the frames of the
bodies in the ground frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from derive.expressions import tree
from derive.model.records import GROUND, Body, Joint, Model, Placement
from hamel.verify.reference.formulas import NUMERIC, evaluated, lookup
from hamel.verify.reference.joints import Motion, joint_motion
from hamel.verify.reference.tables import numeric
from hamel.verify.reference.vectors import Array, cross


@dataclass(frozen=True)
class Frame:
    """A body in the ground frame: origin 3, rotation (ground ← body) 3 × 3, angular velocity and
    velocity of the origin."""

    origin: Array
    rotation: Array
    omega: Array
    velocity: Array

    def point(self, position: Array) -> Array:
        """Arm from the body's origin to a point given in body coordinates, along the ground
        axes."""
        return self.rotation @ position

    def speed(self, arm: Array) -> Array:
        """Velocity of the material point at `arm` (ground axes) from the origin."""
        return self.velocity + cross(self.omega, arm)


STILL = Frame(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))


@dataclass(frozen=True)
class Seat:
    """A joint at one state: arms from both body origins to the child's joint frame, relative twist
    columns E H, its two parts."""

    joint: Joint
    columns: slice
    arm_parent: Array
    arm_child: Array
    twists: Array  # 6 × k, ground axes: (angular, linear at the joint frame)
    omega: Array  # of the child relative to the parent
    velocity: Array  # of the child's joint frame relative to the parent
    bias: Array  # E Ḣ v


@dataclass(frozen=True)
class State:
    """t, q, v, u, p (behind the parameters first-order states) and what follows from them; drift =
    Ṅ v, names and rates feed
    formulas."""

    t: float
    q: Array
    v: Array
    u: Array
    p: Array
    blocks: tuple[tuple[slice, slice, Array], ...]  # of N: rows, columns, entries
    drift: Array
    rates: Array
    frames: dict[str, Frame]
    seats: tuple[Seat, ...]
    names: dict[str, Any]
    named_rates: dict[str, float]
    functions: Mapping[str, Any]

    @cached_property
    def N(self) -> Array:
        """q̇ = N v, nq × nv."""
        result = np.zeros((len(self.q), len(self.v)))
        for rows, columns, entries in self.blocks:
            result[rows, columns] = entries
        return result

    def along_velocities(self, force: Array) -> Array:
        """Nᵀ f, nv, of forces conjugate to q̇."""
        result = np.zeros(len(self.v))
        for rows, columns, entries in self.blocks:
            result[columns] += entries.T @ force[rows]
        return result

    def row(self, i: int) -> Array:
        """N's row of a coordinate."""
        result = np.zeros(len(self.v))
        columns, entries = self.entries(i)
        result[columns] = entries
        return result

    def entries(self, i: int) -> tuple[slice, Array]:
        """The same without its zeros: where they stand in v, and the entries there."""
        rows, columns, entries = self._block_of[i]
        return columns, entries[i - rows.start]

    @cached_property
    def _block_of(self) -> dict[int, tuple[slice, slice, Array]]:
        return {i: block for block in self.blocks for i in range(block[0].start, block[0].stop)}

    def value(
        self, expression: tree.Expression, further: Mapping[str, float] | None = None
    ) -> float:
        """A formula of the model as a number at this state; `further` names go before its own."""
        if isinstance(expression, tree.Number):
            return expression.value
        names = {**self.names, **further} if further else self.names
        return float(evaluated(expression, lookup(names, self.named_rates), self.functions))

    def vector(self, entries: Sequence[tree.Expression]) -> Array:
        """Formulas as numbers, one entry each."""
        return np.array([self.value(entry) for entry in entries])

    def matrix(self, rows: Sequence[Sequence[tree.Expression]]) -> Array:
        """Formulas as numbers, row by row."""
        return np.array([self.vector(row) for row in rows])


Measured = Callable[["State"], Mapping[str, float]]


def state(
    model: Model, t: float, q: Array, v: Array, u: Array, p: Array, measured: Measured
) -> State:
    """Walk the joints from the ground outwards, then evaluate the definitions in their order.

    Frames are in the ground's axes, from N, H and biases of each joint; rates are q̇ = N v.
    `measured` gives what formulas use of the motion.
    """
    names = _values_by_name(model, t, q, v, u, p)
    functions = {**NUMERIC, **numeric(model.tables)}
    # placements and joint axes are formulas of parameters: they need names before there are frames
    bare = State(t, q, v, u, p, (), np.zeros(0), np.zeros(0), {}, (), names, {}, functions)
    for name, expression in model.definitions:
        if _is_known(expression, names):
            names[name] = bare.value(expression)
    blocks, drift, frames, seats = _walk(model, bare)
    rates = np.zeros(len(q))
    for rows, columns, entries in blocks:
        rates[rows] += entries @ v[columns]
    named_rates = {c.name: rate for c, rate in zip(model.coordinates, rates.tolist())}
    places = frames, tuple(seats)
    full = State(t, q, v, u, p, tuple(blocks), drift, rates, *places, names, named_rates, functions)
    names |= measured(full)
    for name, expression in model.definitions:
        names[name] = full.value(expression)
    return full


def _is_known(expression: tree.Expression, names: Mapping[str, Any]) -> bool:
    """Whether a formula has a value before there are frames and rates."""
    return all(
        isinstance(node, tree.Name) and node.name in names
        for node in tree.walk(expression)
        if isinstance(node, tree.Name | tree.Rate)
    )


def _values_by_name(
    model: Model, t: float, q: Array, v: Array, u: Array, p: Array
) -> dict[str, Any]:
    groups = (
        (model.coordinates, q),
        (model.velocities, v),
        (model.inputs, u),
        ((*model.parameters, *model.states), p),
    )
    return {"t": t, "pi": np.pi} | {
        item.name: x for items, values in groups for item, x in zip(items, values)
    }


def _walk(
    model: Model, numbers: State
) -> tuple[list[tuple[slice, slice, Array]], Array, dict[str, Frame], list[Seat]]:
    """Blocks of N, Ṅ v of all coordinates, the frames of all bodies and the joints' seats. Analytic
    coordinates: q̇ = v."""
    index_q, index_v = _places(model.coordinates), _places(model.velocities)
    drift = np.zeros(len(model.coordinates))
    blocks = [
        (slice(row, row + 1), slice(column, column + 1), np.eye(1))
        for row, column in zip(index_q.get("", []), index_v.get("", []))
    ]
    frames, seats = {GROUND: STILL}, []
    for joint in model.joints:
        rows, columns = _range(index_q.get(joint.name, [])), _range(index_v.get(joint.name, []))
        axis = numbers.vector(joint.axis)
        axis2 = axis if joint.axis2 is None else numbers.vector(joint.axis2)
        kind = joint_motion(joint.type, joint.orientation, numbers.value(joint.pitch), axis2)
        motion = kind(numbers.q[rows], numbers.v[columns], axis)
        blocks.append((rows, columns, motion.N))
        drift[rows] = motion.drift
        seat, frame = _step(joint, columns, motion, numbers, frames[joint.parent])
        frames[joint.child] = frame
        seats.append(seat)
    return blocks, drift, frames, seats


def _places(items: Sequence[Any]) -> dict[str, list[int]]:
    owners: dict[str, list[int]] = {}
    for i, item in enumerate(items):
        owners.setdefault(item.owner, []).append(i)
    return owners


def _range(places: Sequence[int]) -> slice:
    return slice(places[0], places[-1] + 1) if places else slice(0, 0)


def _step(
    joint: Joint, columns: slice, motion: Motion, numbers: State, parent: Frame
) -> tuple[Seat, Frame]:
    """From the parent's frame to the child's: positions, then velocities by the transport rule."""
    seat_p, turn_p = placed(numbers, joint.at_parent)
    seat_c, turn_c = placed(numbers, joint.at_child)
    base = parent.rotation @ turn_p
    axes = base @ motion.rotation
    arm_p = parent.rotation @ seat_p + base @ motion.translation
    rotation = axes @ turn_c.T
    arm_c = rotation @ seat_c
    twists = np.vstack([axes @ motion.H[:3], axes @ motion.H[3:]])
    relative = twists @ numbers.v[columns]
    omega = parent.omega + relative[:3]
    velocity = parent.speed(arm_p) + relative[3:] - cross(omega, arm_c)
    frame = Frame(parent.origin + arm_p - arm_c, rotation, omega, velocity)
    bias = np.concatenate([axes @ motion.bias[:3], axes @ motion.bias[3:]])
    return Seat(joint, columns, arm_p, arm_c, twists, relative[:3], relative[3:], bias), frame


def placed(numbers: State, placement: Placement) -> tuple[Array, Array]:
    """Position and rotation (body ← joint frame) of a joint frame in its body."""
    rotation = np.eye(3) if placement.rotation is None else numbers.matrix(placement.rotation)
    return numbers.vector(placement.position), rotation


def inertia_tensor(numbers: State, body: Body) -> Array:
    """The 3 × 3 tensor about the centre of mass from (xx, yy, zz, xy, xz, yz)."""
    xx, yy, zz, xy, xz, yz = numbers.vector(body.inertia)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
