"""A model's own units: the powers of a thousand of metre, kilogram and second nearest to the
magnitudes it is made of.

Random states are drawn, and errors judged, in these: a mechanism of a micrometre given in metres is
looked at as one of a metre is. For most models they are SI itself. The magnitudes are those of the
file: masses, lengths, inertias, gravity, and whatever has a unit; their logarithms are fitted by
logarithms of the three units, all with the same weight.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from fractions import Fraction
from typing import cast

import casadi as ca
import numpy as np

from derive.expressions import tree
from derive.expressions.deferred import changed
from derive.expressions.evaluate import number
from derive.expressions.mistakes import FormulaError
from derive.expressions.quantities import unit as unit_of
from derive.expressions.tree import Expression
from derive.expressions.units import (
    LENGTH,
    MASS,
    TIME,
    Dimension,
    power_of,
    product_of,
    quotient_of,
)
from derive.mechanics.records import System
from derive.model.records import Model
from derive.states.limits import FARTHEST, PLACES, ROUNDOFF, SMALL, STEP, UNKNOWN

INERTIA = product_of(MASS, power_of(LENGTH, Fraction(2)))
ACCELERATION = quotient_of(LENGTH, power_of(TIME, Fraction(2)))

Magnitude = tuple[Dimension, float]


@dataclass(frozen=True)
class Scales:
    """In metres, kilograms and seconds."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @property
    def plain(self) -> bool:
        """Whether the model's own units are SI itself."""
        return self.length == self.mass == self.time == 1.0

    @property
    def energy(self) -> float:
        """One of the model's own units of energy, in J: m l²/t²."""
        return self.mass * (self.length / self.time) ** 2

    @property
    def power(self) -> float:
        """One of the model's own units of power, in W: m l²/t³."""
        return self.energy / self.time

    def of(self, unit: str) -> float:
        """One of the model's own in SI, for a unit as the records spell it; 1 for plain numbers and
        angles."""
        m, kg, s, _ = unit_of(unit).dimension
        return float(self.length ** float(m) * self.mass ** float(kg) * self.time ** float(s))

    def all_of(self, units: Iterable[str]) -> np.ndarray:
        """One of the model's own units in SI for each of these, (n,): own = SI / this."""
        return np.array([self.of(unit) for unit in units], dtype=float)


def scales(model: Model) -> Scales:
    """The model's own units; where nothing in it tells, say, of mass, that is the kilogram. Powers
    of a thousand, so that converting a number rounds it but does not change how it reads."""
    result = [
        (dimension, abs(value))
        for dimension, value in _magnitudes(model)
        if any(dimension[:3]) and value
    ]
    if not result:
        return Scales()
    powers = np.array([[float(k) for k in dimension[:3]] for dimension, _ in result])
    decades = np.linalg.lstsq(powers, np.log10([value for _, value in result]), rcond=UNKNOWN)[0]
    return Scales(*(_power(x) for x in np.clip(decades, -FARTHEST, FARTHEST)))


def _power(decades: float) -> float:
    """The power of a thousand next above."""
    return float(f"1e{STEP * round((decades + SMALL) / STEP)}")


def scaled(system: System, own: Scales) -> System:
    """The kinematics and M of a system in the model's own units, for whoever draws or closes
    states; forces stay in SI. Rows of A are also divided by their usual size, as the unit of a
    formula cannot always be told."""
    model = system.model
    units = {x.name: x.unit for x in (*model.coordinates, *model.velocities, *model.speeds)}
    q, v = (own.all_of(x.unit for x in items) for items in (model.coordinates, model.velocities))
    p = own.all_of(x.unit for x in system.given)
    values = {x.name: x.value for x in model.parameters} | {"t": 0.0}
    start = tuple(
        replace(x, value=tree.Number(number(x.value, values) / own.of(units.get(x.name, "rad/s"))))
        for x in model.initial
    )
    parameters = tuple(float(x) for x in np.array(system.parameters) / p)
    rates = ca.DM(own.time / q)
    substituted = ca.substitute(
        [
            system.phi / own.time,
            system.assembly / own.time,
            ca.mtimes(system.A, ca.diag(ca.DM(v))),
            system.c,
            ca.mtimes(ca.diag(rates), ca.mtimes(system.N, ca.diag(ca.DM(v)))),
            ca.DM(np.outer(v, v) / own.energy) * system.M if system.written else system.M,
            rates * system.qdot,
        ],
        [system.t, system.q, system.v, system.p],
        [own.time * system.t, ca.DM(q) * system.q, ca.DM(v) * system.v, ca.DM(p) * system.p],
    )
    terms = dict(zip(("phi", "assembly", "A", "c", "N", "M", "qdot"), substituted))
    return _of_like_rows(
        changed(system, model=replace(model, initial=start), parameters=parameters, **terms)
    )


def _of_like_rows(system: System) -> System:
    """Every row divided by its usual size; what its own unit is cannot always be told."""
    if not system.rows:
        return system
    at, rng, p = (
        ca.Function("A", [system.t, system.q, system.p], [system.A]),
        np.random.default_rng(0),
        system.parameters,
    )
    places = rng.uniform(-1.0, 1.0, (PLACES, system.q.numel()))
    sizes = [
        np.max(np.abs(np.nan_to_num(at(0.0, q, p).full())), axis=1, initial=0.0) for q in places
    ]
    rows = typical(_without_roundoff(system, np.array(sizes)))
    positions = np.zeros(system.phi.numel())
    for size, row in zip(rows, system.rows):
        if row.position >= 0:
            positions[row.position] = size
    by_row = ca.DM(1.0 / rows)
    A, c, phi, assembly = (
        ca.mtimes(ca.diag(by_row), system.A),
        by_row * system.c,
        system.phi / ca.DM(positions),
        system.assembly / ca.DM(positions),
    )
    return changed(system, A=A, c=c, phi=phi, assembly=assembly)


def _without_roundoff(system: System, sizes: np.ndarray) -> np.ndarray:
    """The sizes of rows at some places (places × rows), those of rows of closures that are nothing
    but rounding the largest of closures: made as long as others they would be contradictions. The
    units of closures are known, so that their rows compare; a formula may be in any."""
    names = {closure.name for closure in system.model.closures}
    own = np.array([row.name.partition(".")[0] in names for row in system.rows])
    largest = np.max(sizes, axis=1, initial=0.0, where=own, keepdims=True)
    return np.where(own & (sizes <= ROUNDOFF * largest), largest, sizes)


def typical(sizes: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """The median of each column, as a power of a thousand; one where it is zero. A median, as one
    state near a singular position should not tell what is usual."""
    if not len(sizes):
        return np.zeros(0)
    middle = np.median(sizes, axis=0)
    return 1000.0 ** np.round(np.log10(np.where(middle > 0.0, middle, 1.0)) / STEP)


def _magnitudes(model: Model) -> Iterator[Magnitude]:
    values = {x.name: x.value for x in model.parameters}
    yield from ((unit_of(x.unit).dimension, x.value) for x in model.parameters)
    for body in model.bodies:
        yield from _sized(MASS, [body.mass], values)
        yield from _sized(LENGTH, body.com, values)
        yield from _sized(INERTIA, body.inertia[:3], values)
    places = [place for joint in model.joints for place in (joint.at_parent, joint.at_child)]
    places += [place for closure in model.closures for place in closure.placements]
    yield from (each for place in places for each in _sized(LENGTH, place.position, values))
    yield from _sized(ACCELERATION, model.gravity or (), values)
    moving = (*model.coordinates, *model.velocities, *model.speeds)
    units = {item.name: item.unit for item in moving}
    for given in model.initial:
        yield from _sized(unit_of(units.get(given.name, "")).dimension, [given.value], values)
    formulas = (model.kinetic, model.potential, model.constraints, model.loads)
    yield from ((unit_of(x.unit).dimension, x.value) for x in _numbers(formulas) if x.unit)


def _sized(
    dimension: Dimension, entries: Sequence[Expression], values: Mapping[str, float]
) -> Iterator[Magnitude]:
    """What has a value before anything moves."""
    for entry in entries:
        try:
            yield dimension, number(entry, values)
        except (FormulaError, KeyError):
            continue


def _numbers(part: object) -> Iterator[tree.Number]:
    """All numbers in the formulas of a record."""
    if isinstance(part, tree.Number):
        yield part
    elif isinstance(part, tuple):
        for item in cast(tuple[object, ...], part):
            yield from _numbers(item)
    elif is_dataclass(part):
        yield from (
            result for field in fields(part) for result in _numbers(getattr(part, field.name))
        )
