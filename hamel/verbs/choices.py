"""choices: the candidates for the quasi-velocities as `auto` ranks them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hamel.records import Choices, Ranking

if TYPE_CHECKING:
    from rich.console import Console


def run(path: str | Path) -> Choices:
    from derive.formulations import choices
    from derive.mechanics import system
    from derive.model import load

    model = load(path)
    rankings = tuple(
        Ranking(r.name, r.kind, tuple(r.rows), tuple(r.pivots), float(r.smallest_pivot), float(r.condition), r.operations, r.reason)
        for r in choices(system(model))
    )
    return Choices(model.name, model.choices[0].name, rankings)


def show(record: Choices, console: Console) -> None:
    from hamel.show import number, table

    rows = [
        (r.name, ", ".join(r.rows), "; ".join(r.pivots), number(r.smallest_pivot), number(r.condition), str(r.operations), r.reason)
        for r in record.choices
    ]
    table(console, ("choice", "speeds", "pivots", "smallest", "condition", "operations", "verdict"), rows, right=(3, 4, 5))
    console.print(f"{record.model}: '{record.default}' is built when no choice is given")
