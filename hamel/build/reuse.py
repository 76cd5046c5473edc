"""A module that was built and verified before from the same things is taken from the store.

Nothing that derives is needed for it, so nothing of that is imported here.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from hamel.build import store
from hamel.build.clock import LOG
from hamel.build.folder import publish
from hamel.build.keys import file_key
from hamel.build.options import BuildOptions
from hamel.records import Built, as_json

BUILT = "built"  # the kind of entry in the store


def reused(
    path: str | PathLike[str], out: str | Path | None, options: BuildOptions
) -> Built | None:
    """The module of an earlier build, in its place; None when there is none."""
    start = time.perf_counter()
    entry = store.stored(BUILT, file_key(path, options.said()))
    if entry is None:
        return None
    place = Path(out) if out else Path("generated") / entry.data["model"]
    publish(place, entry.files)
    seconds = time.perf_counter() - start
    LOG.info("%-12s %-44s %8.3f s", "store", f"verified before → {place}", seconds)
    return _record(entry.data, place, seconds)


def _record(data: Mapping[str, Any], place: Path, seconds: float) -> Built:
    lists = {name: tuple(value) for name, value in data.items() if isinstance(value, list)}
    return Built(**{**data, **lists, "folder": place, "seconds": {"kept": seconds}, "kept": True})


def remember(key: str | None, record: Built, files: Mapping[str, bytes]) -> None:
    """Put a module that was just verified into the store."""
    names = {field.name for field in dataclasses.fields(Built)}
    data = {name: value for name, value in as_json(record).items() if name in names}
    store.put(BUILT, key, store.Entry(files, data))
