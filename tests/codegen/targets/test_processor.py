"""NAME_cpu.c finds what the processor has, whatever compiles it."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from codegen.emit import emit
from codegen.passes import program
from codegen.targets.c import FEATURES
from tests.toy import toy

COMPILERS = {
    "gcc": ["gcc"],
    "clang": ["clang"],
    "zig": [sys.executable, "-m", "ziglang", "cc"],
}
NAMES = {"bmi": "bmi1"}  # what Linux calls them
INFO = Path("/proc/cpuinfo")
MAIN = """
    extern unsigned toy_needs;
    unsigned toy_needs;
    int toy_fits(void);
    int printf(const char *, ...);
    int main(void)
    {
        for (toy_needs = 1; toy_needs < 1u << %d; toy_needs *= 2)
            printf("%%d ", toy_fits());
        return 0;
    }
"""


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_processor_has_what_the_system_says(compiler: str, tmp_path: Path) -> None:
    command = COMPILERS[compiler]
    if not (
        shutil.which(command[0]) and (compiler != "zig" or importlib.util.find_spec("ziglang"))
    ):
        pytest.skip(f"{compiler} is not installed")
    if not INFO.is_file() or "\nflags" not in INFO.read_text():
        pytest.skip("the system does not list the flags of an x86 processor")
    texts = emit(program(toy(), ["energy"]))
    for name in ("toy.h", "toy_cpu.c"):
        (tmp_path / name).write_text(texts[name])
    (tmp_path / "main.c").write_text(MAIN % len(FEATURES))
    call = [*command, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2"]
    subprocess.run([*call, "toy_cpu.c", "main.c", "-o", "main"], cwd=tmp_path, check=True)
    found = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True)
    lines = INFO.read_text().splitlines()
    flags = next(line for line in lines if line.startswith("flags")).split()
    has = {name: NAMES.get(name, name) in flags for name in FEATURES}
    assert dict(zip(FEATURES, map(int, found.stdout.split()), strict=True)) == has
