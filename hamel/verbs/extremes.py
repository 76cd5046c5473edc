"""extremes: run the extreme cases of model files and say which survived, which were refused, and
whether any came out wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from typing import TYPE_CHECKING

from derive.diagnostics import ModelError, counted
from hamel.records import Extremes
from hamel.show import number, table
from hamel.study.extremes import extremes_table

if TYPE_CHECKING:
    from rich.console import Console


def run(
    paths: Sequence[str | PathLike[str]],
    case: str | None,
    progress: Callable[[str], None] | None = None,
) -> Extremes:
    """Every case of the files, or those called `case`, run and judged. Passed: each row came out as
    its case expects, survived or refused.

    Raises ModelError where there is no case at all, for a check of nothing would pass.
    """
    rows = extremes_table(paths, case, progress)
    if not rows:
        asked = f"no case '{case}' in" if case else "no `extremes:` cases in"
        raise ModelError(f"{asked} {', '.join(map(str, paths))}")
    counts = {
        outcome: sum(row.outcome == outcome for row in rows)
        for outcome in ("survived", "refused", "wrong")
    }
    return Extremes(all(row.passed for row in rows), rows, **counts)


def show(record: Extremes, console: Console) -> None:
    """A row per case and method, the count of outcomes, and initial values that had to move."""
    rows = []
    for row in record.rows:
        text = row.status if row.error is None else f"error {number(row.error)}"
        if row.fewest and row.scipy:
            text += f"; {counted(row.fewest, 'step')}, SciPy's Radau {row.scipy}"
        mark = "" if row.passed else f"  NOT EXPECTED ({row.expected})"
        rows.append(
            (f"{row.model}: {row.case}", row.method, row.outcome + mark, text, row.judged_by)
        )
    table(console, ("case", "method", "outcome", "", "judged by"), rows)
    cases = counted(len(record.rows), "case")
    console.print(
        f"{cases}: {record.survived} survived, {record.refused} refused, {record.wrong} wrong"
    )
    for row in record.rows:
        if row.moved > 0:
            console.print(
                f"  {row.model}, {row.case}: initial values moved by up to {number(row.moved)}"
            )
