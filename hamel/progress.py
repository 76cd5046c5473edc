"""A progress bar on standard error where something takes long, and one word of warning where that
is very long."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)

PATIENCE = 1.0  # seconds before a bar is worth showing
SPARSE = 30.0  # seconds between lines where there is no terminal for a bar
SLOW = 10.0  # seconds after which it can be told how long a motion takes …
LONG = 600.0  # … and how many may be left before that is worth a word


@contextmanager
def bar(total: float, doing: str = "simulating") -> Iterator[Callable[[float], None]]:
    """A function to call with how much of `total` is done. Where no terminal can show a bar, a line
    now and then says it."""
    with ExitStack() as stack:
        start = said = time.monotonic()
        shown: list[Any] = []

        def report(done: float) -> None:
            nonlocal said
            now = time.monotonic()
            if not sys.stderr.isatty() and now - said > SPARSE:
                said = now
                print(f"{doing}: {done / total:.0%} after {now - start:.0f} s", file=sys.stderr)
            if not shown and sys.stderr.isatty() and now - start > PATIENCE:
                shown.append(_start(stack, total, doing))
            if shown:
                progress, task = shown[0]
                progress.update(task, completed=done)

        yield report


@contextmanager
def counted(doing: str) -> Iterator[Callable[[Any], None]]:
    """A function to call with `done`, `size` and `failed` motions of a sweep: rate and time left
    are shown."""
    with ExitStack() as stack:
        shown: list[Any] = []

        def report(known: Any) -> None:
            if not shown and sys.stderr.isatty():
                columns = (
                    TextColumn("{task.description}"),
                    BarColumn(),
                    MofNCompleteColumn(),
                    TextColumn("{task.fields[rate]}"),
                    TimeRemainingColumn(),
                )
                bar = Progress(*columns, console=Console(stderr=True), transient=True)
                progress = stack.enter_context(bar)
                task = progress.add_task(doing, total=known.size, completed=known.done, rate="")
                shown.append((progress, task, time.monotonic(), known.done))
            if shown:
                progress, task, begin, first = shown[0]
                rate = (known.done - first) / max(time.monotonic() - begin, 1e-9)
                failed = f", {known.failed} failed" if known.failed else ""
                text = f"{rate:.3g} motions/s{failed}"
                progress.update(task, completed=known.done, rate=text)

        yield report


def paced(
    progress: Callable[[float], None] | None, total: float, hint: str
) -> Callable[[float], None]:
    """`progress`, and one warning where at the present pace the rest of `total` seconds of motion
    would take very long."""
    start = time.monotonic()
    said: list[str] = []

    def report(done: float) -> None:
        elapsed = time.monotonic() - start
        if not said and elapsed > SLOW and (total - done) * elapsed > LONG * done:
            said.append(
                f"{done:.3g} s of {total:g} s are done after {elapsed:.0f} s of computing: {hint}"
            )
            warnings.warn(said[0], RuntimeWarning, stacklevel=2)
        if progress is not None:
            progress(done)

    return report


def _start(stack: ExitStack, total: float, doing: str) -> tuple[Any, Any]:
    progress = stack.enter_context(Progress(console=Console(stderr=True), transient=True))
    return progress, progress.add_task(doing, total=total)
