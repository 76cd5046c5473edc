"""The one store of artefacts: what need not be made twice, by content.

An entry is a folder `KIND-KEY` with files and an index. The key names all that the entry depends
on. The index holds the key and the hash of every file, and its own: whatever happened to an entry,
a flipped bit, a missing end, a file of another entry, it is dropped and made again, never used.
Losing the store, or not having one, only costs time.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hamel.build.limits import FRESH, LARGEST, LONGEST, SMALL
from hamel.build.scratch import is_scratch, scratch, sweep

INDEX = "index.json"
LINES = "lines.jsonl"


@dataclass(frozen=True)
class Entry:
    """Files by name, and what else is known of them, as JSON has it."""

    files: Mapping[str, bytes] = field(default_factory=dict)
    data: Mapping[str, Any] = field(default_factory=dict)


def root() -> Path | None:
    """XDG_CACHE_HOME/hamel (~/.cache/hamel), made when it is missing; None where none can be
    had."""
    with contextlib.suppress(OSError, RuntimeError):
        place = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hamel"
        place.mkdir(parents=True, exist_ok=True)
        return place
    return None


def stored(kind: str, key: str | None) -> Entry | None:
    """The entry, when it is there and exactly what was put there."""
    place = _place(kind, key)
    if place is None or not place.is_dir():
        return None
    try:
        entry = _read(place, kind, key)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        shutil.rmtree(place, ignore_errors=True)
        return None
    _touch(place)
    return entry


def put(kind: str, key: str | None, entry: Entry) -> None:
    """Put an entry into the store. Made beside its place and renamed: readers see all of it or
    nothing. A full disk costs the entry and nothing else."""
    place = _place(kind, key)
    if place is None:
        return
    with contextlib.suppress(OSError), scratch(place.parent) as fresh:
        result = fresh / place.name
        for name, content in entry.files.items():
            path = result / "files" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        result.mkdir(exist_ok=True)
        (result / INDEX).write_text(_index(kind, key, entry), encoding="utf-8")
        os.rename(result, place)
    prune(place.parent)


def drop(kind: str, key: str | None) -> None:
    """Forget an entry."""
    place = _place(kind, key)
    if place is not None:
        shutil.rmtree(place, ignore_errors=True)


def digest(*parts: str | bytes) -> str:
    """A name for a sequence of texts."""
    result = hashlib.sha256()
    for part in parts:
        content = part.encode() if isinstance(part, str) else part
        result.update(f"{len(content)}\0".encode() + content)
    return result.hexdigest()


def _place(kind: str, key: str | None) -> Path | None:
    place = root()
    return place / f"{kind}-{key[:40]}" if place and key else None


def _index(kind: str, key: str | None, entry: Entry) -> str:
    hashes = {name: hashlib.sha256(content).hexdigest() for name, content in entry.files.items()}
    held = {"kind": kind, "key": key, "files": hashes, "data": entry.data}
    return json.dumps({"seal": _seal(held), **held})


def _seal(held: Mapping[str, Any]) -> str:
    return digest(json.dumps(held, sort_keys=True))


def _read(place: Path, kind: str, key: str | None) -> Entry:
    """Raises one of many errors when anything is not as it was put there."""
    held = json.loads((place / INDEX).read_text(encoding="utf-8"))
    seal = held.pop("seal")
    if seal != _seal(held) or (held["kind"], held["key"]) != (kind, key):
        raise ValueError("this is not the index of this entry")
    files = {name: (place / "files" / name).read_bytes() for name in held["files"]}
    for name, content in files.items():
        if hashlib.sha256(content).hexdigest() != held["files"][name]:
            raise ValueError(f"{name} was changed")
    return Entry(files, held["data"])


# ---- results that come one by one


def lines(kind: str, key: str | None) -> Iterator[tuple[str, Any]]:
    """What was added line by line. A line that was cut off or changed is no line."""
    place = _place(kind, key)
    if place is None or not (place / LINES).is_file():
        return
    _touch(place)
    with contextlib.suppress(OSError):
        for line in (place / LINES).read_bytes().splitlines():
            with contextlib.suppress(ValueError, TypeError):
                seal, name, value = json.loads(line)
                if seal == _seal({"key": key, "line": [name, value]}):
                    yield name, value


def add_line(kind: str, key: str | None, name: str, value: Any) -> None:
    """Add a line; it is on disk at once, so that interrupted work goes on where it was."""
    place = _place(kind, key)
    if place is None:
        return
    value = json.loads(json.dumps(value))
    with contextlib.suppress(OSError):
        place.mkdir(exist_ok=True)
        with (place / LINES).open("a", encoding="utf-8") as file:
            file.write(json.dumps([_seal({"key": key, "line": [name, value]}), name, value]) + "\n")


# ---- housekeeping


def _touch(place: Path) -> None:
    """Note that an entry was of use just now."""
    with contextlib.suppress(OSError):
        os.utime(place)


def prune(
    place: Path, longest: float = LONGEST, largest: int = LARGEST, small: int = SMALL
) -> None:
    """Drop the entries that were not used for `longest` seconds, then the oldest until `largest`
    bytes are left, but none of up to `small` bytes: results of reports, which took minutes each;
    and what killed processes left."""
    sweep(place)
    total = 0
    for age, entry in sorted(_aged(place, time.time())):
        size = _size(entry)
        crowded = size > small and total + size > largest
        if age > FRESH and (age > longest or crowded):
            shutil.rmtree(entry, ignore_errors=True)
        else:
            total += size


def _aged(place: Path, now: float) -> list[tuple[float, Path]]:
    """Every entry with the seconds since it was of use."""
    old = []
    with contextlib.suppress(OSError):
        for entry in os.scandir(place):
            with contextlib.suppress(OSError):  # another process may have dropped it
                if entry.is_dir(follow_symlinks=False) and not is_scratch(entry.name):
                    old.append((now - entry.stat().st_mtime, Path(entry.path)))
    return old


def _size(entry: Path) -> int:
    total = 0
    for folder, _, files in os.walk(entry):
        for name in files:
            with contextlib.suppress(OSError):
                total += os.lstat(os.path.join(folder, name)).st_size
    return total
