"""What several loads say in one way: units of force per motion, the two points of a load between
bodies."""

from __future__ import annotations

from typing import Any

from derive.expressions.quantities import unit as parsed_unit
from derive.expressions.tree import ZERO, Expression
from derive.expressions.units import pretty, quotient_of
from derive.model.document import Items, Key, Scalar
from derive.model.language.kind import Bodies
from derive.model.mechanism.tree import bodies
from derive.model.reader import Reader
from derive.model.records import GROUND, Vector3
from derive.model.scope import CONSTANT


def per(force: str, motion: str) -> str:
    """The unit of force per motion, in words people use: N/m, N*s/m, N*m/rad, N*m*s/rad."""
    known = {
        "m": "N/m",
        "rad": "N*m/rad",
        "m/s": "N*s/m",
        "rad/s": "N*m*s/rad",
        "": "N*m",
        "1/s": "N*m*s",
    }
    if motion in known:
        return known[motion]
    return pretty(quotient_of(parsed_unit(force).dimension, parsed_unit(motion).dimension))


def optional(reader: Reader, scalar: Scalar | None, where: str, unit: str) -> Expression:
    """A formula, or zero where the file gives none; `unit` is what it must come out in."""
    return ZERO if scalar is None else reader.formula(scalar, where, unit=unit)


def single(reader: Reader, node: Scalar | Items, what: str) -> Scalar:
    """The formula itself; the first one after reporting a list."""
    if not isinstance(node, Items):
        return node
    reader.report(node.span, f"{what} with {len(node)} components", "one number")
    return next(iter(node))


def not_negative(
    reader: Reader,
    scalar: Scalar | None,
    what: str,
    where: str,
    unit: str,
    allowed: frozenset[str] = CONSTANT,
) -> Expression:
    """A formula that must not be negative; zero where it is not given. Only a value that is known
    from the defaults of the parameters is judged."""
    if scalar is None:
        return ZERO
    formula = reader.formula(scalar, where, allowed, unit)
    value = reader.value(formula, scalar)
    if value is not None and value < 0.0:
        reader.report(scalar.span, f"{what} is {value:g}", "zero or more")
    return formula


def axes(reader: Reader, document: Bodies, scalar: Scalar | None, own: str) -> str:
    """Along which axes components are: `own`, those of a body, joint or frame by its name, or the
    ground's, also where the file does not say."""
    if scalar is None:
        return GROUND
    known = (GROUND, own, *map(str, (*document.frames, *document.bodies, *document.joints)))
    return reader.word(scalar, known, "axes") or GROUND


SLACK = {"rest": "length", "length": "rest"}  # where a spring of the other form is slack


def refuse_keys(
    reader: Reader, key: Key, entry: object, fields: tuple[str, ...], where: str
) -> None:
    """Keys that belong to the other form of a spring or damper."""
    for name in fields:
        value = getattr(entry, name)
        if value is not None:
            span = value.span if isinstance(value, Scalar | Items) else value[0].span
            reader.report(
                span,
                f"'{name}' of '{key}' belongs to a load {where}",
                "between: [body, body] with at: [[…], […]], or a joint",
                f"did you mean '{SLACK[name]}'?" if name in SLACK else "",
            )


def two_points(
    reader: Reader, document: Bodies, key: Key, entry: Any, at_joint: tuple[str, ...]
) -> tuple[tuple[str, str], tuple[Vector3, Vector3]]:
    """The bodies and points of a load between two; `at_joint`: keys that are none of its."""
    refuse_keys(reader, key, entry, at_joint, "at a joint")
    pair = bodies(reader, document, key, entry.between)
    if entry.at is None:
        reader.report(
            key.span,
            f"'{key}' does not say which points it joins",
            "at: [[…], […]], a point of each body",
        )
        return pair, (reader.point(None, ""), reader.point(None, ""))
    return pair, (reader.point(entry.at[0], "a point"), reader.point(entry.at[1], "a point"))
