"""Compiles a generated folder: the library lib<name> for any language, and the extension module for
this Python.

Standard library only. In a generated folder this file is build.py: run it on the machine where the
module is to be used. No claim of licence is made on this file: 0BSD, see LICENSE.txt.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import ctypes
import functools
import hashlib
import importlib
import importlib.util
import json
import os
import pathlib
import platform
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from typing import Any

NAME = "snake3"
# No fast-math: it drops NaN and changes what was written. Contraction makes one rounding of a * b +
# c, where the processor can.
FLAGS = ("-std=c99", "-O2", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=fast", "-fPIC")
NATIVE = {"x86_64": "-march=native", "aarch64": "-mcpu=native"}  # this very processor
BATCH = ("-O3",)  # the loops over states become vector instructions
# and so do the sums over stages of an integrator; what -O3 would do besides takes the compiler half
# as long again, and gains nothing
STEPS = (
    "-O3",
    "-fno-inline-functions",
    "-fno-unswitch-loops",
    "-fno-split-loops",
    "-fno-split-paths",
)
# Only gcc knows these. Copies stay vectors: the shorter pieces of a memcpy have to reach the cache
# before they can be read as one. On Zen sums in short vectors are contracted, too: they would be
# rounded otherwise than in lanes.
WHOLE = ("-fno-tree-loop-distribute-patterns",)
CONTRACT = ("--param=avoid-fma-max-bits=0",)  # since gcc 9
# Only gcc knows these: order statements for latency without running out of registers, copy less
# between them, keep numbers out of integer registers.
ORDER = ("-fschedule-insns", "-fsched-pressure", "-frename-registers")
KEEP = {"x86_64": ("-mtune-ctrl=^general_regs_sse_spill,^inter_unit_moves_from_vec",)}
LONG = (
    "-fno-tree-slp-vectorize",
)  # it searches long straight lines at length, and what it joins it has to take apart again
WIDE = "-mprefer-vector-width=512"  # of those as long as there are
# Intel's cores close one of their two units for scalar products as long as a 512-bit instruction is
# under way: two such stores made the dynamics of a Stanford arm take 1.65 times as long
NARROW = "-mprefer-vector-width=256"
# on Zen, lanes so ordered take up to 13 % less than by gcc's own model of it; one state more
TUNE = "-mtune=icelake-server"
INSTALL = (
    "install one (Debian: `apt install gcc`; macOS: `xcode-select --install`; "
    "anywhere: `pip install ziglang`)"
)
FULL = "free some space on the disk of this folder and on that of temporary files"
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
BINARIES = "binaries.json"  # what was compiled here: file name -> SHA-256
RUNTIME = 100_000  # bytes that a simulation includes, all but for the model
ANSWER = 20.0  # s in which a compiler has to say what it is
LEAST = 120.0  # s that it may take for a file, and more for a long one
PER_BYTE = 1e-3  # s; gcc takes some 2e-5
# the compilers under way, and where they work
running: dict[subprocess.Popen[str], pathlib.Path | None] = {}


class CompileError(Exception):
    """The compiler said no. `said` are all its own words, `hint` is what to do about it."""

    def __init__(self, message: str, hint: str = "", said: str = "") -> None:
        super().__init__(message)
        self.hint = hint
        self.said = said


class NoTool(CompileError):
    """What a target is compiled with is not there."""


def find_compiler() -> list[str] | None:
    """The command of the first compiler found: $CC, cc, gcc, clang, then the ziglang package; None
    without one, or where $CC is no command."""
    if os.environ.get("CC", "").strip():
        command = chosen()
        return command if command and shutil.which(command[0]) else None
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    return [sys.executable, "-m", "ziglang", "cc"] if importlib.util.find_spec("ziglang") else None


def chosen() -> list[str]:
    """The command in $CC; none where it cannot be read."""
    try:
        return shlex.split(os.environ["CC"])
    except ValueError:
        return []


def no_compiler() -> tuple[str, str]:
    """Why there is no compiler, and what to do about it."""
    given = os.environ.get("CC", "").strip()
    if given:
        return f"CC is {given!r}, which is no command here: correct it, or unset it", INSTALL
    return "no C compiler found", INSTALL


@functools.cache
def probe(command: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
    """What the compiler says of itself and of this processor: the flags it knows for them, and all
    macros it defines."""
    for flags in choices():
        asked = [*command, *FLAGS, *flags, "-dM", "-E", "-x", "c", os.devnull]
        code, said, _ = ended(asked, None, ANSWER)
        if not code:
            return flags, said
    return (), ""


def choices() -> list[tuple[str, ...]]:
    """Flags to try, the best first."""
    machine = {"amd64": "x86_64"}.get(platform.machine().lower(), platform.machine().lower())
    native = (NATIVE[machine],) if machine in NATIVE and sys.platform != "darwin" else ()
    return [(*native, *ORDER, *KEEP.get(machine, ())), (*native, *ORDER), native, ()]


def identity(command: Sequence[str]) -> str:
    """What else a binary depends on: the compiler, its flags, this processor, this Python and the
    NumPy headers."""
    flags, macros = probe(tuple(command))
    given = (*flags, *FLAGS, *BATCH, *WHOLE, *STEPS, *CONTRACT, *LONG, WIDE, NARROW, TUNE)
    return "\n".join(
        [
            *command,
            macros,
            *given,
            sys.platform,
            sysconfig.get_platform(),
            extension_suffix(),
            *headers(),
        ]
    )


def headers() -> list[str]:
    """Include folders of Python and NumPy; empty where one of them is missing."""
    try:
        numpy = importlib.import_module("numpy")
    except ImportError:
        return []
    folders = [sysconfig.get_paths()["include"], numpy.get_include()]
    wanted = [
        os.path.join(folders[0], "Python.h"),
        os.path.join(folders[1], "numpy", "arrayobject.h"),
    ]
    return folders if all(map(os.path.exists, wanted)) else []


def extension_suffix() -> str:
    """The end of the file name of extension modules, such as .cpython-311-x86_64-linux-gnu.so."""
    return sysconfig.get_config_var("EXT_SUFFIX") or ".so"


def compile_folder(folder: str | os.PathLike[str], name: str, command: Sequence[str]) -> list[str]:
    """Compile in place; the names of the files made. The extension is left out where headers are
    missing."""
    folder = pathlib.Path(folder)
    stems = sources(folder, name)
    includes = headers()
    own = manifest(folder).get("flags", [])
    tasks = [
        [*command, *FLAGS, *flags_of(command, name, stem), *own, "-c", f"{stem}.c"]
        for stem in stems
    ]
    objects = [f"{stem}.o" for stem in stems]
    library = [shared_library(name)]
    links = [[*command, *shared(), *objects, "-lm", "-o", library[0]]]
    if includes:  # the headers of Python and NumPy take longer to read than most sources
        tasks.insert(
            0,
            [*command, *FLAGS, *(f"-I{include}" for include in includes), "-c", f"{name}_module.c"],
        )
        objects.append(f"{name}_module.o")
        library.append(f"_{name}{extension_suffix()}")
        links.append([*command, *shared(), *objects, "-lm", "-o", library[1]])
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        try:
            for stage in (tasks, links):
                list(pool.map(functools.partial(run, folder), stage))
        except BaseException:  # of one compiler, or an interrupt: nobody waits for the others
            stop(folder)
            raise
    missing = [item for item in (*objects, *library) if not (folder / item).is_file()]
    if missing:
        raise CompileError(f"{command[0]} ended without an error, but did not make {missing[0]}")
    for item in objects:
        (folder / item).unlink()
    library += packed(folder)
    record(folder, library)
    return library


SCRIPTS = ("build_fmu.py", "build_fmu2.py", "build_wasm.py")  # with a `main(folder)`


def packed(folder: pathlib.Path) -> list[str]:
    """What the scripts of targets in the folder make of what was compiled."""
    listed = set(manifest(folder)["files"])
    texts: list[str] = []
    for script in (script for script in SCRIPTS if script in listed):
        try:
            texts += runpy.run_path(str(folder / script))["main"](folder)
        except FileNotFoundError as error:
            raise NoTool(str(error), "CC, which is for the module itself, is not asked") from error
        except RuntimeError as error:
            raise CompileError(f"{script}: {first_error(str(error))}", said=str(error)) from error
    return texts


def shared_library(name: str) -> str:
    """The file name of the library for C."""
    return f"lib{name}{SUFFIX}"


def record(folder: pathlib.Path, made: Sequence[str]) -> None:
    """Note what was compiled: hamel looks whether it still is that."""
    known: dict[str, str] = {}
    with contextlib.suppress(OSError, ValueError):
        known = json.loads((folder / BINARIES).read_text(encoding="utf-8"))
    present = {file: value for file, value in known.items() if (folder / file).is_file()}
    new = {file: hashlib.sha256((folder / file).read_bytes()).hexdigest() for file in made}
    text = json.dumps(dict(sorted({**present, **new}.items())), indent=1) + "\n"
    (folder / BINARIES).write_text(text, encoding="utf-8")


def flags_of(command: Sequence[str], name: str, stem: str) -> Sequence[str]:
    """What one file needs besides FLAGS. The one that looks whether the processor fits must run on
    any, and so must one that asks it."""
    if stem in (f"{name}_cpu", f"{name}_fmi", f"{name}_fmi2"):
        return []
    flags, macros = probe(tuple(command))
    broad = "__AVX512F__" in macros
    if stem == f"{name}_batch":
        wide = [WIDE] if broad else []
        tune = [TUNE] if "__znver" in macros and gcc(macros) >= 8 else []
        whole = WHOLE if gcc(macros) else ()
        return [*flags, *BATCH, *whole, *wide, *tune]
    if stem == f"{name}_simulate":
        contract = CONTRACT if gcc(macros) >= 9 else ()
        return [*flags, *(STEPS if gcc(macros) else BATCH), *contract]
    narrow = [NARROW] if broad else []
    if stem == name:
        return [*flags, *narrow]
    return [*flags, *LONG, *narrow]  # a function in a file of its own


def gcc(macros: str) -> int:
    """The version of gcc; 0 of any other compiler."""
    numbers = [
        line.split()[-1] for line in macros.splitlines() if line.startswith("#define __GNUC__ ")
    ]
    return int(numbers[0]) if numbers and "__clang__" not in macros else 0


def manifest(folder: pathlib.Path) -> dict[str, Any]:
    """What hamel said about the module."""
    return json.loads((folder / "manifest.json").read_text(encoding="utf-8"))


def sources(folder: pathlib.Path, name: str) -> list[str]:
    """The C files that make up the library, the longest to compile first; what is in a folder
    below belongs to another compiler."""
    others = {example(name), f"{name}_module.c"}
    listed = [file for file in manifest(folder)["files"] if file.endswith(".c")]
    own = [file for file in listed if "/" not in file and file not in others]
    sizes = {file: (folder / file).stat().st_size for file in own}
    if f"{name}_simulate.c" in sizes:
        sizes[f"{name}_simulate.c"] += RUNTIME
    return [file[:-2] for file in sorted(own, key=lambda file: (-sizes[file], file))]


def example(name: str) -> str:
    """The file name of the example program, which is none of the model's own."""
    return "example.c" if name.lower() != "example" else "example_program.c"


def shared() -> list[str]:
    """Linker options for a shared library that leaves Python's symbols open."""
    return ["-shared", "-undefined", "dynamic_lookup"] if sys.platform == "darwin" else ["-shared"]


def run(folder: pathlib.Path, command: Sequence[str]) -> None:
    """Run a command in the folder; what it prints on failure becomes the error."""
    size = sum((folder / file).stat().st_size for file in command if file.endswith(".c"))
    code, said, errors = ended(command, folder, LEAST + PER_BYTE * size)
    if code:
        said = (errors or said).strip()[-4000:]
        full = "No space left on device" in said
        raise CompileError(
            f"{command[0]} failed with exit code {code}: {first_error(said)}",
            FULL if full else "",
            said,
        )


def first_error(said: str) -> str:
    """The line that says what is wrong; the first one where none does."""
    lines = [" ".join(line.split()) for line in said.splitlines() if line.strip()]
    errors = [line for line in lines if "error" in line.lower() or "fatal" in line.lower()]
    return (errors or lines or ["it said nothing"])[0]


def ended(
    command: Sequence[str], folder: pathlib.Path | None, limit: float
) -> tuple[int, str, str]:
    """Exit code, output and errors of a command; CompileError when it does not start, or takes more
    than `limit` seconds."""
    try:
        process = subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,  # so that all it starts can be ended with it
        )
    except (OSError, ValueError) as error:
        said = getattr(error, "strerror", None) or error
        raise CompileError(f"{command[0]} does not start: {said}", INSTALL) from error
    running[process] = folder
    try:
        said, errors = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        kill(process)
        raise CompileError(
            f"{command[0]} did not end within {limit:.0f} s and was stopped",
            "try it by itself, or name another compiler in CC",
        ) from None
    finally:
        if process.poll() is None:
            kill(process)
        running.pop(process, None)
    return process.returncode, said, errors


def kill(process: subprocess.Popen[str]) -> None:
    """End a command, and all that it started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except (AttributeError, OSError):
        process.kill()
    process.wait()


def stop(folder: pathlib.Path) -> None:
    """End every compiler that works in the folder."""
    for process, place in list(running.items()):
        if place == folder:
            kill(process)


def refusal(folder: pathlib.Path, made: Sequence[str]) -> str:
    """Why this Python cannot load what was compiled here; empty where it can."""
    try:
        library = ctypes.CDLL(str(folder / shared_library(NAME)))
        if not library[f"{NAME}_fits"]():
            return f"{shared_library(NAME)} was compiled for another processor"
        if f"_{NAME}{extension_suffix()}" in made:
            path = folder / f"_{NAME}{extension_suffix()}"
            spec = importlib.util.spec_from_file_location(f"_{NAME}", path)
            assert spec and spec.loader  # as it ends as extensions do
            spec.loader.exec_module(importlib.util.module_from_spec(spec))
    except (OSError, ImportError, AttributeError) as error:
        return " ".join(str(error).split())
    return ""


def main() -> None:
    command = find_compiler()
    if command is None:
        sys.exit(": ".join(no_compiler()))
    folder = pathlib.Path(__file__).resolve().parent
    try:
        made = compile_folder(folder, NAME, command)
    except CompileError as error:
        sys.exit("\n".join(filter(None, (str(error), error.said, error.hint))))
    print("made " + ", ".join(made))
    if why := refusal(folder, made):
        sys.exit(f"but what {shlex.join(command)} made cannot be loaded here: {why}")


if __name__ == "__main__":
    main()
