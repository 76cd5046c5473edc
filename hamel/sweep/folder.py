"""Where a sweep is written: a folder of this machine, or any address that fsspec knows.

`sweep.json` says what the sweep is, `chunks/` holds a file for each finished chunk, written at once
and in one step. In a sweep that keeps no rows, 256 chunks that follow each other become one file of
`groups/`. A chunk is done when its file is there, or that of its group: never half, never twice.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from derive.diagnostics import ModelError, ToolchainError
from hamel.build.files import writing
from hamel.optional import library
from hamel.sweep.limits import GROUP
from hamel.sweep.work import Held, all_of, written

PLAN, CHUNKS, GROUPS = "sweep.json", "chunks", "groups"
RESUME = "the same command goes on from what is there"


def alive(number: str) -> bool:
    """Whether a process of that number runs; who cannot be asked does."""
    try:
        os.kill(int(number), 0)
    except (ProcessLookupError, OverflowError):
        return False
    except (OSError, ValueError):
        return True
    return True


def _replace(place: Path, content: bytes) -> None:
    """A file that is there as a whole or not at all, also after a power cut."""
    draft = place.with_name(f".{place.name}.{os.getpid()}")
    try:
        try:
            file = draft.open("wb")
        except FileNotFoundError:
            place.parent.mkdir(parents=True, exist_ok=True)
            file = draft.open("wb")
        with file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(place)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


class Folder:
    """The files of a sweep, by names relative to its place."""

    def __init__(self, place: str, rows: bool) -> None:
        self.place, self.ending = place, ".parquet" if rows else ".json"
        self.remote: Any = None
        if "://" in place or "::" in place:
            fsspec = library("fsspec", f"writing to {place}")
            try:
                self.remote, self.root = fsspec.core.url_to_fs(place)
            except (ImportError, ValueError) as error:
                raise ToolchainError(f"cannot write to {place}: {error}") from None
        else:
            self.root = place

    # ---- files

    def read(self, name: str) -> bytes | None:
        """The bytes of a file; None where there is none."""
        try:
            if self.remote is not None:
                return bytes(self.remote.cat_file(f"{self.root}/{name}"))
            return (Path(self.root) / name).read_bytes()
        except FileNotFoundError:
            return None

    def write(self, name: str, content: bytes) -> None:
        """In one step. Raises ToolchainError where that cannot be; what is there stays."""
        if self.remote is not None:
            with writing(Path(self.place), RESUME):
                self.remote.makedirs(f"{self.root}/{name}".rpartition("/")[0], exist_ok=True)
                self.remote.pipe_file(f"{self.root}/{name}", content)
            return
        try:
            with writing(Path(self.root) / name, "another folder"):
                _replace(Path(self.root) / name, content)
        except ToolchainError as error:
            diagnostic = error.diagnostics[0]
            raise ToolchainError(f"{diagnostic.message}; {diagnostic.hint}", RESUME) from error

    def remove(self, name: str) -> None:
        """A file that another one stands for."""
        if self.remote is not None:
            self.remote.rm_file(f"{self.root}/{name}")
        else:
            (Path(self.root) / name).unlink(missing_ok=True)

    def names(self, below: str) -> list[str]:
        """The files in a folder of it."""
        if self.remote is not None:
            try:
                names = self.remote.ls(f"{self.root}/{below}", detail=False)
            except FileNotFoundError:
                return []
            return sorted(str(name).rpartition("/")[2] for name in names)
        place = Path(self.root) / below
        return sorted(entry.name for entry in os.scandir(place)) if place.is_dir() else []

    # ---- the sweep

    def _sweep(self) -> None:
        """Remove what was half written when the process that wrote it was killed."""
        for part in (CHUNKS, GROUPS, ""):
            for name in self.names(part) if self.remote is None else ():
                if name.startswith(".") and not alive(name.rpartition(".")[2]):
                    (Path(self.root) / part / name).unlink(missing_ok=True)

    def enter(self, plan: dict[str, Any]) -> None:
        """Begin the sweep here, or go on with it. Raises ToolchainError where another one is."""
        self._sweep()
        text = json.dumps(plan, indent=1, sort_keys=True) + "\n"
        result = self.read(PLAN)
        if result is None:
            if any(self.names(part) for part in ("", CHUNKS)):
                raise ToolchainError(
                    f"{self.place} holds files that are of no sweep",
                    "choose another folder with -o",
                )
            self.write(PLAN, text.encode())
            return
        try:
            there = json.loads(result)
        except ValueError:
            raise ModelError(f"{self.place}/{PLAN} is no description of a sweep") from None
        here = json.loads(text)
        for name in sorted({*there, *here}):
            if there.get(name) != here.get(name):
                raise ToolchainError(
                    f"{self.place} holds another sweep: its '{name}' differs",
                    "choose another folder with -o, or remove that one",
                )

    def chunk_name(self, number: int) -> str:
        """The file of a chunk."""
        return f"{CHUNKS}/{number:09d}{self.ending}"

    def done(self) -> frozenset[int]:
        """The chunks that need not be made again."""
        numbers = {int(name[:9]) for name in self.names(CHUNKS) if self._is_chunk(name)}
        for name in self.names(GROUPS):
            if name.endswith(".json") and name[:9].isdecimal():
                first = int(name[:9]) * GROUP
                numbers.update(range(first, first + GROUP))
        return frozenset(numbers)

    def _is_chunk(self, name: str) -> bool:
        return (
            name.endswith(self.ending)
            and name[:9].isdecimal()
            and len(name) == 9 + len(self.ending)
        )

    def gather(self, group: int, size: int) -> None:
        """The chunks of a group as one file, where all are there. `size` chunks are in all."""
        numbers = range(group * GROUP, min(size, (group + 1) * GROUP))
        name = f"{GROUPS}/{group:09d}.json"
        if self.read(name) is None:
            self.write(name, written(all_of([self._held(number) for number in numbers])))
        for number in numbers:
            self.remove(self.chunk_name(number))

    def _held(self, number: int) -> Held:
        content = self.read(self.chunk_name(number))
        if content is None:
            raise ToolchainError(f"{self.place}: chunk {number} is gone", RESUME)
        held: Held = json.loads(content)
        return held

    def summaries(self, size: int, of_rows: Callable[[bytes], Held]) -> Iterator[Held]:
        """Of all groups, in their order."""
        for group in range(-(-size // GROUP)):
            content = self.read(f"{GROUPS}/{group:09d}.json")
            if content is not None:
                yield json.loads(content)
                continue
            parts = []
            for number in range(group * GROUP, min(size, (group + 1) * GROUP)):
                if self.ending == ".json":
                    parts.append(self._held(number))
                else:
                    parts.append(of_rows(self.read(self.chunk_name(number)) or b""))
            yield all_of(parts)
