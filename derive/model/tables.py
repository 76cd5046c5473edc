"""Tables of a model: functions of one number, by points in the file or in a CSV file beside it."""

from __future__ import annotations

import re
from itertools import pairwise

from derive.expressions.functions import Function
from derive.expressions.limits import objection as too_much
from derive.expressions.mistakes import FormulaError
from derive.expressions.quantities import quantity
from derive.expressions.quantities import unit as unit_of
from derive.expressions.tables import SMOOTH, Table
from derive.model.composing.files import file_beside
from derive.model.document import Items, Key, Scalar, Source
from derive.model.language.entries import TableEntry
from derive.model.language.shape import Document
from derive.model.reader import Reader, dimension_of
from derive.model.records import Span

LARGEST = 1 << 20  # bytes of a CSV file
MOST = 500  # points: each is a few operations wherever the table is used
_NUMBER = re.compile(r"[^\s,;]+")
Point = tuple[float, float, Span]


def tables(reader: Reader, document: Document) -> tuple[Table, ...]:
    """The entries of `tables:`; their names become functions of the formulas."""
    result = [_table(reader, key, entry) for key, entry in document.tables.items()]
    return tuple(table for table in result if table is not None)


def _table(reader: Reader, key: Key, entry: TableEntry) -> Table | None:
    name = reader.name(key)
    if (entry.file is None) == (entry.points is None):
        reader.report(key.span, f"the table '{name}' needs file: or points:", "one of the two")
        return None
    smooth = "C2" if entry.smooth is None else reader.word(entry.smooth, SMOOTH, "smoothness")
    factors, units = _units(reader, entry)
    points = _from_file(reader, key, entry.file) if entry.file else _given(reader, entry.points)
    if smooth is None or not _checked(reader, key, points):
        return None
    x = tuple(point[0] * factors[0] for point in points)
    y = tuple(point[1] * factors[1] for point in points)
    reader.functions[name] = Function(name, (1, 1), "table", "a table of the model")
    of, gives = (dimension_of(unit) for unit in units)
    reader.scope.dimensions |= {f"{name}(": of, f"{name}()": gives}
    return Table(name, x, y, units, smooth)


def _units(reader: Reader, entry: TableEntry) -> tuple[tuple[float, float], tuple[str, str]]:
    if entry.units is None:
        return (1.0, 1.0), ("", "")
    if len(entry.units) != 2:
        reader.report(entry.units.span, f"{len(entry.units)} units", "two: of x and of y")
        return (1.0, 1.0), ("", "")
    factors = [_unit(reader, scalar) for scalar in entry.units]
    return (factors[0][0], factors[1][0]), (factors[0][1], factors[1][1])


def _unit(reader: Reader, scalar: Scalar) -> tuple[float, str]:
    try:
        given = unit_of(scalar.text)
        return given.factor, given.si
    except FormulaError as error:
        reader.fault(scalar, error)
        return 1.0, ""


def _given(reader: Reader, points: Items | None) -> list[Point]:
    result: list[Point] = []
    for entry in points or ():
        if not isinstance(entry, Items) or len(entry) != 2:
            reader.report(entry.span, "a point of a table", "two numbers, [x, y]")
            continue
        numbers = [_plain(reader, scalar) for scalar in entry]
        if None not in numbers:
            x, y = (number for number in numbers if number is not None)
            result.append((x, y, entry.span))
    return result


def _plain(reader: Reader, scalar: Scalar | Items) -> float | None:
    number = quantity(scalar.text) if isinstance(scalar, Scalar) else None
    if number is None or number.unit:
        reader.report(scalar.span, "an entry of a table", "a plain number; units: gives its unit")
        return None
    return number.value


def _from_file(reader: Reader, key: Key, given: Scalar) -> list[Point]:
    name, text = file_beside(reader.source, given, LARGEST)
    source = reader.source
    number = len(source.others) + 1
    folder = source.folder
    shown = str(folder / name) if folder is not None and str(folder) != "." else name
    other = Source(text, shown, folder, number)
    source.others.append(other)
    where = f"{key} is used at {source.file}:{key.span.line}:{key.span.column}"
    rows = [
        (line, list(_NUMBER.finditer(text.split("#")[0])))
        for line, text in enumerate(other.lines, 1)
    ]
    rows = [(line, words) for line, words in rows if words]
    if rows and all(_number(word[0]) is None for word in rows[0][1]):
        rows = rows[1:]  # a head
    return [
        point
        for line, words in rows
        if (point := _row(reader, line, words, (number, where))) is not None
    ]


def _row(
    reader: Reader, line: int, words: list[re.Match[str]], place: tuple[int, str]
) -> Point | None:
    span = Span(line, words[0].start() + 1, len(words[0][0]), *place)
    if len(words) != 2:
        reader.report(span, f"{len(words)} columns in a row of a table", "two: x and y")
        return None
    for word in words:
        if _number(word[0]) is None:
            at = Span(line, word.start() + 1, len(word[0]), *place)
            reader.report(at, f"'{word[0]}' in a table", "a number")
            return None
    x, y = (float(word[0]) for word in words)
    return x, y, span


def _number(text: str) -> float | None:
    if not re.fullmatch(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", text):
        return None
    value = float(text)
    return None if too_much(value) else value


def _checked(reader: Reader, key: Key, points: list[Point]) -> bool:
    if not 2 <= len(points) <= MOST:
        if not reader.problems:
            expected = f"2 to {MOST}"
            reader.report(key.span, f"the table '{key}' of {len(points)} points", expected)
        return False
    for before, after in pairwise(points):
        if not before[0] < after[0]:
            message = f"x = {after[0]:g} after x = {before[0]:g} in the table '{key}'"
            reader.report(after[2], message, "x strictly increasing")
            return False
    return True
