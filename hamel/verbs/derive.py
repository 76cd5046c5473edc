"""derive: write the derivation to read, as a web page and as LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from derive.textbook.derivation import derivation
from derive.textbook.writing.html import page
from derive.textbook.writing.latex import article
from hamel.build.files import write_text
from hamel.build.stages import equations_of
from hamel.build.typeset import typeset
from hamel.draw.mechanism import picture, svg, tikz
from hamel.live import live_of
from hamel.live import page as live_page
from hamel.records import Derived

if TYPE_CHECKING:
    from rich.console import Console


def run(
    path: str | PathLike[str],
    choice: str | None,
    folder: Path,
    formulation: str,
    roads: Sequence[str],
    pdf: bool = False,
    live: bool = False,
) -> Derived:
    """The derivation of one choice (the file's first when None) by one road or two, written as
    derivation.html and derivation.tex into the folder. Both are made from the same Equations. A
    `live` page carries the module."""
    equations = equations_of(path, choice, formulation=formulation)
    drawing = picture(equations.system)
    pages = {"html": folder / "derivation.html", "tex": folder / "derivation.tex"}
    figure = svg(drawing) if drawing else ""
    document = derivation(equations, roads)
    shown = live_page(live_of(equations, roads), figure) if live else page(document, figure)
    write_text(pages["html"], shown)
    text = article(document, tikz(drawing) if drawing else "")
    write_text(pages["tex"], text)
    if pdf:
        pages["pdf"] = folder / "derivation.pdf"
        typeset(text, pages["pdf"])
    return Derived(equations.system.model.name, equations.choice, equations.reason, **pages)


def show(record: Derived, console: Console) -> None:
    """The choice with its reason, and where the two files are."""
    console.print(f"{record.model}, choice {record.choice}: {record.reason}")
    console.print(f"  read    {record.html}")
    console.print(f"  typeset {record.tex}")
    if record.pdf:
        console.print(f"  printed {record.pdf}")
