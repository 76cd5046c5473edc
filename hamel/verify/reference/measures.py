"""Measures of the motion that formulas use, with their rates: a second time, as jets.

What is seen from a moving frame is the product of its axes with a vector, and all is differentiated
by the rule for products. A velocity has a rate but no position: its jet holds the rate's own
derivative, over ż.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from derive.model.named_frames import carrier
from derive.model.records import GROUND, Joint, Measure, Model
from hamel.verify.reference.jets import Jet, direction, dot, point
from hamel.verify.reference.layout import Layout, layout
from hamel.verify.reference.paths import length
from hamel.verify.reference.states import State, placed
from hamel.verify.reference.vectors import UNIT, Array

NORMAL = {"xy": UNIT["z"], "xz": -UNIT["y"], "yz": UNIT["x"]}
RATES = {"velocity": "position", "turning": "orientation", "lengthening": "length"}
# accelerations and what they are rates of
SECOND = {
    "acceleration": "velocity",
    "second_turning": "turning",
    "angular_acceleration": "angular_velocity",
    "second_lengthening": "lengthening",
}


@dataclass(frozen=True)
class Measured:
    """A number x with ẋ, and the derivative of what is of highest order: ẍ = over ż + rest of a
    position, ẋ = over ż + rest of a velocity (`moving`)."""

    value: float
    rate: float
    over: Array
    rest: float
    moving: bool


def values(model: Model, state: State) -> Mapping[str, float]:
    """Every measure of the model by name."""
    return {name: x.value for name, x in measured(model, state).items()}


def measured(model: Model, state: State) -> dict[str, Measured]:
    """Every measure of the model by name, with derivatives."""
    if not model.measures:
        return {}
    place = layout(model)
    return {measure.name: _measured(model, place, state, measure) for measure in model.measures}


def accelerations(
    model: Model, state: State, vdot: Array, twists: Mapping[str, Array]
) -> Mapping[str, float]:
    """Every acceleration of outputs by name, at the rates v̇ of the velocities and those of the
    twists of bodies."""
    place = layout(model)
    zdot = np.concatenate([vdot, *(twists.get(body, np.zeros(6)) for body in place.bodies)])
    return {x.name: _acceleration(model, place, state, x, zdot) for x in model.accelerations}


def _acceleration(
    model: Model, place: Layout, state: State, measure: Measure, zdot: Array
) -> float:
    """over ż + rest of a velocity; q̈ = N v̇ + Ṅ v of a coordinate."""
    if measure.quantity in SECOND:
        of = replace(measure, quantity=SECOND[measure.quantity])
        velocity = _measured(model, place, state, of)
        return float(velocity.over @ zdot + velocity.rest)
    names = [x.name for x in model.coordinates]
    if measure.frame in names:
        i = names.index(measure.frame)
        return float(state.row(i) @ zdot[: place.nv] + state.drift[i])
    return float(zdot[[x.name for x in model.velocities].index(measure.frame)])


def _measured(model: Model, place: Layout, state: State, measure: Measure) -> Measured:
    if measure.quantity == "angular_velocity":
        return _as_velocity(_spin(model, place, state, measure))
    if measure.quantity == "angle":
        return _as_position(_angle(model, place, state, measure))
    of = RATES.get(measure.quantity, measure.quantity)
    kinds = {"position": _position, "orientation": _orientation, "length": _length}
    jet = kinds[of](model, place, state, measure)
    return _as_position(jet) if of == measure.quantity else _as_velocity(jet)


def _as_position(jet: Jet) -> Measured:
    return Measured(float(jet.value), float(jet.rate), jet.over, float(jet.rest), False)


def _as_velocity(jet: Jet) -> Measured:
    """The rate of a jet as a number of its own."""
    return Measured(float(jet.rate), np.nan, jet.over, float(jet.rest), True)


def _seat(model: Model, state: State, name: str) -> tuple[str, Array, Array]:
    """The body of a frame, and where the frame sits in it."""
    frame = carrier(model, name)
    return (frame.body, *placed(state, frame.at))


def _axis(model: Model, place: Layout, state: State, name: str, k: int) -> Jet:
    body, _, turn = _seat(model, state, name)
    return direction(place, state, body, turn[:, k])


def _origin(model: Model, place: Layout, state: State, name: str, inside: Array) -> Jet:
    body, position, turn = _seat(model, state, name)
    return point(place, state, body, position + turn @ inside)


def _position(model: Model, place: Layout, state: State, measure: Measure) -> Jet:
    """eₖ · (r − r_f) with the axis eₖ of the frame f."""
    here = _origin(model, place, state, measure.frame, state.vector(measure.point))
    there = _origin(model, place, state, measure.relative, np.zeros(3))
    (k,) = measure.component
    return dot(_axis(model, place, state, measure.relative, k), here - there)


def _orientation(model: Model, place: Layout, state: State, measure: Measure) -> Jet:
    row, column = measure.component
    return dot(
        _axis(model, place, state, measure.relative, row),
        _axis(model, place, state, measure.frame, column),
    )


def _length(model: Model, place: Layout, state: State, measure: Measure) -> Jet:
    return length(model.path(measure.frame), model.plane, place, state)


def _spin(model: Model, place: Layout, state: State, measure: Measure) -> Jet:
    """e · (ω − ω_f) as the rate of something: its derivative is ė · (ω − ω_f) + e · (α − α_f)."""
    first, second = (_seat(model, state, name)[0] for name in (measure.frame, measure.relative))
    gap = state.frames[first].omega - state.frames[second].omega
    if model.plane:
        axis = direction(place, state, GROUND, NORMAL[model.plane])
    else:
        (k,) = measure.component
        axis = _axis(model, place, state, measure.relative, k)
    over = np.zeros(place.size)
    for body, sign in ((first, 1.0), (second, -1.0)):
        if body != GROUND:
            over[place.twist(body)][:3] += sign * axis.value
    return Jet(np.array(np.nan), axis.value @ gap, over, axis.rate @ gap)


def _angle(model: Model, place: Layout, state: State, measure: Measure) -> Jet:
    """All turns on the way from the ground, with their whole turns."""
    spin = _spin(model, place, state, measure)
    first, second = (_total(model, state, x) for x in (measure.frame, measure.relative))
    return Jet(np.array(first - second), spin.rate, spin.over, spin.rest)


def _total(model: Model, state: State, name: str) -> float:
    frame = carrier(model, name)
    carried = {joint.child: joint for joint in model.joints}
    total, body = _plane_angle(model, placed(state, frame.at)[1]), frame.body
    while body != GROUND:
        joint = carried[body]
        total += _plane_angle(model, placed(state, joint.at_parent)[1])
        total += _turned(model, state, joint)
        total -= _plane_angle(model, placed(state, joint.at_child)[1])
        body = joint.parent
    return total


def _turned(model: Model, state: State, joint: Joint) -> float:
    """The joint's own turn: its coordinate in rad, which counts about its axis."""
    turns = [
        x for c, x in zip(model.coordinates, state.q) if c.owner == joint.name and c.unit == "rad"
    ]
    axis = state.vector(joint.axis)
    return float(sum(turns)) * (float(axis @ NORMAL[model.plane]) if axis.any() else 1.0)


def _plane_angle(model: Model, rotation: Array) -> float:
    i, j = ("xyz".index(letter) for letter in model.plane)
    return float(np.arctan2(rotation[j, i], rotation[i, i]))
