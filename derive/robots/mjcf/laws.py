"""Force laws of MJCF actuators: gains, biases and an activation, which every kind of actuator
writes in a way of its own.

A class of defaults has one record of these, which starts as that of the class around it, and every
kind writes over it. A kind builds on what was written last where that was of its own kind, or by
<general> with gains of its type; else on what stood last in the class around, by the same rule,
and at the end on nothing. So the last kind of a class hides the others, whose numbers are lost:
such is MuJoCo 4.0.0, whose XML reference says what the kinds write. <general> builds on all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
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
    """What is written so far. b₂ above zero is a damping ratio where b₁ = −g₀. `foreign`: a kind of
    actuator below it that is not read."""

    gain: Three = (1.0, 0.0, 0.0)
    bias: Three = (0.0, 0.0, 0.0)
    lag: float = 1.0
    gaintype: str = "fixed"
    biastype: str = "none"
    dyntype: str = "none"
    foreign: str = ""


@dataclass(frozen=True)
class _Written:
    """The record of a class of defaults, and the kind of actuator that wrote last."""

    kind: str
    record: _Record


def law_of(reading: Reading, actuator: Element, found: Settings) -> Law | None:
    """The force law of an actuator; None after reporting one that cannot be read."""
    if actuator.tag not in _WRITERS:
        known = ", ".join(_WRITERS)
        reading.report(actuator, f"a <{actuator.tag}> actuator, which has a law of its own", known)
        return None
    record = _below(actuator.tag, _defaults_of(reading, actuator, found))
    return _law(reading, actuator, _WRITERS[actuator.tag](reading, actuator, record))


def _defaults_of(reading: Reading, actuator: Element, found: Settings) -> list[_Written]:
    """What the classes of an actuator have written in the end, the outermost first."""
    levels = [_Written(GENERAL, _Record())]
    for elements in found.laws.get(actuator.get("class") or "main", ()):
        levels.append(levels[-1])
        for element in elements:
            if element.tag in _WRITERS:
                below = _below(element.tag, levels)
                record = _WRITERS[element.tag](reading, element, below)
            else:
                record = _Record(foreign=element.tag)
            levels[-1] = _Written(element.tag, record)
    return levels


def _below(kind: str, levels: Sequence[_Written]) -> _Record:
    """What an element of a kind writes over."""
    if kind == GENERAL:
        return levels[-1].record
    suited = (w.record for w in reversed(levels) if w.kind == kind or _suits(kind, w))
    return next(suited, _Record())


def _suits(kind: str, written_last: _Written) -> bool:
    gaintype = "affine" if kind == "damper" else "fixed"
    return written_last.kind == GENERAL and written_last.record.gaintype == gaintype


def _law(reading: Reading, actuator: Element, record: _Record) -> Law | None:
    if record.foreign:
        problem = f"a <{actuator.tag}> over defaults of a <{record.foreign}>"
        reading.report(actuator, problem, f"a class without <{record.foreign}>")
        return None
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
    return _Record()


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
    filtered = "timeconst" in element.attributes or record.dyntype == "filterexact"
    lag = scalar(reading, element, "timeconst", record.lag) if filtered else 1.0
    return _Record(
        gain=(kp, 0.0, 0.0),
        bias=(0.0, -kp, damping),
        lag=lag,
        biastype="affine",
        dyntype="filterexact" if filtered and lag > 0.0 else "none",
        foreign=record.foreign,
    )


def _intvelocity(reading: Reading, element: Element, record: _Record) -> _Record:
    return replace(_position(reading, element, record), dyntype="integrator")


def _velocity(reading: Reading, element: Element, record: _Record) -> _Record:
    """kv (u − dℓ/dt)."""
    kv = scalar(reading, element, "kv", record.gain[0])
    return _Record(
        gain=(kv, 0.0, 0.0),
        bias=(0.0, 0.0, -kv),
        biastype="affine",
        foreign=record.foreign,
    )


def _damper(reading: Reading, element: Element, record: _Record) -> _Record:
    """−kv dℓ/dt u."""
    kv = scalar(reading, element, "kv", -record.gain[2] if record.gaintype == "affine" else 0.0)
    return _Record(gain=(0.0, 0.0, -kv), gaintype="affine", foreign=record.foreign)


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
