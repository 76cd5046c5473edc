"""Results appear whole or not at all: they are made beside their place and moved there when they are finished."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from derive.diagnostics import ToolchainError


@contextmanager
def staged_folder(place: Path, mark: str) -> Iterator[Path]:
    """A folder that becomes `place` when the block ends well and is gone when it does not.

    An older `place` is replaced only when it is empty or holds the file `mark`: it is then one of ours.
    """
    place = place.absolute()
    with writing(place):
        _refuse_foreign(place, mark)
    with _beside(place) as made:
        made.mkdir()
        yield made
        with writing(place):
            _replace(made, place, made.parent / "before")


def write_text(place: Path, text: str) -> None:
    """Write a file in one step."""
    with staged_file(place) as made:
        made.write_text(text, encoding="utf-8")


@contextmanager
def staged_file(place: Path) -> Iterator[Path]:
    """A file that becomes `place` when the block ends well and is gone when it does not."""
    with writing(place):
        if place.is_dir():
            raise IsADirectoryError(None, "a folder of this name exists")
        with _beside(place) as made:
            yield made
            made.replace(place)


@contextmanager
def writing(place: Path) -> Iterator[None]:
    """Turns what the file system refuses into a message that names the place."""
    try:
        yield
    except OSError as error:
        raise ToolchainError(f"cannot write {place}: {error.strerror or error}", hint="choose another place with -o") from error


@contextmanager
def _beside(place: Path) -> Iterator[Path]:
    """A path of the same name on the same file system, gone at the end, as are the folders that were made for nothing."""
    missing = [folder for folder in place.parents if not folder.exists()]
    with writing(place):
        place.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=f".{place.name}-", dir=place.parent))
    try:
        yield beside / place.name  # a module is imported by the last part of its path, so that stays the same
    finally:
        shutil.rmtree(beside, ignore_errors=True)
        for folder in missing:
            with suppress(OSError):
                folder.rmdir()


def _refuse_foreign(place: Path, mark: str) -> None:
    if place.is_dir() and any(place.iterdir()) and not (place / mark).is_file():
        raise FileExistsError(None, f"the folder is not empty and holds no {mark}, so it is not hamel's to replace")
    if place.exists() and not place.is_dir():
        raise FileExistsError(None, "a file of this name exists")


def _replace(made: Path, place: Path, before: Path) -> None:
    if place.exists():
        place.rename(before)
    try:
        made.rename(place)
    except OSError:
        if before.exists():
            before.rename(place)
        raise
