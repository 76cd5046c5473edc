"""Folders for the time of one piece of work, that never outlive it.

A folder is locked by the process that works in it. The operating system drops the lock when the
process ends, however it ends, so that the next one can tell what was left behind and sweep it.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from hamel.build.limits import ABANDONED, YOUNG

try:
    import fcntl
except ImportError:  # Windows: there what is old enough is swept
    fcntl = None

NAME = re.compile(r"\.hamel-(\d+)-\w+")
OLD = ".old"  # the end of the name of what makes room for its successor


@contextlib.contextmanager
def scratch(parent: Path) -> Iterator[Path]:
    """An empty folder in `parent`, gone at the end of the block; what dead processes left there is
    swept first. Raises OSError where nothing can be written."""
    sweep(parent)
    place = Path(tempfile.mkdtemp(prefix=f".hamel-{os.getpid()}-", dir=parent))
    lock = _locked(place)
    try:
        yield place
    finally:
        shutil.rmtree(place, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def workspace() -> contextlib.AbstractContextManager[Path]:
    """A scratch folder where the system has such folders."""
    return scratch(Path(tempfile.gettempdir()))


def sweep(parent: Path) -> None:
    """Remove the scratch folders in `parent` whose processes are gone."""
    with contextlib.suppress(OSError):
        names = [entry.name for entry in os.scandir(parent) if NAME.fullmatch(entry.name)]
        for name in names:
            _sweep_one(parent / name)


def is_scratch(name: str) -> bool:
    """Whether a file of this name is a scratch folder."""
    return NAME.fullmatch(name) is not None


def _sweep_one(place: Path) -> None:
    lock = None
    with contextlib.suppress(OSError):  # it is not ours, or just gone
        age = time.time() - place.lstat().st_mtime
        if fcntl is None:
            abandoned = age > ABANDONED
        else:
            lock = _locked(place)
            abandoned = lock is not None and (age > YOUNG or not _alive(place.name))
        if abandoned:
            _put_back(place)
            shutil.rmtree(place, ignore_errors=True)
    if lock is not None:
        os.close(lock)


def _put_back(place: Path) -> None:
    """What was moved away to make room for its successor, and has none."""
    for old in place.glob(f"*{OLD}"):
        home = place.parent / old.name.removesuffix(OLD)
        if not os.path.lexists(home):
            os.rename(old, home)


def _alive(name: str) -> bool:
    """Whether the process that made the folder lives."""
    match = NAME.fullmatch(name)
    try:
        os.kill(int(match.group(1)) if match else 0, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def _locked(place: Path) -> int | None:
    """A descriptor that holds the lock of our own folder `place`; None where another one has it."""
    if fcntl is None:
        return None
    descriptor = os.open(place, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        if os.fstat(descriptor).st_uid != os.getuid():
            raise PermissionError("a folder of somebody else")
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor
