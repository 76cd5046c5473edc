"""Compiles a generated folder: the library lib<name> for any language, and the extension module for
this Python.

Standard library only. In a generated folder this file is build.py: run it on the machine where the
module is to be used. No claim of licence is made on this file: 0BSD, see LICENSE.txt.
"""

import concurrent.futures
import functools
import importlib.util
import json
import os
import pathlib
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig

NAME = "four_bar"
# No fast-math: it drops NaN and changes what was written. Contraction makes one rounding of a * b +
# c, where the processor can.
FLAGS = ("-std=c99", "-O2", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=fast", "-fPIC")
NATIVE = {"x86_64": "-march=native", "aarch64": "-mcpu=native"}  # this very processor
BATCH = ("-O3",)  # the loops over states become vector instructions
STEPS = ("-O3",)  # and so do the sums over stages of an integrator
# Only gcc knows these: order statements for latency without running out of registers, copy less
# between them, keep numbers out of integer registers.
ORDER = ("-fschedule-insns", "-fsched-pressure", "-frename-registers")
KEEP = {"x86_64": ("-mtune-ctrl=^general_regs_sse_spill,^inter_unit_moves_from_vec",)}
LONG = (
    "-fno-tree-slp-vectorize",
)  # it searches long straight lines at length, and what it joins it has to take apart again
WIDE = "-mprefer-vector-width=512"  # of those as long as there are
# on Zen, lanes so ordered take up to 13 % less than by gcc's own model of it; one state more
TUNE = "-mtune=icelake-server"
INSTALL = "install one (Debian: `apt install gcc`; macOS: `xcode-select --install`; anywhere: `pip install ziglang`)"
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


class CompileError(Exception):
    """The compiler said no; its own words are in the message."""


def find_compiler():
    """The command of the first compiler found: $CC, cc, gcc, clang, then the ziglang package; None
    without one."""
    if os.environ.get("CC"):
        command = shlex.split(os.environ["CC"])
        return command if shutil.which(command[0]) else None
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    return [sys.executable, "-m", "ziglang", "cc"] if importlib.util.find_spec("ziglang") else None


@functools.cache
def probe(command):
    """What the compiler says of itself and of this processor: the flags it knows for them, and all
    macros it defines."""
    for flags in choices():
        asked = [*command, *FLAGS, *flags, "-dM", "-E", "-x", "c", os.devnull]
        answer = subprocess.run(
            asked, capture_output=True, text=True, errors="replace", check=False
        )
        if not answer.returncode:
            return flags, answer.stdout
    return (), ""


def choices():
    """Flags to try, the best first."""
    machine = {"amd64": "x86_64"}.get(platform.machine().lower(), platform.machine().lower())
    native = (NATIVE[machine],) if machine in NATIVE and sys.platform != "darwin" else ()
    return [(*native, *ORDER, *KEEP.get(machine, ())), (*native, *ORDER), native, ()]


def identity(command):
    """What else a binary depends on: the compiler, its flags, this processor, this Python and the
    NumPy headers."""
    flags, macros = probe(tuple(command))
    given = (*flags, *FLAGS, *BATCH, *LONG, WIDE, TUNE)
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


def headers():
    """Include folders of Python and NumPy; empty where one of them is missing."""
    try:
        import numpy
    except ImportError:
        return []
    folders = [sysconfig.get_paths()["include"], numpy.get_include()]
    wanted = [
        os.path.join(folders[0], "Python.h"),
        os.path.join(folders[1], "numpy", "arrayobject.h"),
    ]
    return folders if all(map(os.path.exists, wanted)) else []


def extension_suffix():
    """The end of the file name of extension modules, such as .cpython-311-x86_64-linux-gnu.so."""
    return sysconfig.get_config_var("EXT_SUFFIX") or ".so"


def compile_folder(folder, name, command):
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
    made = [f"lib{name}{SUFFIX}"]
    links = [[*command, *shared(), *objects, "-lm", "-o", made[0]]]
    if includes:  # the headers of Python and NumPy take longer to read than most sources
        tasks.insert(
            0,
            [*command, *FLAGS, *(f"-I{include}" for include in includes), "-c", f"{name}_module.c"],
        )
        objects.append(f"{name}_module.o")
        made.append(f"_{name}{extension_suffix()}")
        links.append([*command, *shared(), *objects, "-lm", "-o", made[1]])
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        for stage in (tasks, links):
            list(pool.map(lambda task: run(folder, task), stage))
    for item in objects:
        (folder / item).unlink()
    return made


def flags_of(command, name, stem):
    """What one file needs besides FLAGS. The one that looks whether the processor fits must run on
    any."""
    if stem == f"{name}_cpu":
        return []
    flags, macros = probe(tuple(command))
    if stem == f"{name}_batch":
        wide = [WIDE] if "__AVX512F__" in macros else []
        tune = [TUNE] if "__znver" in macros and gcc(macros) >= 8 else []
        return [*flags, *BATCH, *wide, *tune]
    if stem == f"{name}_simulate":
        return [*flags, *STEPS]
    if stem == name:
        return flags
    return [*flags, *LONG]  # a function in a file of its own


def gcc(macros):
    """The version of gcc; 0 of any other compiler."""
    numbers = [
        line.split()[-1] for line in macros.splitlines() if line.startswith("#define __GNUC__ ")
    ]
    return int(numbers[0]) if numbers and "__clang__" not in macros else 0


def manifest(folder):
    """What hamel said about the module."""
    return json.loads((folder / "manifest.json").read_text(encoding="utf-8"))


def sources(folder, name):
    """The C files that make up the library, the longest first."""
    others = {"example.c", f"{name}_module.c"}
    found = [
        file for file in manifest(folder)["files"] if file.endswith(".c") and file not in others
    ]
    return [
        file[:-2]
        for file in sorted(found, key=lambda file: (-(folder / file).stat().st_size, file))
    ]


def shared():
    """Linker options for a shared library that leaves Python's symbols open."""
    return ["-shared", "-undefined", "dynamic_lookup"] if sys.platform == "darwin" else ["-shared"]


def run(folder, command):
    """Run a command in the folder; what it prints on failure becomes the error."""
    try:
        result = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace", check=False
        )
    except OSError as error:
        raise CompileError(f"{command[0]} does not start: {error}") from error
    if result.returncode:
        said = (result.stderr or result.stdout).strip()[-4000:]
        raise CompileError(
            f"{' '.join(command[:1])} failed with exit code {result.returncode}:\n{said}"
        )


def main():
    command = find_compiler()
    if command is None:
        sys.exit(f"no C compiler found: {INSTALL}")
    try:
        made = compile_folder(pathlib.Path(__file__).resolve().parent, NAME, command)
    except CompileError as error:
        sys.exit(str(error))
    print("made " + ", ".join(made))


if __name__ == "__main__":
    main()
