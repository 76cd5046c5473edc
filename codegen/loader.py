"""load and part: import a generated folder by its path, and one of its files."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import itertools
import os
import sys
from collections.abc import Generator
from pathlib import Path
from types import ModuleType

from derive.diagnostics import ToolchainError

LIBRARIES = (".so", ".dylib", ".dll", ".pyd")
_loads = itertools.count(1)
_built: dict[Path, list[tuple[tuple[str, int, int], ...]]] = {}  # states of a folder's libraries


def load(folder: str | os.PathLike[str]) -> ModuleType:
    """The module in `folder`, under a name of its own, so that several versions live side by side.

    Raises ToolchainError where the folder is no generated module or cannot be imported.
    """
    place = Path(os.path.abspath(folder))
    if not (place / "__init__.py").is_file():
        raise ToolchainError(f"{place} is not a generated module: it has no __init__.py")
    name = f"hamel_generated_{next(_loads)}_{place.name}"
    spelling = _spelling(place) if os.name == "posix" else str(place)
    spec = importlib.util.spec_from_file_location(
        name, f"{spelling}/__init__.py", submodule_search_locations=[spelling]
    )
    assert (
        spec is not None and spec.loader is not None
    )  # a path that ends in .py always has a loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        with _readable(place):
            spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def unload(module: ModuleType) -> None:
    """Let go of a module that was loaded, and of its files: nothing more is imported from it."""
    for name in [x for x in sys.modules if x.split(".")[0] == module.__name__]:
        del sys.modules[name]


def _spelling(place: Path) -> str:
    """The folder's path, written otherwise for every state of its libraries: the dynamic linker
    takes a library for loaded when it knows the path, though it was built again."""
    files = sorted(file for file in place.iterdir() if file.suffix in LIBRARIES)
    states = [(file.name, file.stat()) for file in files]
    state = tuple([(name, found.st_ino, found.st_mtime_ns) for name, found in states])
    known = _built.setdefault(place, [])
    if state not in known:
        known.append(state)
    digits = f"{known.index(state):b}".lstrip("0")
    return str(place) + "".join("//." if digit == "1" else "/." for digit in digits)


def part(module: ModuleType, name: str) -> ModuleType:
    """A file of a loaded folder, such as `_numpy`; ImportError or OSError where there is none that
    fits this Python."""
    with _readable(Path(str(module.__file__)).parent):
        return importlib.import_module(f"{module.__name__}.{name}")


@contextlib.contextmanager
def _readable(place: Path) -> Generator[None]:
    """Python does not check the byte code that it keeps beside a module: spoiled, it ends the
    import by any error."""
    try:
        yield
    except (EOFError, ValueError, TypeError, SyntaxError) as error:
        raise ToolchainError(
            f"{os.path.normpath(place)} cannot be imported: {error}",
            hint="delete its __pycache__, or build it again",
        ) from error
