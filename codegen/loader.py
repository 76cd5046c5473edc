"""load and part: import a generated folder by its path, and one of its files."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import itertools
import os
import sys
import urllib.parse
from collections.abc import Callable, Generator
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

from codegen.compiler import manifest
from derive.diagnostics import ToolchainError

LIBRARIES = (".so", ".dylib", ".dll", ".pyd")
LOADED = "codegen.loaded"  # the package that they stand in
_loads = itertools.count(1)
_built: dict[Path, list[tuple[tuple[str, int, int], ...]]] = {}  # states of a folder's libraries


def load(folder: str | os.PathLike[str]) -> ModuleType:
    """The module in `folder`, under a name of its own, so that several versions live side by side.
    Its functions can be pickled: another process loads the folder, if it still holds the same
    equations.

    Raises ToolchainError where the folder is no generated module or cannot be imported.
    """
    place = Path(os.path.abspath(folder))
    if not (place / "__init__.py").is_file():
        raise ToolchainError(f"{place} is not a generated module: it has no __init__.py")
    name = next(name for name in map(_namer(place), _loads) if name not in sys.modules)
    spec = _spec(name, place)
    assert spec.loader is not None  # a path that ends in .py always has one
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
    for name in [x for x in sys.modules if f"{x}.".startswith(f"{module.__name__}.")]:
        del sys.modules[name]


def named_spec(name: str) -> ModuleSpec:
    """Of a module that another process loaded. Raises ImportError where its folder was built again
    from other equations since, or is gone."""
    _, program, quoted = name.removeprefix(f"{LOADED}.").split(":", 2)
    place = Path(urllib.parse.unquote(quoted))
    if _program(place) != program:
        raise ImportError(f"{place} no longer holds the equations that were loaded from it")
    return _spec(name, place)


def _namer(place: Path) -> Callable[[int], str]:
    """A number → the name of a module; dots would part it."""
    quoted = urllib.parse.quote(str(place), safe="/ ").replace(".", "%2E")
    program = _program(place)
    return lambda number: f"{LOADED}.{number}:{program}:{quoted}"


def _program(place: Path) -> str:
    """Tells equations apart; empty where the folder does not say."""
    with contextlib.suppress(OSError, ValueError, KeyError):
        return str(manifest(place)["program"])
    return ""


def _spec(name: str, place: Path) -> ModuleSpec:
    spelling = _spelling(place) if os.name == "posix" else str(place)
    spec = importlib.util.spec_from_file_location(
        name, f"{spelling}/__init__.py", submodule_search_locations=[spelling]
    )
    assert spec is not None
    return spec


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
