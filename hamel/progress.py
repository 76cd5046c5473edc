"""A progress bar on standard error that appears only when something takes long."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

PATIENCE = 1.0  # seconds before a bar is worth showing


@contextmanager
def bar(total: float, doing: str = "simulating") -> Iterator[Callable[[float], None]]:
    """A function to call with how much of `total` is done."""
    with ExitStack() as stack:
        start = time.monotonic()
        shown: list[Any] = []

        def report(done: float) -> None:
            if not shown and sys.stderr.isatty() and time.monotonic() - start > PATIENCE:
                shown.append(_start(stack, total, doing))
            if shown:
                progress, task = shown[0]
                progress.update(task, completed=done)

        yield report


def _start(stack: ExitStack, total: float, doing: str) -> tuple[Any, Any]:
    from rich.console import Console
    from rich.progress import Progress

    progress = stack.enter_context(Progress(console=Console(stderr=True), transient=True))
    return progress, progress.add_task(doing, total=total)
