"""Where a sweep is written: a folder of this machine, or any address that fsspec knows.

`sweep.json` says what the sweep is, `chunks/` holds a file for each finished chunk, written at once
and in one step. In a sweep that keeps no rows, 256 chunks that follow each other become one file of
`groups/`. A chunk is done when its file is there, or that of its group: never half, never twice.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

from derive.diagnostics import ModelError, ToolchainError
from hamel.sweep.limits import GROUP
from hamel.sweep.places import RESUME, place_of
from hamel.sweep.work import Held, all_of, written

PLAN, CHUNKS, GROUPS = "sweep.json", "chunks", "groups"


@dataclass(frozen=True)
class Done:
    """Chunks that are there: alone, or in groups. It grows with the number of groups only."""

    size: int  # chunks in all
    chunks: frozenset[int]
    groups: frozenset[int]

    def __contains__(self, chunk: int) -> bool:
        return chunk // GROUP in self.groups or chunk in self.chunks

    def __iter__(self) -> Iterator[int]:
        for group in self.groups:
            yield from range(group * GROUP, min(self.size, (group + 1) * GROUP))
        yield from self.chunks


def _which(name: str, there: dict[str, Any], here: dict[str, Any]) -> str:
    """What differs in two descriptions: a key, and of a mapping the keys in it."""
    pair = (there.get(name), here.get(name))
    first, second = (each if isinstance(each, dict) else {} for each in pair)
    inner = sorted(key for key in {*first, *second} if first.get(key) != second.get(key))
    return f"'{name}' ({', '.join(inner)})" if first and second else f"'{name}'"


Content = TypeVar("Content")


class Folder:
    """The files of a sweep, by names relative to its place."""

    def __init__(self, place: str, rows: bool) -> None:
        self.place, self.ending = place, ".parquet" if rows else ".json"
        self.files = place_of(place)

    def read(self, name: str) -> bytes | None:
        """The bytes of a file; None where there is none."""
        return self.files.read(name)

    def write(self, name: str, content: bytes) -> None:
        """In one step. Raises ToolchainError where that cannot be; what is there stays."""
        self.files.write(name, content)

    def enter(self, plan: dict[str, Any]) -> None:
        """Begin the sweep here, or go on with it. Raises ToolchainError where another one is."""
        for part in (CHUNKS, GROUPS, ""):
            self.files.sweep(part)
        text = json.dumps(plan, indent=1, sort_keys=True) + "\n"
        result = self.read(PLAN)
        if result is None:
            if any(self.files.names(part) for part in ("", CHUNKS)):
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
                    f"{self.place} holds another sweep: its {_which(name, there, here)} differs",
                    "choose another folder with -o, or remove that one",
                )

    def chunk_name(self, number: int) -> str:
        """The file of a chunk."""
        return f"{CHUNKS}/{number:09d}{self.ending}"

    def done(self, size: int) -> Done:
        """The chunks that need not be made again, of `size` in all."""
        chunks = {int(name[:9]) for name in self.files.names(CHUNKS) if self._is_chunk(name)}
        names = [name for name in self.files.names(GROUPS) if name.endswith(".json")]
        groups = {int(name[:9]) for name in names if name[:9].isdecimal()}
        left = {chunk for chunk in chunks if chunk < size and chunk // GROUP not in groups}
        return Done(size, frozenset(left), frozenset(groups))

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
            self.write(name, written(all_of(map(self._held, numbers))))
        for number in numbers:
            self.files.remove(self.chunk_name(number))

    def gather_left(self, size: int) -> None:
        """The groups of which chunks are left: the last one, and those where a process was killed
        on the way."""
        chunks = (int(name[:9]) for name in self.files.names(CHUNKS) if self._is_chunk(name))
        for group in sorted({chunk // GROUP for chunk in chunks}):
            self.gather(group, size)

    def _held(self, number: int) -> Held:
        return self.understood(self.chunk_name(number), json.loads)

    def understood(self, name: str, reader: Callable[[bytes], Content]) -> Content:
        """What a file holds. Raises ToolchainError where it is gone or damaged."""
        content = self.read(name)
        if content is None:
            raise ToolchainError(f"{self.place}/{name} is gone", RESUME)
        try:
            return reader(content)
        except ValueError:
            removed = "remove it, and run the command again: what it held is made anew"
            raise ToolchainError(f"{self.place}/{name} is damaged", removed) from None

    def summaries(self, size: int, of_rows: Callable[[bytes], Held]) -> Iterator[Held]:
        """Of all groups, in their order."""
        for group in range(-(-size // GROUP)):
            name = f"{GROUPS}/{group:09d}.json"
            if self.read(name) is not None:
                yield self.understood(name, json.loads)
                continue
            reader = json.loads if self.ending == ".json" else of_rows
            numbers = range(group * GROUP, min(size, (group + 1) * GROUP))
            yield all_of([self.understood(self.chunk_name(k), reader) for k in numbers])
