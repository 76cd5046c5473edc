"""Columns of numbers by name, from CSV and Parquet files."""

from __future__ import annotations

from collections.abc import Iterable
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
    if not all(np.isfinite(column).all() for column in result.values()):
        raise ModelError(f"{file} holds what is no finite number", EXPECTED)
    return result


def _csv(file: str | Path) -> dict[str, np.ndarray]:
    try:
        with open(file, encoding="utf-8-sig") as lines:
            names = [name.strip() for name in lines.readline().strip().split(",")]
            rows = [line for line in lines if line.strip()]
        numbers = np.loadtxt(rows, delimiter=",", ndmin=2) if rows else np.empty((0, len(names)))
    except OSError as error:
        raise ModelError(f"{file} cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise ModelError(f"{file}: {error}", EXPECTED) from None
    if numbers.shape[1] != len(names):
        raise ModelError(f"{file}: {len(names)} names over {numbers.shape[1]} columns", EXPECTED)
    _check_names(file, names)
    return dict(zip(names, numbers.T))


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
