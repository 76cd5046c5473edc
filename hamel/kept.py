"""Modules that were built and verified before: building again, with nothing changed that they
depend on, copies them.

The key covers the model file, the options, every file of hamel itself, the libraries it derives
with, Python, and what a binary depends on: the compiler, its flags and this processor. A cache that
cannot be read or written only costs time.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import importlib.util
import json
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from codegen import cache
from codegen.compiler import find_compiler, probe
from codegen.placing import check_place, new_folder, put
from hamel.built import Built, as_json

LIBRARIES = ("casadi", "sympy", "numpy", "jinja2", "pydantic", "latex2mathml")
PACKAGES = ("derive", "codegen", "hamel")
RECORD = "built.json"
ALONE = (".yaml", ".yml")  # files that refer to no others


def key(path: str | PathLike[str], options: Mapping[str, Any]) -> str | None:
    """What names this build; None where no cache can be used."""
    if Path(path).suffix not in ALONE or not os.path.isfile(path):  # a pipe can be read once only
        return None
    digest = hashlib.sha256(
        f"{path}\0{sorted(options.items())!r}\0{sys.version}\0{sys.executable}".encode()
    )
    with contextlib.suppress(OSError):
        digest.update(Path(path).read_bytes())
        for place in (*_generator(), *_libraries(), *_compiler()):
            found = os.stat(place)
            digest.update(f"\0{place}\0{found.st_mtime_ns}\0{found.st_size}".encode())
        command = find_compiler()
        digest.update(f"\0{probe(tuple(command)) if command else platform.machine()}".encode())
        return digest.hexdigest()[:40]
    return None


def _generator() -> Iterator[str]:
    root = Path(__file__).resolve().parent.parent
    for package in PACKAGES:
        for folder, folders, files in os.walk(root / package):
            folders[:] = sorted(name for name in folders if name != "__pycache__")
            yield from (os.path.join(folder, name) for name in sorted(files))


def _libraries() -> Iterator[str]:
    for name in LIBRARIES:
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.origin:
            yield spec.origin


def _compiler() -> Iterator[str]:
    command = find_compiler()
    found = shutil.which(command[0]) if command else None
    if found:
        yield os.path.realpath(found)


def restored(name: str | None, folder: str | Path | None) -> Built | None:
    """The folder of an earlier build, at its place again; None when there is none."""
    start = time.perf_counter()
    kept = _place(name)
    try:
        record = json.loads((kept / RECORD).read_text(encoding="utf-8")) if kept else None
    except (OSError, ValueError):
        record = None
    if kept is None or record is None:
        return None
    place = Path(os.path.abspath(folder or Path("generated") / record["model"]))
    check_place(place)
    with new_folder(place) as fresh:
        shutil.copytree(kept / "module", fresh, dirs_exist_ok=True)
        put(fresh, place)
    cache.used(kept)
    return _record(record, Path(folder or place), time.perf_counter() - start)


def _record(record: dict[str, Any], folder: Path, seconds: float) -> Built:
    lists = {name: tuple(value) for name, value in record.items() if isinstance(value, list)}
    return Built(
        **{**record, **lists, "folder": folder, "seconds": {"kept": seconds}, "kept": True}
    )


def remember(name: str | None, record: Built) -> None:
    """Keep what was built. Made beside its place and renamed: readers see all of it or nothing."""
    kept = _place(name)
    if kept is None:
        return
    with contextlib.suppress(OSError):
        fresh = Path(tempfile.mkdtemp(prefix="new-", dir=kept.parent))
        try:
            shutil.copytree(record.folder, fresh / "module", ignore=_others(record.folder))
            known = {field.name for field in dataclasses.fields(Built)}
            text = json.dumps(
                {name: value for name, value in as_json(record).items() if name in known}
            )
            (fresh / RECORD).write_text(text, encoding="utf-8")
            os.rename(fresh, kept)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)


def _others(folder: Path) -> Any:
    """Leaves out what is not of the module: files people added."""
    listed = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["files"]
    made = {*(name.split("/")[0] for name in listed), "manifest.json"}

    def ignored(place: str, names: list[str]) -> set[str]:
        if Path(place) != Path(folder):
            return set()
        return {
            name
            for name in names
            if name not in made and not name.endswith((".so", ".dylib", ".dll", ".pyd"))
        }

    return ignored


def _place(name: str | None) -> Path | None:
    place = cache.folder()
    return place / f"built-{name}" if place and name else None
