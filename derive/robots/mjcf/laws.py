"""Force laws of MJCF actuators: gains, biases and an activation, which every kind of actuator
writes in a way of its own.

A class of defaults has a record of these for each kind. What it says of <general> is written over
that of <general>, and stands for all kinds with gains of its type then; what it says of another
kind is written over that of the kind, and stands for <general> as well. An actuator is written over
the record of its kind. So does MuJoCo 4.0.0, whose XML reference says what the kinds write; where
several kinds of defaults meet (`is_mixed`), it looks further for a record that suits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from derive.robots.markup import Element
from derive.robots.mjcf.settings import Settings
from derive.robots.numbers import listing, scalar, written
from derive.robots.robot import Reading

Three = tuple[float, float, float]
GENERAL = "general"
TYPES = {
    "gaintype": ("fixed", "affine"),
    "biastype": ("none", "affine"),
    "dyntype": ("none", "integrator", "filter", "filterexact"),
}


@dataclass(frozen=True)
class Activation:
    """a' = u, or (u − a)/τ with a time constant τ in seconds; the force takes a for u. A number
    without a unit, so that gains have that of a force."""

    lag: float | None

    def rate(self, u: str, a: str) -> str:
        return f"{u}/(1 s)" if self.lag is None else f"({u} - {a})/({written(self.lag)} s)"


@dataclass(frozen=True)
class Law:
    """force = (g₀ + g₁ ℓ + g₂ dℓ/dt) u + b₀ + b₁ ℓ + b₂ dℓ/dt, with the activation for u where
    there is one. `ratio`: b₂ as a part of the critical damping, where it is not zero."""

    gain: Sequence[float]
    bias: Sequence[float]
    activation: Activation | None = None
    ratio: float = 0.0

    @property
    def plain(self) -> bool:
        """Whether the force is gain · control alone, without a term in length or velocity."""
        return not any(self.gain[1:]) and not any(self.bias)


@dataclass(frozen=True)
class _Record:
    """What is written so far. b₂ above zero is a damping ratio where b₁ = −g₀."""

    gain: Three = (1.0, 0.0, 0.0)
    bias: Three = (0.0, 0.0, 0.0)
    lag: float = 1.0
    gaintype: str = "fixed"
    biastype: str = "none"
    dyntype: str = "none"


def law_of(reading: Reading, actuator: Element, found: Settings) -> Law | None:
    """The force law of an actuator; None after reporting one that cannot be read."""
    if actuator.tag not in _WRITERS:
        known = ", ".join(_WRITERS)
        reading.report(actuator, f"a <{actuator.tag}> actuator, which has a law of its own", known)
        return None
    records = dict.fromkeys(_WRITERS, _Record())
    for element in found.laws.get(actuator.get("class") or "main", ()):
        if element.tag not in _WRITERS:
            continue  # of a kind that is refused where it stands for itself
        record = _WRITERS[element.tag](reading, element, records[element.tag])
        records |= dict.fromkeys(_takers(element.tag, record), record)
    record = _WRITERS[actuator.tag](reading, actuator, records[actuator.tag])
    return _law(reading, actuator, record)


def _takers(kind: str, record: _Record) -> Iterable[str]:
    """Kinds of actuators for which the record stands."""
    if kind != GENERAL:
        return (kind, GENERAL)
    affine = record.gaintype == "affine"
    return (GENERAL, *(one for one in _WRITERS if affine == (one == "damper")))


def is_mixed(actuator: Element, found: Settings) -> bool:
    """Whether several kinds of defaults meet, one of them another than the actuator's."""
    kinds = {element.tag for element in found.laws.get(actuator.get("class") or "main", ())}
    return len(kinds) > 1 and bool(kinds - {actuator.tag, GENERAL})


def _law(reading: Reading, actuator: Element, record: _Record) -> Law | None:
    for attribute, allowed in TYPES.items():
        given = getattr(record, attribute)
        if given not in allowed:
            problem = f"{attribute}='{given}'"
            reading.report(actuator, problem, ", ".join(allowed), attribute=attribute)
            return None
    law = Law(record.gain if record.gaintype == "affine" else record.gain[:1], ())
    if record.biastype == "affine":
        servo = record.bias[2] > 0.0 and record.gain[0] == -record.bias[1]
        bias = (*record.bias[:2], 0.0) if servo else record.bias
        law = replace(law, bias=bias, ratio=record.bias[2] if servo else 0.0)
    if record.dyntype == "none":
        return law
    if record.dyntype == "integrator":
        return replace(law, activation=Activation(None))
    if record.lag > 0.0:
        return replace(law, activation=Activation(record.lag))
    problem = f"an activation with the time constant {written(record.lag)} s"
    reading.report(actuator, problem, "a positive one")
    return None


def _general(reading: Reading, element: Element, record: _Record) -> _Record:
    return replace(
        record,
        gain=_overlaid(reading, element, "gainprm", record.gain),
        bias=_overlaid(reading, element, "biasprm", record.bias),
        lag=(listing(reading, element, "dynprm") or [record.lag])[0],
        gaintype=element.get("gaintype", record.gaintype),
        biastype=element.get("biastype", record.biastype),
        dyntype=element.get("dyntype", record.dyntype),
    )


def _overlaid(reading: Reading, element: Element, attribute: str, before: Three) -> Three:
    """The first numbers of a list over those that were there."""
    given = (listing(reading, element, attribute) or [])[:3]
    a, b, c = (*given, *before[len(given) :])
    return (a, b, c)


def _motor(reading: Reading, element: Element, record: _Record) -> _Record:
    return replace(
        record,
        gain=(1.0, 0.0, 0.0),
        bias=(0.0, 0.0, 0.0),
        gaintype="fixed",
        biastype="none",
        dyntype="none",
    )


def _position(reading: Reading, element: Element, record: _Record) -> _Record:
    """kp (u − ℓ) − kv dℓ/dt, u through a filter where there is a time constant."""
    kp, damping = scalar(reading, element, "kp", record.gain[0]), record.bias[2]
    if "kv" in element.attributes:
        damping = -scalar(reading, element, "kv")
    if "kv" in element.attributes and "dampratio" in element.attributes:
        reading.report(element, "kv and dampratio of one actuator", "one of them", "", "dampratio")
    if "dampratio" in element.attributes:
        damping = scalar(reading, element, "dampratio")
        if damping < 0.0:
            problem = "a damping ratio below zero"
            reading.report(element, problem, "zero or more", attribute="dampratio")
    dyntype = "filterexact" if record.dyntype == "filterexact" else "none"
    if "timeconst" in element.attributes:
        lag = scalar(reading, element, "timeconst")
        dyntype, record = ("filterexact" if lag > 0.0 else "none"), replace(record, lag=lag)
    return replace(
        record,
        gain=(kp, 0.0, 0.0),
        bias=(0.0, -kp, damping),
        gaintype="fixed",
        biastype="affine",
        dyntype=dyntype,
    )


def _intvelocity(reading: Reading, element: Element, record: _Record) -> _Record:
    return replace(_position(reading, element, record), dyntype="integrator")


def _velocity(reading: Reading, element: Element, record: _Record) -> _Record:
    """kv (u − dℓ/dt)."""
    kv = scalar(reading, element, "kv", record.gain[0])
    return replace(
        record,
        gain=(kv, 0.0, 0.0),
        bias=(0.0, 0.0, -kv),
        gaintype="fixed",
        biastype="affine",
        dyntype="none",
    )


def _damper(reading: Reading, element: Element, record: _Record) -> _Record:
    """−kv dℓ/dt u."""
    kv = scalar(reading, element, "kv", -record.gain[2] if record.gaintype == "affine" else 0.0)
    return replace(record, gain=(0.0, 0.0, -kv), gaintype="affine", biastype="none", dyntype="none")


def _cylinder(reading: Reading, element: Element, record: _Record) -> _Record:
    """Of pressure a: force area · a + bias, a' = (u − a)/timeconst."""
    area = scalar(reading, element, "area", record.gain[0])
    if "diameter" in element.attributes:
        area = math.pi / 4.0 * scalar(reading, element, "diameter") ** 2
    return replace(
        record,
        gain=(area, 0.0, 0.0),
        bias=_overlaid(reading, element, "bias", record.bias),
        lag=scalar(reading, element, "timeconst", record.lag),
        gaintype="fixed",
        biastype="affine",
        dyntype="filter",
    )


_WRITERS: dict[str, Callable[[Reading, Element, _Record], _Record]] = {
    GENERAL: _general,
    "motor": _motor,
    "position": _position,
    "velocity": _velocity,
    "damper": _damper,
    "intvelocity": _intvelocity,
    "cylinder": _cylinder,
}
