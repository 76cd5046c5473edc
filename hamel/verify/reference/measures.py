"""Measures of the motion that formulas use, with their rates: a second time, as jets.

What is seen from a moving frame is the product of its axes with a vector, and all is differentiated
by the rule for products. A velocity has a rate but no position: its jet holds the rate's own
derivative, over ż.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from derive.model.mechanism.named_frames import carrier
from derive.model.records import GROUND, Joint, Measure, Model
from hamel.verify.reference.jets import Jet, direction, dot, point
from hamel.verify.reference.layout import layout
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


class _Seen:
    """Points and axes at one state, each found once: three components of a position, and its rate,
    are of the same points."""

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state, self.place = model, state, layout(model)
        self._axes: dict[tuple[str, int], Jet] = {}
        self._gaps: dict[tuple[str, str, int], Jet] = {}
        self._seats: dict[str, tuple[str, Array, Array]] = {}

    def seat(self, name: str) -> tuple[str, Array, Array]:
        """The body of a frame, and where the frame sits in it."""
        if name not in self._seats:
            frame = carrier(self.model, name)
            self._seats[name] = (frame.body, *placed(self.state, frame.at))
        return self._seats[name]

    def axis(self, name: str, k: int) -> Jet:
        """e_k of a frame."""
        if (name, k) not in self._axes:
            body, _, turn = self.seat(name)
            self._axes[name, k] = direction(self.place, self.state, body, turn[:, k])
        return self._axes[name, k]

    def gap(self, measure: Measure) -> Jet:
        """r − r_f of a measure's point and the origin of the frame f it is seen from."""
        key = (measure.frame, measure.relative, id(measure.point))
        if key not in self._gaps:
            here = self._origin(measure.frame, self.state.vector(measure.point))
            self._gaps[key] = here - self._origin(measure.relative, np.zeros(3))
        return self._gaps[key]

    def _origin(self, name: str, inside: Array) -> Jet:
        body, position, turn = self.seat(name)
        return point(self.place, self.state, body, position + turn @ inside)


def values(model: Model, state: State) -> Mapping[str, float]:
    """Every measure of the model by name."""
    return {name: x.value for name, x in measured(model, state).items()}


def measured(model: Model, state: State) -> dict[str, Measured]:
    """Every measure of the model by name, with derivatives."""
    if not model.measures:
        return {}
    seen = _Seen(model, state)
    return {measure.name: _measured(seen, measure) for measure in model.measures}


def accelerations(
    model: Model, state: State, vdot: Array, twists: Mapping[str, Array]
) -> Mapping[str, float]:
    """Every acceleration of outputs by name, at the rates v̇ of the velocities and those of the
    twists of bodies."""
    place = layout(model)
    zdot = np.concatenate([vdot, *(twists.get(body, np.zeros(6)) for body in place.bodies)])
    seen = _Seen(model, state)
    return {x.name: _acceleration(seen, x, zdot) for x in model.accelerations}


def _acceleration(seen: _Seen, measure: Measure, zdot: Array) -> float:
    """over ż + rest of a velocity; q̈ = N v̇ + Ṅ v of a coordinate."""
    model, state = seen.model, seen.state
    if measure.quantity in SECOND:
        of = replace(measure, quantity=SECOND[measure.quantity])
        velocity = _measured(seen, of)
        return float(velocity.over @ zdot + velocity.rest)
    names = [x.name for x in model.coordinates]
    if measure.frame in names:
        i = names.index(measure.frame)
        return float(state.row(i) @ zdot[: seen.place.nv] + state.drift[i])
    return float(zdot[[x.name for x in model.velocities].index(measure.frame)])


def _measured(seen: _Seen, measure: Measure) -> Measured:
    if measure.quantity == "angular_velocity":
        return _as_velocity(_spin(seen, measure))
    if measure.quantity == "angle":
        return _as_position(_angle(seen, measure))
    of = RATES.get(measure.quantity, measure.quantity)
    kinds = {"position": _position, "orientation": _orientation, "length": _length}
    jet = kinds[of](seen, measure)
    return _as_position(jet) if of == measure.quantity else _as_velocity(jet)


def _as_position(jet: Jet) -> Measured:
    return Measured(float(jet.value), float(jet.rate), jet.over, float(jet.rest), False)


def _as_velocity(jet: Jet) -> Measured:
    """The rate of a jet as a number of its own."""
    return Measured(float(jet.rate), np.nan, jet.over, float(jet.rest), True)


def _position(seen: _Seen, measure: Measure) -> Jet:
    """eₖ · (r − r_f) with the axis eₖ of the frame f."""
    (k,) = measure.component
    return dot(seen.axis(measure.relative, k), seen.gap(measure))


def _orientation(seen: _Seen, measure: Measure) -> Jet:
    row, column = measure.component
    return dot(seen.axis(measure.relative, row), seen.axis(measure.frame, column))


def _length(seen: _Seen, measure: Measure) -> Jet:
    model = seen.model
    return length(model.path(measure.frame), model.plane, seen.place, seen.state)


def _spin(seen: _Seen, measure: Measure) -> Jet:
    """e · (ω − ω_f) as the rate of something: its derivative is ė · (ω − ω_f) + e · (α − α_f)."""
    model, place, state = seen.model, seen.place, seen.state
    first, second = (seen.seat(name)[0] for name in (measure.frame, measure.relative))
    gap = state.frames[first].omega - state.frames[second].omega
    if model.plane:
        axis = direction(place, state, GROUND, NORMAL[model.plane])
    else:
        (k,) = measure.component
        axis = seen.axis(measure.relative, k)
    over = np.zeros(place.size)
    for body, sign in ((first, 1.0), (second, -1.0)):
        if body != GROUND:
            over[place.twist(body)][:3] += sign * axis.value
    return Jet(np.array(np.nan), axis.value @ gap, over, axis.rate @ gap)


def _angle(seen: _Seen, measure: Measure) -> Jet:
    """All turns on the way from the ground, with their whole turns."""
    spin = _spin(seen, measure)
    first, second = (_total(seen.model, seen.state, x) for x in (measure.frame, measure.relative))
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
