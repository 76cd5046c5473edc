"""build: emit a Program into a folder, compile it, and put it in place in one move.

The binaries of a program are kept in a cache under a hash of everything they depend on, so that
building again does not call the compiler. Nothing half-written is ever left where the folder should
be.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from codegen import cache
from codegen import compiler as toolchain
from codegen.placing import check_place, new_folder, put, write
from codegen.program import Program
from codegen.targets import TARGETS
from derive.diagnostics import ToolchainError

VERIFICATION = "verification.json"  # whose summary goes into the manifest
NO_COMPILER = f"no C compiler found, so the module runs on NumPy: {toolchain.INSTALL}"


@dataclass(frozen=True)
class Built:
    """`message` says in one line what is missing where `compiled` is False; `cached` that no
    compiler was needed."""

    folder: Path
    compiled: bool
    message: str = ""
    cached: bool = False


@dataclass(frozen=True)
class Draft:
    """A generated folder that is not yet where it belongs: `fresh` is to become `place`."""

    name: str
    place: Path
    fresh: Path
    files: Mapping[str, str]
    command: tuple[str, ...]  # the compiler's; empty without one


def emit(program: Program, extra: Mapping[str, str] | None = None) -> dict[str, str]:
    """All text files of the generated folder: relative path → text."""
    files: dict[str, str] = {}
    for target in TARGETS:
        files |= target.files(program)
    return _sealed(files, extra or {})


def _sealed(files: Mapping[str, str], extra: Mapping[str, str]) -> dict[str, str]:
    """With `extra` among them, and the hashes of all in the manifest."""
    others = {
        name: text for name, text in sorted({**files, **extra}.items()) if name != "manifest.json"
    }
    hashes = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in others.items()}
    manifest = {**json.loads(files["manifest.json"]), "files": hashes}
    if VERIFICATION in others:
        manifest["verification"] = json.loads(others[VERIFICATION])["summary"]
    return dict(sorted((others | {"manifest.json": json.dumps(manifest, indent=1) + "\n"}).items()))


def build(
    program: Program,
    folder: str | os.PathLike[str],
    extra: Mapping[str, str] | None = None,
    compiler: Sequence[str] | str | None = None,
) -> Built:
    """The generated folder at `folder`, compiled where there is a compiler (`compiler` or the first
    one found)."""
    with draft(program, folder, compiler) as made:
        found = compiled(made)
        publish(made, extra or {})
    return Built(made.place, found.compiled, found.message, found.cached)


@contextlib.contextmanager
def draft(
    program: Program, folder: str | os.PathLike[str], compiler: Sequence[str] | str | None = None
) -> Iterator[Draft]:
    """The texts of the folder, beside its place; gone at the end of the block unless published."""
    place = Path(os.path.abspath(folder))
    check_place(place)
    command = (
        [compiler] if isinstance(compiler, str) else compiler or toolchain.find_compiler() or ()
    )
    with new_folder(place) as fresh:
        files = emit(program)
        write(fresh, files)
        yield Draft(program.name, place, fresh, files, tuple(command))


def compiled(made: Draft) -> Built:
    """The draft with its binaries: a folder that can be loaded where it is."""
    if not made.command:
        return Built(made.fresh, False, NO_COMPILER)
    return Built(
        made.fresh, True, "", _compile(made.fresh, made.name, made.files, list(made.command))
    )


def publish(made: Draft, extra: Mapping[str, str]) -> None:
    """The draft, with further texts in it, to its place."""
    files = _sealed(made.files, extra)
    write(made.fresh, {name: files[name] for name in (*extra, "manifest.json")})
    put(made.fresh, made.place)


# ---- compiled once, kept


def _compile(folder: Path, name: str, files: Mapping[str, str], command: list[str]) -> bool:
    """Binaries into the folder, from the cache (True) or the compiler (False)."""
    kept = _cache_folder(name, files, command)
    if kept and _recalled(kept, folder):
        return True
    try:
        made = toolchain.compile_folder(folder, name, command)
    except toolchain.CompileError as error:
        _remember_failure(kept, str(error))
        raise ToolchainError(
            f"the generated code does not compile: {error}", hint=toolchain.INSTALL
        ) from error
    _remember(kept, folder, made)
    return False


def _recalled(kept: Path, folder: Path) -> bool:
    """Copy what the cache has; False where it has nothing, or not all of it."""
    try:
        for made in (kept / "ready").read_text(encoding="utf-8").split("\n"):
            shutil.copy2(kept / made, folder / made)
    except FileNotFoundError:
        shutil.rmtree(kept, ignore_errors=True)
        return False
    cache.used(kept)
    return True


def _cache_folder(name: str, files: Mapping[str, str], command: list[str]) -> Path | None:
    """Where binaries of exactly this text, compiler, Python and NumPy belong; None where no cache
    can be had."""
    digest = hashlib.sha256()
    with contextlib.suppress(OSError):
        digest.update(toolchain.identity(command).encode())
        digest.update(repr(json.loads(files["manifest.json"])["flags"]).encode())
        for path in sorted(path for path in files if path.endswith((".c", ".h"))):
            digest.update(f"\0{path}\0{files[path]}".encode())
        root = cache.folder()
        return root and root / f"{name}-{digest.hexdigest()[:40]}"
    return None


def _remember(kept: Path | None, folder: Path, made: Sequence[str]) -> None:
    """Fill a folder of our own, then rename it: readers see all of it or nothing. A full disk only
    costs the cache."""
    if kept is None:
        return
    with contextlib.suppress(OSError):
        fresh = Path(tempfile.mkdtemp(prefix="new-", dir=kept.parent))
        try:
            for name in made:
                shutil.copy2(folder / name, fresh / name)
            (fresh / "ready").write_text("\n".join(made), encoding="utf-8")
            with contextlib.suppress(FileNotFoundError):
                shutil.rmtree(kept) if not (kept / "ready").exists() else None
            os.rename(fresh, kept)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)
    cache.prune(kept.parent)


def _remember_failure(kept: Path | None, said: str) -> None:
    """A marker for people to read. It is never believed: what was missing may be installed by
    now."""
    if kept is not None:
        with contextlib.suppress(OSError):
            kept.mkdir(exist_ok=True)
            (kept / "failed").write_text(said, encoding="utf-8")
