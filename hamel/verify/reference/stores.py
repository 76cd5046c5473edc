"""What first-order states store, and the power at which they are charged."""

from __future__ import annotations

from dataclasses import replace

from derive.model.records import Model
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array

STEPS = (1.0, 0.5)  # of the difference, in units of the cube root of rounding


def stored(model: Model, s: State) -> float:
    """Σ E over the states of which the model gives an energy, in J."""
    return sum(s.value(state.energy) for state in model.states if state.energy is not None)


def charging(model: Model, s: State, zdot: Array) -> float:
    """Σ ∂E/∂z ż in W, by central differences and one of Richardson's steps."""
    if all(state.energy is None for state in model.states):
        return 0.0
    return float(sum(_slope(model, s, k) * rate for k, rate in enumerate(zdot)))


def _slope(model: Model, s: State, k: int) -> float:
    name = model.states[k].name
    size = 1e-3 * (1.0 + abs(s.names[name]))
    coarse, fine = (_difference(model, s, name, size * share) for share in STEPS)
    return (4.0 * fine - coarse) / 3.0


def _difference(model: Model, s: State, name: str, size: float) -> float:
    ends = [stored(model, _moved(s, name, sign * size)) for sign in (1.0, -1.0)]
    return (ends[0] - ends[1]) / (2.0 * size)


def _moved(s: State, name: str, by: float) -> State:
    names = {**s.names, name: s.names[name] + by}
    return replace(s, names=names)
