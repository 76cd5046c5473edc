"""The runtime is plain C: it compiles on its own with gcc and clang without warnings, and its unit
tests in C hold."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from codegen.targets.simulate import RUNTIME

HERE = Path(__file__).parent
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror")


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_units(compiler: str, tmp_path: Path) -> None:
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is not installed: the runtime was not compiled with it")
    places = (f"-I{RUNTIME[0].parent}", f"-I{HERE}")
    source, program = HERE / "test_runtime.c", tmp_path / "units"
    command = [compiler, *STRICT, *places, str(source), "-lm", "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    run = subprocess.run([program], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout


def test_nothing_in_it_depends_on_a_model() -> None:
    """No template, and every function is static, OWN ones too."""
    for path in RUNTIME:
        text = path.read_text("utf-8")
        assert "{{" not in text and "{%" not in text, path.name
        starts = [line for line in text.splitlines() if line.endswith(")") and line[0].isalpha()]
        assert all(line.startswith(("static ", "OWN ")) for line in starts), path.name
