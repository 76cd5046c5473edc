"""Files appear whole or not at all: each is made beside its place and moved there when it is finished."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from derive.diagnostics import ToolchainError


@contextmanager
def staged_file(place: Path) -> Iterator[Path]:
    """A file that becomes `place` when the block ends well and is gone when it does not."""
    try:
        if place.is_dir():
            raise IsADirectoryError(None, "a folder of this name exists")
        with _beside(place) as made:
            yield made
            made.replace(place)
    except OSError as error:
        raise ToolchainError(f"cannot write {place}: {error.strerror or error}", hint="choose another place") from error


def write_text(place: Path, text: str) -> None:
    """Write a file in one step."""
    with staged_file(place) as made:
        made.write_text(text, encoding="utf-8")


@contextmanager
def _beside(place: Path) -> Iterator[Path]:
    """A path of the same name on the same file system, gone at the end, as are the folders that were made for nothing."""
    missing = [folder for folder in place.parents if not folder.exists()]
    place.parent.mkdir(parents=True, exist_ok=True)
    beside = Path(tempfile.mkdtemp(prefix=f".{place.name}-", dir=place.parent))
    try:
        yield beside / place.name
    finally:
        shutil.rmtree(beside, ignore_errors=True)
        for folder in missing:
            with suppress(OSError):  # it is in use
                folder.rmdir()
