"""The folder where work is kept that need not be done twice: compiled binaries, verified modules,
prepared templates.

Losing it, or not having one, only costs time. What nobody used for long, and the oldest of what is
too much, is dropped.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from pathlib import Path

DAY = 86_400.0
LONGEST = 60 * DAY  # what was not used for so long is dropped
LARGEST = 500_000_000  # bytes; above this the entries not used for longest are dropped
FRESH = 600.0  # seconds in which an entry may be in use by another process and is left alone


def folder(name: str = "") -> Path | None:
    """A folder in XDG_CACHE_HOME/hamel (~/.cache/hamel), made when it is missing; None where none
    can be had."""
    with contextlib.suppress(OSError, RuntimeError):
        root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hamel" / name
        root.mkdir(parents=True, exist_ok=True)
        return root
    return None


def bare(name: str) -> bool:
    """Whether nothing is in that folder yet."""
    place = folder(name)
    with contextlib.suppress(OSError):
        return place is not None and not any(place.iterdir())
    return False


def used(entry: Path) -> None:
    """Note that an entry was of use just now."""
    with contextlib.suppress(OSError):
        os.utime(entry)


def prune(root: Path, longest: float = LONGEST, largest: int = LARGEST) -> None:
    """Drop the folders in `root` that were not used for `longest` seconds, then the oldest until
    `largest` bytes are left."""
    now, total = time.time(), 0
    for age, entry in sorted(_aged(root, now)):
        size = _size(entry)
        if age > FRESH and (age > longest or total + size > largest):
            shutil.rmtree(entry, ignore_errors=True)
        else:
            total += size


def _aged(root: Path, now: float) -> list[tuple[float, Path]]:
    found = []
    with contextlib.suppress(OSError):
        for entry in os.scandir(root):
            with contextlib.suppress(OSError):  # another process may have dropped it
                if entry.is_dir(follow_symlinks=False) and entry.name != "templates":
                    found.append((now - entry.stat().st_mtime, Path(entry.path)))
    return found


def _size(entry: Path) -> int:
    total = 0
    for folder, _, files in os.walk(entry):
        for name in files:
            with contextlib.suppress(OSError):
                total += os.lstat(os.path.join(folder, name)).st_size
    return total
