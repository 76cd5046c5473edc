"""A motion in files: CSV, NPZ and Parquet by the suffix, and its plot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from derive.diagnostics import ModelError
from hamel.build.files import staged_file, write_text
from hamel.optional import library
from hamel.records import Simulated

Write = Callable[[Simulated, Path], None]
Writer = Callable[[Simulated], None]


def writers(out: str | Path | None, plot: str | Path | None) -> list[Writer]:
    """What will write the motion; a suffix that nothing writes, and a library that is missing, is
    told before anything is computed."""
    kinds = [(out, _WRITERS, "-o"), (plot, {".svg": write_svg}, "--plot")]
    return [_writer(Path(place), known, option) for place, known, option in kinds if place]


def check_page(view: str | Path | None) -> None:
    """What will hold the moving mechanism is a page or a picture."""
    if view and Path(view).suffix.lower() not in (".html", ".svg"):
        raise ModelError(f"--view {view}: the file must end in .html or .svg")


def _writer(place: Path, known: dict[str, Write], option: str) -> Writer:
    suffix = place.suffix.lower()
    write = known.get(suffix)
    if write is None:
        raise ModelError(f"{option} {place}: the file must end in {' or '.join(known)}")
    if suffix == ".parquet":
        _arrow()
    return lambda record: write(record, place)


def write_csv(record: Simulated, place: Path) -> None:
    """A line of names, then a line per row; numbers round-trip."""
    columns = {name: _texts(column) for name, column in record.motion.items()}
    with staged_file(place) as draft, draft.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        file.writelines(",".join(row) + "\n" for row in zip(*columns.values()))


def _texts(column: np.ndarray) -> list[str]:
    """Numbers so that they round-trip; names as they are."""
    return [x if isinstance(x, str) else repr(x) for x in column.tolist()]


def write_npz(record: Simulated, place: Path) -> None:
    """One array per name."""
    with staged_file(place) as draft, draft.open("wb") as file:
        np.savez(file, **record.motion)  # type: ignore[arg-type]


def write_parquet(record: Simulated, place: Path) -> None:
    """A column per name, its unit in the metadata."""
    arrow = _arrow()
    columns = record.motion
    fields = [
        arrow.field(
            name,
            arrow.string() if column.dtype.kind == "U" else arrow.float64(),
            metadata={"unit": record.units.get(name, "")},
        )
        for name, column in columns.items()
    ]
    arrays = [arrow.array(column.tolist()) for column in columns.values()]
    table = arrow.table(arrays, schema=arrow.schema(fields, metadata={"title": record.title}))
    with staged_file(place) as draft, draft.open("wb") as file:
        library("pyarrow.parquet", "-o FILE.parquet", "data").write_table(table, file)


def _arrow() -> Any:
    return library("pyarrow", "-o FILE.parquet", "data")


def write_svg(record: Simulated, place: Path) -> None:
    """The plot."""
    assert record.figure is not None  # the record is of a motion
    write_text(place, record.figure())


_WRITERS: dict[str, Write] = {".csv": write_csv, ".npz": write_npz, ".parquet": write_parquet}
