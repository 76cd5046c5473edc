"""Inputs that change on the way: tables from files and arrays, functions; read and checked before
anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from codegen.runtime.inputs import KINDS, Table, check_cover, sample_times, source
from derive.diagnostics import Diagnostic, ModelError, did_you_mean, listed
from derive.model.records import Model
from hamel.simulate.limits import MOST_POINTS

Function = Callable[[float, np.ndarray], Any]
Changing = Mapping[str, Any] | Function
SEPARATORS = ",;\t"


@dataclass(frozen=True)
class Changes:
    """Tables by the name of the input, or a function f(t, x) of all inputs that is asked every
    `sample` seconds, at these times, or wherever the integrator wants it."""

    tables: Mapping[str, Table] = field(default_factory=dict)
    function: Function | None = None
    sample: Any = None

    def __bool__(self) -> bool:
        return bool(self.tables) or self.function is not None


def changes(
    model: Model, given: Changing | None, sample: Any, span: tuple[float, float]
) -> Changes:
    """What was asked for, if it can be. Raises ModelError with its cause, and its line in a file.

    `given` is a function, or has for each input a file "torque.csv" or "torque.csv:linear", a pair
    (times, values), or a triple with the kind.
    """
    if sample is not None and not callable(given):
        raise ModelError("sample times are for inputs that are a function")
    if given is None:
        return Changes()
    names = [item.name for item in model.inputs]
    if callable(given):
        if not names:
            raise ModelError(f"{model.name} has no inputs that a function could give")
        return Changes({}, given, _sample(sample, span))
    for name in given:
        if name not in names:
            near = did_you_mean(name, names) or f"it has {listed(names) or 'none'}"
            raise ModelError(f"'{name}' is no input of {model.name}; {near}")
    tables = {name: _table(name, entry) for name, entry in given.items()}
    try:
        whole = source(tables, names, np.asarray)
        check_cover(whole.tables, names, *span)
    except ValueError as error:
        raise ModelError(str(error)) from None
    return Changes(tables)


def _sample(given: Any, span: tuple[float, float]) -> Any:
    """The sample time, or times, if a module will take them."""
    if given is not None and np.isfinite(span).all():
        try:
            sample_times(given, *span)
        except (TypeError, ValueError) as error:
            raise ModelError(f"sample is {given!r}: {error}") from None
    return given


def _table(name: str, entry: Any) -> Table:
    if isinstance(entry, str | PathLike):
        return table(name, str(entry))
    if isinstance(entry, Sequence) and len(entry) in (2, 3):
        times, values, *kind = entry
        return Table(np.asarray(times, float), np.asarray(values, float), *kind)
    raise ModelError(
        f"input '{name}' is given as {type(entry).__name__}: a file, (times, values) or "
        "(times, values, kind) would do"
    )


def table(name: str, text: str) -> Table:
    """The table in a file of two columns, seconds and values in the input's unit: `FILE` or
    `FILE:hold`, `FILE:linear` (the usual one), `FILE:cubic`. A first line of words is a header."""
    place, colon, kind = text.rpartition(":")
    if not colon or Path(text).exists() or kind not in KINDS:
        place, kind = text, "linear"
    if not Path(place).is_file():
        stem, _, said = place.rpartition(":")
        if stem and Path(stem).is_file():
            near = did_you_mean(said, KINDS) or f"there are {listed(KINDS)}"
            raise ModelError(f"input '{name}': no interpolation '{said}'; {near}")
        raise ModelError(f"input '{name}': there is no file {place}")
    rows = list(_rows(place, name))
    least = 1 if kind == "hold" else 2
    if len(rows) < least:
        raise ModelError(f"{place}: {kind} needs at least {least} rows, there are {len(rows)}")
    times, values = np.array(rows).T
    return Table(times, values, kind)


def _rows(place: str, name: str) -> Iterator[tuple[float, float]]:
    """Times and values line by line; raises ModelError at the first that is none."""
    before, first = -np.inf, True
    try:
        with open(place, encoding="utf-8-sig") as file:
            for number, line in enumerate(file, 1):
                text = line.strip()
                if not text or text.startswith("#"):
                    continue
                if number > MOST_POINTS:
                    raise ModelError(f"{place}: more than {MOST_POINTS} rows")
                line = _Line(place, number, line.rstrip("\n"))
                if first and line.is_header():
                    first = False
                    continue
                first = False
                row = line.numbers(name)
                if not row[0] > before:
                    raise line.problem(
                        0, f"time {row[0]:g} does not come after {before:g}", "times that increase"
                    )
                before = row[0]
                yield row
    except UnicodeDecodeError:
        raise ModelError(f"{place}: this is no text in UTF-8") from None
    except OSError as error:
        raise ModelError(f"{place}: {error.strerror}") from None


@dataclass(frozen=True)
class _Line:
    """A line of a table with its place."""

    file: str
    number: int
    text: str

    @property
    def parts(self) -> list[str]:
        """The columns, at the first of the separators that the line has, else at blanks."""
        separator = next((mark for mark in SEPARATORS if mark in self.text), None)
        return [part.strip() for part in self.text.split(separator)]

    def is_header(self) -> bool:
        """Two words of which neither is a number."""
        return len(self.parts) == 2 and not any(map(_is_number, self.parts))

    def numbers(self, name: str) -> tuple[float, float]:
        """Time (s) and value. Raises ModelError with the place of what is missing, no number or not
        finite."""
        if len(self.parts) != 2:
            what = "one column" if len(self.parts) == 1 else f"{len(self.parts)} columns"
            raise self.problem(0, f"{what} in the table of '{name}'", "two: time and value")
        for k, part in enumerate(self.parts):
            what = ("time", "value")[k]
            if not part:
                raise self.problem(k, f"a gap: no {what}", "a number")
            if not _is_number(part):
                raise self.problem(k, f"{what} '{part}' is no number", "a number")
            if not np.isfinite(float(part)):
                raise self.problem(k, f"{what} {part} is not finite", "a finite number")
        return float(self.parts[0]), float(self.parts[1])

    def problem(self, part: int, message: str, expected: str) -> ModelError:
        """At the first or second column."""
        words = self.parts[part] if part < len(self.parts) else ""
        start = 0
        if part:
            start = self.text.find(self.parts[0]) + len(self.parts[0])
        column = max(self.text.find(words, start), 0) + 1
        return ModelError(
            Diagnostic(
                self.file, self.number, column, max(len(words), 1), message, expected,
                source_line=self.text,
            )
        )  # fmt: skip


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
