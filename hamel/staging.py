"""Files appear whole or not at all: each is made beside its place and moved there when it is
finished."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from codegen.placing import beside
from derive.diagnostics import ToolchainError


@contextmanager
def staged_file(place: Path) -> Iterator[Path]:
    """A file that becomes `place` when the block ends well and is gone when it does not."""
    try:
        if place.is_dir():
            raise IsADirectoryError(None, "a folder of this name exists")
        with beside(place) as made:
            yield made
            made.replace(place)
    except OSError as error:
        raise ToolchainError(
            f"cannot write {place}: {error.strerror or error}", hint="choose another place"
        ) from error


def write_text(place: Path, text: str) -> None:
    """Write a file in one step."""
    with staged_file(place) as made:
        made.write_text(text, encoding="utf-8")
