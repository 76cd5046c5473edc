"""Initial values of unit quaternions: all four entries together, brought to length one."""

from __future__ import annotations

import math
from dataclasses import replace

from derive.expressions.tree import ZERO, Call, Expression, Number, Power, Quotient, Sum
from derive.model.document import Scalar
from derive.model.limits import UNIT_LENGTH
from derive.model.mechanism.frames import Frame
from derive.model.reader import Reader
from derive.model.records import Coordinate, InitialValue

Found = dict[str, InitialValue]


def normalise(reader: Reader, joints: list[Frame], found: Found) -> None:
    """Complete and normalise the quaternions of which `found` has an entry; without any they start
    as (1, 0, 0, 0)."""
    for frame in joints:
        first = frame.type.unit_from
        entries = frame.coordinates[first : first + 4] if first >= 0 else ()
        if any(entry.name in found for entry in entries):
            _normalise(reader, frame, entries, found)


def _normalise(reader: Reader, frame: Frame, entries: tuple[Coordinate, ...], found: Found) -> None:
    given = [found[entry.name] for entry in entries if entry.name in found]
    if entries[0].name not in found:
        wanted = (
            f"{entries[0].name} too: (1, 0, 0, 0) is no turn, (cos(a/2), sin(a/2), 0, 0) "
            "one by a about x"
        )
        reader.report(
            given[0].span, f"a quaternion without its first entry '{entries[0].name}'", wanted
        )
        return
    for entry in entries:
        found.setdefault(entry.name, InitialValue(entry.name, ZERO, False, given[0].span))
    formulas = [found[entry.name].value for entry in entries]
    scalar = Scalar("", given[0].span, False, True)
    values = [reader.value(formula, scalar) for formula in formulas]
    numbers = [value for value in values if value is not None]
    if len(numbers) < 4:
        return
    length = math.hypot(*numbers)
    if length == 0.0:
        wanted = "entries that are not all zero, such as 1, 0, 0, 0"
        reader.report(given[0].span, f"the initial quaternion of '{frame.name}' is zero", wanted)
    elif abs(length - 1.0) > UNIT_LENGTH:
        for entry, formula, value in zip(entries, formulas, numbers):
            scaled = _over_length(formula, formulas, value / length)
            found[entry.name] = replace(found[entry.name], value=scaled)


def _over_length(formula: Expression, formulas: list[Expression], value: float) -> Expression:
    """By numbers where all entries are numbers, else as a formula that follows the parameters."""
    if all(isinstance(entry, Number) for entry in formulas):
        return Number(value)
    squares = tuple(Power(entry, Number(2.0)) for entry in formulas)
    return Quotient(formula, Call("sqrt", (Sum(squares),)))
