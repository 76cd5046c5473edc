"""draw: the mechanism of a model as a figure, SVG or TikZ."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from derive.diagnostics import ModelError
from derive.robots.reading import load
from hamel.build.files import write_text
from hamel.build.stages import mechanics_of
from hamel.draw.mechanism import figure, svg, tikz
from hamel.records import Drawn

if TYPE_CHECKING:
    from rich.console import Console

WRITERS = {".svg": svg, ".tex": tikz}


def run(path: str | PathLike[str], out: str | Path | None) -> Drawn:
    """The figure in `out` (.svg, or .tex for a TikZ picture); <model>.svg here where it is None.

    Raises ModelError where the suffix is another or the model has no consistent initial state.
    """
    suffix = ".svg" if out is None else Path(out).suffix.lower()
    if suffix not in WRITERS:
        raise ModelError(f"-o {out}: the file must end in {' or '.join(WRITERS)}")
    system = mechanics_of(load(path))
    drawing = figure(system)
    place = Path(out or f"{system.model.name}.svg")
    write_text(place, WRITERS[suffix](drawing))
    return Drawn(
        model=system.model.name,
        file=place,
        about=drawing.about,
        moved=drawing.state.moved,
        width=drawing.width,
        height=drawing.height,
        labels=len(drawing.letterings),
        unnamed=drawing.unnamed + len(drawing.unplaced),
    )


def show(record: Drawn, console: Console) -> None:
    """What is drawn, and where."""
    console.print(f"{record.model}: {record.about}", highlight=False)
    if record.unnamed:
        console.print(f"  {record.unnamed} names are left out: there are too many")
    console.print(f"  wrote {record.file}")
