"""What was found before: finished runs are kept in the cache folder under a hash of all they depend
on, a line each."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from codegen import cache
from hamel import kept

LINES = "found.jsonl"


class Found:
    """By name; what is put in is on disk at once, so that an interrupted report goes on where it
    was."""

    def __init__(self, path: str, options: Mapping[str, Any]) -> None:
        name, root = kept.key(path, options), cache.folder()
        self._folder = root / f"report-{name}" if root and name else None
        self._known: dict[str, Any] = dict(_lines(self._folder / LINES)) if self._folder else {}
        if self._folder and self._folder.exists():
            cache.used(self._folder)

    def __contains__(self, name: str) -> bool:
        return name in self._known

    def __getitem__(self, name: str) -> Any:
        return self._known[name]

    def get(self, name: str) -> Any:
        return self._known.get(name)

    def put(self, name: str, value: Any) -> None:
        self._known[name] = value
        if self._folder:
            with contextlib.suppress(OSError):
                self._folder.mkdir(exist_ok=True)
                with (self._folder / LINES).open("a", encoding="utf-8") as file:
                    file.write(json.dumps([name, value]) + "\n")


def _lines(place: Path) -> list[tuple[str, Any]]:
    """A line that was cut off when a run was killed is no line."""
    found = []
    with contextlib.suppress(OSError):
        for line in place.read_text(encoding="utf-8").splitlines():
            with contextlib.suppress(ValueError):
                name, value = json.loads(line)
                found.append((name, value))
    return found
