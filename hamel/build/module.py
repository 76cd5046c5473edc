"""module: a Program as a folder that Python can load, with the binaries that a compiler made of it.

Binaries are stored by everything they depend on, so that building again does not call the
compiler. They are stored only when the module that they belong to could be loaded.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import json
import os
import sys
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from codegen import compiler as toolchain
from codegen.emit import emit
from codegen.loader import load, unload
from codegen.program import Program
from codegen.seal import MANIFEST
from derive.diagnostics import ToolchainError
from derive.formulations.records import Equations
from hamel.build import store
from hamel.build.files import writing
from hamel.build.folder import check_module, publish
from hamel.build.keys import ELSEWHERE, compiler_errors, compiler_stamp
from hamel.build.scratch import workspace
from hamel.build.stages import program_of

COMPILED = "compiled"  # the kind of entry in the store
RUNNABLE = (
    "a compiler for this machine and this Python is needed; programs must be allowed to run in the "
    "folder of temporary files (TMPDIR names another)"
)


class UnusableError(ToolchainError):
    """What a compiler made without an error cannot be loaded."""


@dataclass(frozen=True)
class Compiled:
    """A module that was loaded: its files, and the module itself.

    `message` says in one line what is missing where `compiled` is False; `cached` that no compiler
    was needed.
    """

    files: Mapping[str, bytes]
    module: ModuleType
    compiled: bool
    message: str = ""
    cached: bool = False


@dataclass(frozen=True)
class Published:
    """The same in its place."""

    folder: Path
    compiled: bool
    message: str = ""
    cached: bool = False


def published(
    program: Program,
    folder: str | os.PathLike[str],
    extra: Mapping[str, str] | None = None,
    compiler: Sequence[str] | None = None,
) -> Published:
    """Program → folder, compiled where there is a compiler (`compiler` or the first one found)."""
    texts = emit(program, extra)
    with compiled(program.name, texts, compiler) as result:
        publish(Path(folder), result.files)
    return Published(Path(folder), result.compiled, result.message, result.cached)


@dataclass(frozen=True)
class Draft:
    """The texts of a module in a folder of temporary files, ready to be compiled."""

    name: str
    folder: Path
    texts: Mapping[str, str]
    command: tuple[str, ...]  # the compiler's; empty without one
    key: str | None  # of the binaries in the store


@contextlib.contextmanager
def drafted(
    name: str, texts: Mapping[str, str], compiler: Sequence[str] | None = None
) -> Iterator[Draft]:
    """Texts → draft, gone at the end of the block."""
    command = tuple(compiler or toolchain.find_compiler() or ())
    key = _key(name, texts, command) if command else None
    with contextlib.ExitStack() as stack:
        with writing(Path("the folder of temporary files"), ELSEWHERE):
            folder = stack.enter_context(workspace()) / name
            folder.mkdir()
            for file, text in texts.items():
                (folder / file).parent.mkdir(parents=True, exist_ok=True)
                (folder / file).write_bytes(text.encode())
        yield Draft(name, folder, texts, command, key)


@contextlib.contextmanager
def compiling(draft: Draft, numpy: bool = False) -> Iterator[Callable[[], Compiled]]:
    """Draft → compiled module, while something else is done: what is yielded waits for it.

    With `numpy` a module that runs on NumPy will do where what was compiled cannot be loaded.
    """
    finish = _finished_or_numpy if numpy else _finished
    with ThreadPoolExecutor(1) as thread:
        binaries = thread.submit(_binaries, draft)
        finished = functools.cache(lambda: finish(draft, binaries.result()))
        try:
            yield finished
        except BaseException:  # nobody waits for the compiler any more
            toolchain.stop(draft.folder)
            raise
        finally:
            if finished.cache_info().currsize:
                unload(finished().module)


@contextlib.contextmanager
def compiled(
    name: str, texts: Mapping[str, str], compiler: Sequence[str] | None = None
) -> Iterator[Compiled]:
    """Texts → compiled module, loaded from a folder that is gone at the end of the block.

    Raises ToolchainError for a compiler that fails, and for one that says nothing but makes what
    this Python cannot load.
    """
    with drafted(name, texts, compiler) as draft, compiling(draft) as finished:
        yield finished()


def without_compiler() -> str:
    """What a build says where it finds no compiler, in one line."""
    why, hint = toolchain.no_compiler()
    return f"{why}, so the module runs on NumPy: {hint}"


@contextlib.contextmanager
def temporary_module(
    equations: Equations,
    integrators: Collection[str] = (),
    enforcements: Collection[str] | None = None,
    functions: Collection[str] | None = None,
    real: str = "float64",
) -> Iterator[ModuleType]:
    """Equations → module that is needed for the length of a command."""
    with promised_module(equations, integrators, enforcements, functions, real) as module:
        yield module()


@contextlib.contextmanager
def promised_module(
    equations: Equations,
    integrators: Collection[str] = (),
    enforcements: Collection[str] | None = None,
    functions: Collection[str] | None = None,
    real: str = "float64",
) -> Iterator[Callable[[], ModuleType]]:
    """The same, compiled while something else is done: what is yielded waits for it."""
    program = program_of(equations, functions, integrators, enforcements, real)
    with drafted(program.name, emit(program)) as draft, compiling(draft) as finished:

        def module() -> ModuleType:
            folder = finished()
            if folder.message:
                warnings.warn(folder.message, RuntimeWarning, stacklevel=3)
            return folder.module

        yield functools.cache(module)


def module_in(folder: str | os.PathLike[str]) -> ModuleType:
    """The generated module in a folder, when every file is the one that was built and verified;
    VerificationError else."""
    place = Path(os.path.abspath(folder))
    check_module(place)
    return load(place)


# ---- files


def _read(folder: Path, names: Collection[str]) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in names}


def _listed(folder: Path) -> list[str]:
    return list(json.loads((folder / toolchain.BINARIES).read_text(encoding="utf-8")))


# ---- the compiler


def _key(name: str, texts: Mapping[str, str], command: Sequence[str]) -> str | None:
    """What the binaries depend on: exactly this text, compiler, Python and NumPy."""
    with contextlib.suppress(OSError), compiler_errors():
        flags = repr(json.loads(texts[MANIFEST])["flags"])
        code = [(path, texts[path]) for path in sorted(texts) if _is_compiled(path)]
        parts = [part for pair in code for part in pair]
        machine = (compiler_stamp(command), toolchain.identity(command))
        return store.digest(name, *machine, flags, *parts)
    return None


def _is_compiled(path: str) -> bool:
    """Whether it goes into a binary, or packs one."""
    return path.endswith((".c", ".h", ".xml")) or path.startswith("build_")


def _binaries(draft: Draft) -> bool:
    """Binaries into the draft's folder, from the store (True) or the compiler (False)."""
    entry = store.stored(COMPILED, draft.key)
    if entry is None:
        _compile(draft)
        return False
    with writing(draft.folder, ELSEWHERE):
        for name, content in entry.files.items():
            (draft.folder / name).write_bytes(content)
        toolchain.record(draft.folder, sorted(entry.files))
    return True


def _compile(draft: Draft) -> None:
    if draft.command:
        with compiler_errors():
            toolchain.compile_folder(draft.folder, draft.name, list(draft.command))


def _finished(draft: Draft, stored: bool) -> Compiled:
    """The draft loaded; what was compiled for it, and works, goes to the store."""
    texts = {name: text.encode() for name, text in draft.texts.items()}
    if not draft.command:
        return Compiled(texts, loaded(draft.folder), False, without_compiler())
    try:
        module = _checked(draft)
    except ToolchainError:
        if not stored:
            raise
        store.drop(COMPILED, draft.key)
        _compile(draft)
        module, stored = _checked(draft), False
    names = _listed(draft.folder)
    if not stored:
        store.put(COMPILED, draft.key, store.Entry(_read(draft.folder, names)))
    files = {**texts, **_read(draft.folder, [*names, toolchain.BINARIES])}
    return Compiled(files, module, True, "", stored)


def _finished_or_numpy(draft: Draft, stored: bool) -> Compiled:
    """The same; without its binaries where they cannot be loaded."""
    try:
        return _finished(draft, stored)
    except UnusableError as error:
        for name in (*_listed(draft.folder), toolchain.BINARIES):
            (draft.folder / name).unlink(missing_ok=True)
        texts = {name: text.encode() for name, text in draft.texts.items()}
        said = f"{error.diagnostics[0].message}, so the module runs on NumPy"
        return Compiled(texts, loaded(draft.folder), False, said)


def _checked(draft: Draft) -> ModuleType:
    """The module, when it runs on what was compiled; ToolchainError else."""
    module = loaded(draft.folder)
    try:
        suffix = toolchain.extension_suffix()
        extended = any(name.endswith(suffix) for name in _listed(draft.folder))
        wanted = "extension" if extended else "ctypes"
        importlib.import_module(f"{module.__name__}._library")
        if module.backend != wanted:
            importlib.import_module(f"{module.__name__}._{module.name}")
            raise ImportError(f"it runs on {module.backend}, not on its {wanted}")
    except (ImportError, OSError, AttributeError, UnicodeDecodeError) as error:
        said = " ".join(str(error).replace(f"{draft.folder}{os.sep}", "").split())
        raise UnusableError(
            f"{' '.join(draft.command)} ended without an error, "
            f"but what it made cannot be loaded: {said}",
            hint=RUNNABLE,
        ) from error
    return module


def loaded(folder: Path) -> ModuleType:
    """The module, without the warning that it is to be compiled and without traces in its
    folder."""
    quiet = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            return load(folder)
    finally:
        sys.dont_write_bytecode = quiet
