"""Memory while a file is read, a model derived and its functions are improved."""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def without_collections() -> Generator[None]:
    """Python looks for cycles the more often the more objects there are. A long file makes millions
    and no cycle among them: looking takes as long as reading, and a third of the passes."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
