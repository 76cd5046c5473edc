"""Where files are kept by names: a folder of this machine, or any address that fsspec knows. A file
is there as a whole or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

from derive.diagnostics import ToolchainError
from hamel.build.files import writing
from hamel.optional import library

RESUME = "the same command goes on from what is there"
# stores that show an object when all of it has come; in others it is moved to its name
WHOLE = {"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oss", "memory"}


class Place(Protocol):
    """Files by name. What fails raises ToolchainError."""

    def read(self, name: str) -> bytes | None:
        """The bytes of a file; None where there is none."""
        ...

    def write(self, name: str, content: bytes) -> None:
        """In one step; where that cannot be, what is there stays."""
        ...

    def remove(self, name: str) -> None:
        """A file, if it is there."""
        ...

    def names(self, below: str) -> list[str]:
        """The files in a folder of it, in order."""
        ...

    def sweep(self, below: str) -> None:
        """Remove what was half written when the process that wrote it was killed."""
        ...


def place_of(address: str) -> Place:
    """The place of that path or address. Raises ToolchainError where fsspec does not know it."""
    if "://" not in address and "::" not in address:
        return Local(Path(address))
    fsspec = library("fsspec", f"writing to {address}")
    with _of(address, "a folder, or an address of a kind that fsspec knows"):
        files, root = fsspec.core.url_to_fs(address)
    kinds = {files.protocol} if isinstance(files.protocol, str) else set(files.protocol)
    if kinds & {"file", "local"}:
        return Local(Path(root))
    return Remote(address, files, root, bool(kinds & WHOLE))


# ---- of this machine


class Local:
    """A folder."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def read(self, name: str) -> bytes | None:
        try:
            return (self.root / name).read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            said = error.strerror or error
            raise ToolchainError(f"cannot read {self.root / name}: {said}") from error

    def write(self, name: str, content: bytes) -> None:
        try:
            with writing(self.root / name, "another folder"):
                _replace(self.root / name, content)
        except ToolchainError as error:
            diagnostic = error.diagnostics[0]
            raise ToolchainError(f"{diagnostic.message}; {diagnostic.hint}", RESUME) from error

    def remove(self, name: str) -> None:
        (self.root / name).unlink(missing_ok=True)

    def names(self, below: str) -> list[str]:
        place = self.root / below
        return sorted(entry.name for entry in os.scandir(place)) if place.is_dir() else []

    def sweep(self, below: str) -> None:
        for name in self.names(below):
            if name.startswith(".") and not alive(name.rpartition(".")[2]):
                (self.root / below / name).unlink(missing_ok=True)


def alive(number: str) -> bool:
    """Whether a process of that number runs; who cannot be asked does."""
    try:
        os.kill(int(number), 0)
    except (ProcessLookupError, OverflowError):
        return False
    except (OSError, ValueError):
        return True
    return True


def _replace(place: Path, content: bytes) -> None:
    """A file that is there as a whole or not at all, also after a power cut."""
    draft = place.with_name(f".{place.name}.{os.getpid()}")
    try:
        # Each call to the system gives the interpreter to another thread, and waits to get it back:
        # a file object would make four more of them.
        file = _new(draft)
        try:
            _put(file, content)
            os.fsync(file)
        finally:
            os.close(file)
        os.replace(draft, place)
    except BaseException:
        draft.unlink(missing_ok=True)
        raise


def _new(draft: Path) -> int:
    how = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0)
    try:
        return os.open(draft, how, 0o666)
    except FileNotFoundError:
        draft.parent.mkdir(parents=True, exist_ok=True)
        return os.open(draft, how, 0o666)


def _put(file: int, content: bytes) -> None:
    left = memoryview(content)
    while left:
        left = left[os.write(file, left) :]


# ---- elsewhere


class Remote:
    """An address of fsspec."""

    def __init__(self, address: str, files: Any, root: str, whole: bool) -> None:
        self.address, self.files, self.root, self.whole = address, files, root, whole

    def read(self, name: str) -> bytes | None:
        with _of(self.address):
            try:
                return bytes(self.files.cat_file(f"{self.root}/{name}"))
            except FileNotFoundError:
                return None

    def write(self, name: str, content: bytes) -> None:
        folder, _, last = f"{self.root}/{name}".rpartition("/")
        draft = f"{folder}/{last}" if self.whole else f"{folder}/.{last}.draft"
        with _of(self.address):
            self.files.makedirs(folder, exist_ok=True)
            self.files.pipe_file(draft, content)
            if not self.whole:
                self.files.mv(draft, f"{folder}/{last}")

    def remove(self, name: str) -> None:
        with _of(self.address), contextlib.suppress(FileNotFoundError):
            self.files.rm_file(f"{self.root}/{name}")

    def names(self, below: str) -> list[str]:
        with _of(self.address):
            self.files.invalidate_cache()
            try:
                names = self.files.ls(f"{self.root}/{below}".rstrip("/"), detail=False)
            except FileNotFoundError:
                return []
        return sorted(str(name).rstrip("/").rpartition("/")[2] for name in names)

    def sweep(self, below: str) -> None:
        for name in self.names(below):
            if name.startswith(".") and name.endswith(".draft"):
                self.remove(f"{below}/{name}" if below else name)


@contextlib.contextmanager
def _of(address: str, hint: str = RESUME) -> Iterator[None]:
    """What a library of another place raises, as one line; each has errors of its own."""
    try:
        yield
    except ToolchainError:
        raise
    except Exception as error:  # which classes they are of is known to those libraries alone
        said = " ".join(str(error).split()) or type(error).__name__
        raise ToolchainError(f"cannot use {address}: {said}", hint) from error
