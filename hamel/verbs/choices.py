"""choices: the candidates for the quasi-velocities as `auto` ranks them."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from derive.formulations import choices
from hamel.importing import load
from hamel.pipeline import mechanics_of
from hamel.records import Choices, Ranking

if TYPE_CHECKING:
    from rich.console import Console


def run(path: str | Path) -> Choices:
    model = load(path)
    names = [field.name for field in fields(Ranking)]
    ranked = tuple(Ranking(*(getattr(found, name) for name in names)) for found in choices(mechanics_of(model)))
    return Choices(model.name, model.choices[0].name, ranked)


def show(record: Choices, console: Console) -> None:
    from hamel.show import table

    rows = [
        (r.name, ", ".join(r.rows), f"{r.condition:.3g}", f"{r.worst:.3g}", str(r.operations), r.verdict) for r in record.choices
    ]
    table(console, ("choice", "speeds", "condition", "worst", "operations", "verdict"), rows, right=(2, 3, 4))
    for pivot in record.choices[0].pivots if record.choices else ():
        console.print(f"{record.choices[0].name}: {pivot}")
    console.print(f"{record.model}: '{record.default}' is built when no choice is given")
