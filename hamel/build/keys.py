"""Keys of the store: hashes of everything that can change what is stored under them.

A module depends on its model, the options, every file of hamel itself, the libraries that derive
it, Python, and what a binary depends on: the compiler, its flags and this processor.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import importlib.util
import logging
import os
import platform
import re
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from codegen import compiler
from derive.diagnostics import ToolchainError
from hamel.build.store import digest

LOG = logging.getLogger("hamel")
ELSEWHERE = "free some space there, or set TMPDIR to a folder on another disk"
LIBRARIES = ("casadi", "sympy", "numpy", "jinja2", "pydantic", "latex2mathml")
PACKAGES = ("derive", "codegen", "hamel")
ALONE = (".yaml", ".yml")  # files that refer to no others
# but by `use:` or by `file:`, and a key may be written with escapes
REFERS = re.compile(rb"\b(?:use|file)\b\s*[\"']?\s*:|\\")


def file_key(path: str | PathLike[str], options: Mapping[str, Any]) -> str | None:
    """The key of what is made of a model file with these options; None for files that refer to
    others, or that can be read once only, like pipes."""
    if Path(path).suffix not in ALONE or not os.path.isfile(path):
        return None
    with contextlib.suppress(OSError):
        text = Path(path).read_bytes()
        if REFERS.search(text):
            return None
        asked = repr(sorted(options.items()))
        return digest(os.fspath(path), text, asked, generator(), processor())
    return None


def content_key(*parts: str) -> str | None:
    """The key of what is made of these texts."""
    with contextlib.suppress(OSError):
        return digest(*parts, generator(), processor())
    return None


@functools.cache
def generator() -> str:
    """Every file of hamel, the libraries it derives with, and Python. Raises OSError where one of
    them cannot be read."""
    sources = [Path(place).read_bytes() for place in _sources()]
    libraries = [f"{place} {_stamp(place)}" for place in _libraries()]
    return digest(sys.version, sys.executable, *sources, *libraries)


def processor() -> str:
    """The compiler, and this processor as it sees it."""
    command = compiler.find_compiler()
    if command is None:
        return platform.machine()
    with compiler_errors():
        return digest(compiler_stamp(command), repr(compiler.probe(tuple(command))))


# What a compiler says of a line of the code, and what it says of itself.
LINE = re.compile(r"\.[ch]:[\d:]+ error:")
OTHER = "CC names another compiler; -v shows all that this one said"
REFUSED = (
    "this may be hamel's fault rather than the compiler's: please report it with the model; "
    f"another --integrator or --choice is other code; {OTHER}"
)


@contextlib.contextmanager
def compiler_errors() -> Iterator[None]:
    """What a compiler says, and a full disk, as ToolchainError with what to do about it."""
    try:
        yield
    except compiler.CompileError as error:
        LOG.debug("%s", error.said)
        if isinstance(error, compiler.NoTool):
            raise ToolchainError(str(error), hint=error.hint) from error
        raise ToolchainError(
            f"the generated code does not compile: {error}",
            hint=error.hint or (REFUSED if LINE.search(str(error)) else OTHER),
        ) from error
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise ToolchainError(f"cannot compile: {error.strerror}", hint=ELSEWHERE) from error
        raise


def compiler_stamp(command: Sequence[str]) -> str:
    """The compiler's program: where it is, its size and when it was made."""
    program = shutil.which(command[0])
    place = os.path.realpath(program) if program else command[0]
    return f"{list(command)} {place} {_stamp(place) if program else ''}"


def _stamp(place: str) -> str:
    about = os.stat(place)
    return f"{about.st_mtime_ns} {about.st_size}"


def _sources() -> Iterator[str]:
    home = Path(__file__).resolve().parent.parent.parent
    for package in PACKAGES:
        for folder, folders, files in os.walk(home / package):
            folders[:] = sorted(name for name in folders if name != "__pycache__")
            yield from (os.path.join(folder, name) for name in sorted(files))


def _libraries() -> Iterator[str]:
    for name in LIBRARIES:
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.origin:
            yield spec.origin
