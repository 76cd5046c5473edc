"""Single files appear whole or not at all: made beside their place and moved there when finished.

Written through links: a link stays, and what it points at is replaced.
"""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from derive.diagnostics import ToolchainError
from hamel.build.scratch import scratch


@contextmanager
def staged_file(place: Path) -> Iterator[Path]:
    """A file that becomes `place` when the block ends well and is gone when it does not."""
    with writing(place, "choose another place"):
        target = Path(os.path.realpath(place))
        if target.is_dir():
            raise IsADirectoryError(None, "a folder of this name exists")
        if target.exists() and not target.is_file():  # a device or a pipe takes what is written
            yield target
            return
        with parents(target), scratch(target.parent) as folder:
            draft = folder / target.name
            yield draft
            draft.replace(target)


def write_text(place: Path, text: str) -> None:
    """Write a file in one step."""
    with staged_file(place) as draft:
        draft.write_text(text, encoding="utf-8")


@contextmanager
def writing(place: Path, hint: str) -> Iterator[None]:
    """ToolchainError where the block cannot write `place`, with what to do about it."""
    try:
        yield
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        raise ToolchainError(
            f"cannot write {place}: {error.strerror or error}",
            hint="free some space on its disk, or " + hint if full else hint,
        ) from error


@contextmanager
def parents(place: Path) -> Iterator[None]:
    """The folders above `place`; those made for nothing are removed again."""
    missing = [folder for folder in place.parents if not folder.exists()]
    place.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        for folder in missing:
            with contextlib.suppress(OSError):  # it is in use
                folder.rmdir()
