"""A file in a folder of this machine is there as a whole or not at all, whatever happens while it
is written.

Of hamel.sweep: places.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from derive.diagnostics import ToolchainError
from hamel.sweep.places import Local

NAME = "chunks/000000001.parquet"
OLD, NEW = b"what was there", bytes(range(256)) * 5
DEAD = 2**22 + 1  # no process has a number as large


@pytest.fixture
def folder(tmp_path: Path) -> Local:
    place = Local(tmp_path)
    place.write(NAME, OLD)
    return place


def _once(do: Callable[[], None], then: Callable[..., Any]) -> Callable[..., Any]:
    """`then`, with something done before its first call."""
    left = [do]

    def call(*given: Any) -> Any:
        if left:
            left.pop()()
        return then(*given)

    return call


def test_a_write_that_takes_a_part_goes_on_with_the_rest(
    folder: Local, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = os.write
    monkeypatch.setattr(os, "write", lambda file, left: write(file, bytes(left)[:100]))
    folder.write(NAME, NEW)
    assert folder.read(NAME) == NEW


def test_it_gets_its_name_when_all_of_it_is_on_the_disk(
    folder: Local, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[tuple[str, bytes | None]] = []

    def noted(name: str) -> Callable[..., Any]:
        call = getattr(os, name)

        def noting(*given: Any) -> Any:
            seen.append((name, (folder.root / NAME).read_bytes()))
            return call(*given)

        return noting

    with monkeypatch.context() as patch:
        for name in ("write", "fsync", "close", "replace"):
            patch.setattr(os, name, noted(name))
        folder.write(NAME, NEW)
    assert seen == [(name, OLD) for name in ("write", "fsync", "close", "replace")]
    assert folder.read(NAME) == NEW


def test_a_full_disk_leaves_what_was_there(folder: Local, monkeypatch: pytest.MonkeyPatch) -> None:
    write, closed = os.write, []

    def full(file: int, left: memoryview) -> int:
        if len(bytes(left)) < len(NEW):
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(file, bytes(left)[:100])

    with monkeypatch.context() as patch:
        close = os.close
        patch.setattr(os, "write", full)
        patch.setattr(os, "close", lambda file: (closed.append(file), close(file)))
        with pytest.raises(ToolchainError, match="No space left"):
            folder.write(NAME, NEW)
    assert folder.names("chunks") == [Path(NAME).name] and folder.read(NAME) == OLD
    assert len(closed) == 1


def test_what_was_half_written_under_the_same_number_is_not_in_it(folder: Local) -> None:
    """Numbers of processes come again."""
    draft = (folder.root / NAME).with_name(f".{Path(NAME).name}.{os.getpid()}")
    draft.write_bytes(2 * NEW)
    folder.write(NAME, NEW)
    assert folder.read(NAME) == NEW and not draft.exists()


@pytest.mark.parametrize("late", ["write", "fsync", "replace"])
def test_two_processes_do_not_write_into_each_other(
    folder: Local, late: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second writes all of it while the first is at one of its calls."""

    def other() -> None:
        with monkeypatch.context() as patch:
            patch.setattr(os, "getpid", lambda: DEAD)
            folder.write(NAME, NEW[:700])
        assert folder.read(NAME) == NEW[:700]

    monkeypatch.setattr(os, late, _once(other, getattr(os, late)))
    folder.write(NAME, NEW)
    assert folder.read(NAME) == NEW and folder.names("chunks") == [Path(NAME).name]


def test_drafts_of_those_that_live_stay(folder: Local) -> None:
    own, dead = (f".000000002.parquet.{number}" for number in (os.getpid(), DEAD))
    for name in (own, dead):
        (folder.root / "chunks" / name).write_bytes(OLD)
    folder.sweep("chunks")
    assert folder.names("chunks") == [own, Path(NAME).name]
