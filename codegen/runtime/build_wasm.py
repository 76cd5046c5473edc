"""Compiles a generated folder into wasm/NAME.wasm, and wasm/NAME_simd.wasm with instructions for
several numbers at a time.

Standard library only. build.py runs this file in a generated folder. clang with wasi-libc does it,
or the ziglang package; emscripten is not needed. No claim of licence is made on this file: 0BSD,
see LICENSE.txt.
"""

from __future__ import annotations

import concurrent.futures
import functools
import importlib.util
import json
import pathlib
import shutil
import subprocess
import sys
from typing import Any

NAME = ""
INSTALL = (
    "install one (Debian: apt install clang lld wasi-libc libclang-rt-14-dev-wasm32; anywhere: "
    "pip install ziglang)"
)
# as for the module itself: no fast-math, nothing that changes what was written
FLAGS = ["-std=c99", "-O2", "-fno-math-errno", "-fno-trapping-math", "-I."]
STACK = 8 << 20  # bytes, below all data: what overflows it traps
LINK = ["-mexec-model=reactor", "-Wl,--strip-all", f"-Wl,-z,stack-size={STACK}"]
EXPORTS = ["-Wl,--export=__heap_base"]
STACK_FIRST = ["-Wl,--stack-first"]  # zig does not know it
VARIANTS = {"": [], "_simd": ["-msimd128"]}
EXAMPLES = ("example.c", "example_program.c")
PROBE = "#include <math.h>\ndouble f(double x);\ndouble f(double x) { return sin(x); }\n"


def main(folder: pathlib.Path) -> list[str]:
    """Writes both modules into the folder `wasm`; the names of the files made. FileNotFoundError
    without a compiler, RuntimeError where it fails."""
    command = find_compiler()
    if command is None:
        raise FileNotFoundError(f"no compiler for WebAssembly: {INSTALL}")
    first = [] if "ziglang" in command else STACK_FIRST
    names = sources(json.loads((folder / "manifest.json").read_text(encoding="utf-8")))
    outputs = {f"wasm/{NAME}{end}.wasm": flags for end, flags in VARIANTS.items()}
    tasks = [
        [*command, *FLAGS, *flags, *LINK, *EXPORTS, *first, *names, "-lm", "-o", out]
        for out, flags in outputs.items()
    ]
    with concurrent.futures.ThreadPoolExecutor(len(tasks)) as pool:
        for done in pool.map(functools.partial(run, folder), tasks):
            if done.returncode:
                raise RuntimeError(f"{done.args[0]} failed: {done.stderr[-4000:]}")
    return list(outputs)


def run(folder: pathlib.Path, task: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(task, check=False, cwd=folder, capture_output=True, text=True)


def sources(manifest: dict[str, Any]) -> list[str]:
    """All C of the module but for Python's, the examples and other targets."""
    targets = {name: target["files"] for name, target in manifest["targets"].items()}
    own = [file for file in targets.pop("wasm") if file.endswith(".c")]
    others = {f"{NAME}_module.c", *(file for files in targets.values() for file in files)}
    listed = [file for file in sorted(manifest["files"]) if file.endswith(".c")]
    return [*(x for x in listed if "/" not in x and x not in others and not example(x)), *own]


def example(file: str) -> bool:
    """Whether this is the program that shows how the module is used."""
    return file == EXAMPLES[NAME.lower() == "example"]


def find_compiler() -> list[str] | None:
    """clang where it comes with a C library for WebAssembly, else the ziglang package."""
    clang = ["clang", "--target=wasm32-wasi"]
    if shutil.which("clang") and links(clang):
        return clang
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc", "-target", "wasm32-wasi"]
    return None


def links(command: list[str]) -> bool:
    """Whether a program of one line can be compiled and linked."""
    task = [*command, *LINK, "-x", "c", "-", "-lm", "-o", "-"]
    done = subprocess.run(task, check=False, input=PROBE.encode(), capture_output=True)
    return done.returncode == 0


if __name__ == "__main__":
    print("made " + ", ".join(main(pathlib.Path(__file__).resolve().parent)))
