"""Results of earlier runs: finished runs are stored under a hash of all they depend on, a line
each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from derive.robots import File
from hamel.build import keys, store

KIND = "report"  # of entries in the store


class Results:
    """By name; what is put in is on disk at once, so that an interrupted report goes on where it
    was."""

    def __init__(self, path: File, options: Mapping[str, Any]) -> None:
        self._key = keys.file_key(path, options)
        self._known: dict[str, Any] = dict(store.lines(KIND, self._key))

    def __contains__(self, name: str) -> bool:
        return name in self._known

    def __getitem__(self, name: str) -> Any:
        return self._known[name]

    def get(self, name: str) -> Any:
        """What an earlier run left under this name; None where there was none."""
        return self._known.get(name)

    def put(self, name: str, value: Any) -> None:
        """Keep a result here and append it to the file of the store at once."""
        self._known[name] = value
        store.add_line(KIND, self._key, name, value)
