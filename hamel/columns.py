"""Columns of numbers by name, from CSV and Parquet files."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from derive.diagnostics import ModelError
from hamel.optional import library

ENDINGS = (".csv", ".parquet")
EXPECTED = "a line of names, then a finite number below each, between commas"


def file_columns(file: str | Path) -> dict[str, np.ndarray]:
    """The columns of a file, in order; one that does not end in .parquet is read as CSV.

    Raises ModelError for what cannot be read or holds no finite numbers, ToolchainError where
    pyarrow is wanting.
    """
    is_parquet = str(file).lower().endswith(".parquet")
    result = _parquet(str(file)) if is_parquet else _csv(file)
    for name, column in result.items():
        if not np.isfinite(column).all():
            raise ModelError(f"{file}, column '{name}', holds what is no finite number", EXPECTED)
    return result


def _csv(file: str | Path) -> dict[str, np.ndarray]:
    """Names may be in quotes, as other programs write them; what stands behind # is a comment."""
    names, lines = _names_and_lines(file)
    try:
        numbers = _numbers(list(lines.values()), len(names))
    except ValueError as error:
        raise ModelError(f"{file}: {_first_wrong(names, lines) or error}", EXPECTED) from None
    if numbers.shape[1] != len(names) or not np.isfinite(numbers).all():
        raise ModelError(f"{file}: {_first_wrong(names, lines)}", EXPECTED)
    _check_names(file, names)
    return dict(zip(names, numbers.T))


def _names_and_lines(file: str | Path) -> tuple[list[str], dict[int, str]]:
    """The lines below the names that are not empty, by their numbers in the file."""
    try:
        with open(file, encoding="utf-8-sig") as text:
            names = [name.strip() for name in _cells(text.readline())]
            return names, {number: line for number, line in enumerate(text, 2) if line.strip()}
    except OSError as error:
        raise ModelError(f"{file} cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise ModelError(f"{file}: {error}", EXPECTED) from None


def _cells(line: str) -> list[str]:
    return next(csv.reader([line.strip()], skipinitialspace=True), [""])


def _numbers(lines: list[str], columns: int) -> np.ndarray:
    if not lines:
        return np.empty((0, columns))
    return np.loadtxt(lines, delimiter=",", quotechar='"', ndmin=2)


def _first_wrong(names: list[str], lines: Mapping[int, str]) -> str:
    """Where the first of these lines of a file, by their numbers, is no row of numbers."""
    for number, line in lines.items():
        text = line.partition("#")[0]
        cells = _cells(text) if text.strip() else []
        if cells and len(cells) != len(names):
            count = f"({len(cells)}) than there are names ({len(names)})"
            return f"line {number} has another number of cells {count}"
        for name, cell in zip(names, cells):
            if not _is_number(cell):
                return f"line {number}, column '{name}': '{cell.strip()}' is no finite number"
    return ""


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _check_names(file: str | Path, names: Iterable[str]) -> None:
    earlier: set[str] = set()
    for name in names:
        if name in earlier:
            raise ModelError(f"{file}: the column '{name}' is there twice", "a name for each")
        earlier.add(name)


def _parquet(file: str) -> dict[str, np.ndarray]:
    arrow = library("pyarrow", f"reading {file}", "data")
    parquet = library("pyarrow.parquet", f"reading {file}", "data")
    try:
        table = parquet.read_table(file)
        return {name: np.asarray(table[name], dtype=float) for name in table.column_names}
    except (OSError, ValueError, TypeError, arrow.ArrowException) as error:
        raise ModelError(f"{file} cannot be read: {error}") from None
