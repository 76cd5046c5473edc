"""Pieces that several verbs print: counts, durations, tables."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from derive.diagnostics import NAMES
from hamel.records import Built, Explained

WIDE = 160


class Page(Console):
    """A console that leaves a broken pipe to whoever started it."""

    def on_broken_pipe(self) -> None:
        """Raises BrokenPipeError, so that the command line ends as it does for every closed
        pipe."""
        raise BrokenPipeError  # rich would end the process with a code of its own


def page() -> Console:
    """Standard output for text that is printed as it is; without a terminal nothing is cut to the
    width of one."""
    piped = not sys.stdout.isatty()
    return Page(
        markup=False, highlight=False, emoji=False, soft_wrap=piped, width=WIDE if piped else None
    )


def shortened(name: str) -> str:
    """A choice as a table can hold it: a partition is named by all of its speeds."""
    words = name.split()
    return name if len(words) <= NAMES else f"{' '.join(words[:NAMES])} … ({len(words)} in all)"


def operations(counts: Mapping[str, int]) -> str:
    """Counts by name on one line, such as `dynamics 41, energy 12`."""
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def durations(seconds: Mapping[str, float]) -> str:
    """Stages with their seconds on one line, to hundredths."""
    return ", ".join(f"{stage} {value:.2f} s" for stage, value in seconds.items())


def number(value: float) -> str:
    """Two digits are enough for an error, none for a zero."""
    return "0" if value == 0 else f"{value:.2g}"


def table(
    console: Console,
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    right: Sequence[int] = (),
) -> None:
    """A plain table; the columns with an index in `right` are numbers."""
    grid = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for index, heading in enumerate(headings):
        grid.add_column(heading, justify="right" if index in right else "left", overflow="fold")
    for row in rows:
        grid.add_row(*row)
    console.print(grid)


def refusals(refused: Mapping[str, str], console: Console) -> None:
    """The choices of the file that are none, and why."""
    for name, why in refused.items():
        console.print(f"refused {name}: {why.replace(' error: ', ' ', 1)}")


def ledger(record: Built | Explained, console: Console) -> None:
    """What the passes did to each function, which are loops, and what this model had no use for."""
    entries = record.ledger
    rows = [
        (name, *_summary([e for e in entries if e["function"] == name]))
        for name in dict.fromkeys(e["function"] for e in entries)
    ]
    table(console, ("function", "traced", "emitted", "saved by"), rows, right=(1, 2))
    for name, how in record.rolling.items():
        console.print(f"{name} is {how}")
    for line in record.left_out:
        console.print(f"left out: {line}")


def _summary(entries: Sequence[Mapping[str, Any]]) -> tuple[str, str, str]:
    """Operations before and after all passes, and what each pass saved over its rounds."""
    saved: dict[str, int] = {}
    for entry in entries:
        saved[entry["step"]] = saved.get(entry["step"], 0) + entry["before"] - entry["after"]
    steps = ", ".join(f"{step} {count}" for step, count in saved.items() if count)
    emitted = [e["after"] for e in entries if e["step"] != "hoist"][
        -1
    ]  # what is hoisted is still done, but once
    return str(entries[0]["before"]), str(emitted), steps
