"""Compiling: what works is stored, what does not is refused in one line, whatever a compiler
does."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.emit import emit
from codegen.passes import program
from codegen.program import Program
from derive.diagnostics import ToolchainError, VerificationError
from hamel.build import module
from hamel.build.module import module_in, published
from tests.hamel.build.conftest import needs_compiler
from tests.scenes import derived
from tests.toy import toy

pytestmark = needs_compiler


def leftovers(folder: Path) -> list[str]:
    names = (path.name for path in folder.parent.iterdir())
    return sorted(name for name in names if name not in (folder.name, "cache", "bin"))


def refuse(*_: object) -> None:
    raise AssertionError("the compiler was called")


def test_second_build_needs_no_compiler(
    small: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = published(small, tmp_path / "out" / "toy")
    assert first.compiled and not first.cached and not leftovers(first.folder)
    monkeypatch.setattr(compiler, "run", refuse)
    second = published(small, tmp_path / "out" / "toy")
    assert second.cached and module_in(second.folder).backend == "extension"


def test_harmed_binaries_are_compiled_again(
    small: Program, tmp_path: Path, own_store: Path
) -> None:
    published(small, tmp_path / "toy")
    wanted = module_in(tmp_path / "toy").energy(0.0, [0.1] * 4)
    for binary in own_store.glob("compiled-*/files/*"):
        content = bytearray(binary.read_bytes())
        content[len(content) // 2] ^= 1
        binary.write_bytes(content)
    again = published(small, tmp_path / "toy")
    assert not again.cached
    assert (module_in(again.folder).energy(0.0, [0.1] * 4) == wanted).all()
    assert published(small, tmp_path / "toy").cached


def test_rebuilding_gives_the_new_equations(tmp_path: Path) -> None:
    folder = tmp_path / "toy"
    published(program(toy(), ["energy"]), folder)
    assert module_in(folder).functions == ("energy",)
    published(program(toy(), ["mass"]), folder)
    again = module_in(folder)
    assert again.functions == ("mass",) and again.backend == "extension"


@pytest.mark.parametrize("setting", [("CC", "/nonexistent/cc"), ("CC", "'"), ("PATH", "")])
def test_without_compiler(
    small: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, setting: tuple[str, str]
) -> None:
    monkeypatch.setenv(*setting)
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: None)
    built = published(small, tmp_path / "toy")
    assert not built.compiled and "install" in built.message and "\n" not in built.message
    assert setting[0] != "CC" or repr(setting[1]) in built.message
    with pytest.warns(RuntimeWarning, match="using NumPy.*from an archive, unpack it first"):
        made = module_in(built.folder)
    assert made.backend == "numpy" and made.energy(0.0, [0.0] * 4).shape == (1,)


def test_a_blank_compiler_is_none_named(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = compiler.find_compiler()
    monkeypatch.setenv("CC", "   ")
    assert compiler.find_compiler() == usual


MACROS = 'case "$*" in *-dM*) exec cc "$@" ;; esac'  # it says what it is, as any compiler
OUTPUT = (
    'while [ $# -gt 0 ]; do [ "$1" = -o ] && out=$2; case $1 in *.c) src=$1;; esac; shift; done'
)
FAULTS = {
    "says no": ("echo 'x.c:1: fatal error: no licence for tea' >&2; exit 4", "no licence for tea"),
    "says nothing": ("exit 1", "exit code 1: it said nothing"),
    "makes nothing": ("exit 0", "did not make"),
    "makes junk": (
        f'{MACROS}; {OUTPUT}; echo junk > "${{out:-${{src%.c}}.o}}"',
        "cannot be loaded: .*",
    ),
    "another machine": (
        f'{MACROS}; case "$*" in *-shared*) ;; *) exec cc "$@" ;; esac; cc "$@" && {OUTPUT}'
        ' && printf "\\267" | dd of="$out" bs=1 seek=18 conv=notrunc 2>/dev/null',
        "cannot be loaded: .*",
    ),
    "our line": (
        "echo 'toy.c:7:5: error: cannot convert a value to vector type' >&2; exit 1",
        "toy.c:7:5: error: cannot convert",
    ),
    "disk full": ("echo 'cannot write x.o: No space left on device' >&2; exit 1", "No space left"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_compiler_that_fails_is_refused_in_one_line(
    small: Program, tmp_path: Path, own_store: Path, script, fault: str
) -> None:
    text, said = FAULTS[fault]
    broken = script(text)
    with pytest.raises(ToolchainError, match=said) as error:
        published(small, tmp_path / "out" / "toy", compiler=[broken])
    problem = error.value.diagnostics[0]
    assert error.value.exit_code == 3 and "\n" not in problem.message
    assert ("free some space" in problem.hint) is (fault == "disk full")
    assert ("may be hamel's fault" in problem.hint) is (fault == "our line")
    assert not (tmp_path / "out").exists() and not list(own_store.glob("compiled-*"))
    script('exec cc "$@"')
    assert published(small, tmp_path / "out" / "toy", compiler=[broken]).compiled


def test_what_cannot_be_loaded_is_told_by_its_script(
    small: Program, tmp_path: Path, script, monkeypatch: pytest.MonkeyPatch
) -> None:
    """build.py on the machine where the module is to be used."""
    monkeypatch.setenv("CC", script(FAULTS["another machine"][0]))
    folder = tmp_path / "toy"
    folder.mkdir()
    for name, text in emit(small).items():
        (folder / name).write_text(text)
    command = [sys.executable, "build.py"]
    done = subprocess.run(command, cwd=folder, check=False, capture_output=True, text=True)
    assert done.returncode == 1 and done.stdout.startswith("made libtoy")
    assert "made cannot be loaded here: " in done.stderr and "Traceback" not in done.stderr


def test_numpy_will_do_where_nothing_can_be_loaded(small: Program, script) -> None:
    broken = script(FAULTS["another machine"][0])
    with (
        module.drafted("toy", emit(small), [broken]) as draft,
        module.compiling(draft, numpy=True) as finished,
    ):
        built = finished()
        assert not built.compiled and built.module.backend == "numpy"
        assert "cannot be loaded" in built.message and built.message.endswith("runs on NumPy")
        assert not [name for name in built.files if name.endswith((".so", "binaries.json"))]


def test_junk_would_be_taken_without_the_check(
    small: Program, tmp_path: Path, script, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The test above sees something: without the check the module silently runs on NumPy."""
    monkeypatch.setattr(module, "_checked", lambda draft: module.loaded(draft.folder))
    built = published(small, tmp_path / "toy", compiler=[script(FAULTS["makes junk"][0])])
    assert built.compiled
    with pytest.warns(RuntimeWarning, match="using NumPy"):
        assert loader.load(built.folder).backend == "numpy"


@pytest.mark.parametrize("at", ["probe", "compile"])
def test_a_hanging_compiler_ends(
    small: Program, tmp_path: Path, script, monkeypatch: pytest.MonkeyPatch, at: str
) -> None:
    monkeypatch.setattr(compiler, "ANSWER" if at == "probe" else "LEAST", 0.5)
    monkeypatch.setattr(compiler, "PER_BYTE", 0.0)
    mark = f"{tmp_path.name}.sleeps"
    hanging = script(f"{MACROS if at == 'compile' else ''}\nsleep 987 # {mark}\n")
    start = time.monotonic()
    with pytest.raises(ToolchainError, match=r"did not end within \d+ s"):
        published(small, tmp_path / "toy", compiler=[hanging])
    assert time.monotonic() - start < 60
    assert not (tmp_path / "toy").exists() and not compiler.running


def test_failed_build_keeps_the_old_folder(small: Program, tmp_path: Path) -> None:
    folder = published(small, tmp_path / "toy").folder
    with pytest.raises(ToolchainError):
        published(program(toy()), folder, compiler=["false"])
    assert module_in(folder).functions == ("dynamics", "energy")


def test_builds_side_by_side(small: Program, tmp_path: Path) -> None:
    folder = tmp_path / "out" / "toy"
    with ThreadPoolExecutor(4) as pool:
        built = list(pool.map(lambda _: published(small, folder), range(6)))
    assert all(b.compiled for b in built) and not leftovers(folder)
    check = "import sys; sys.path.insert(0, sys.argv[1]); import toy; print(toy.backend)"
    shown = subprocess.run(
        [sys.executable, "-c", check, str(folder.parent)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert shown.stdout.strip() == "extension"


def test_useless_store_only_costs_time(
    small: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert published(small, tmp_path / "toy").compiled


def test_the_module_is_checked_when_it_is_loaded(small: Program, tmp_path: Path) -> None:
    folder = published(small, tmp_path / "toy").folder
    library = folder / compiler.shared_library("toy")
    library.write_bytes(library.read_bytes() + b"x")
    with pytest.raises(VerificationError, match="was changed"):
        module_in(folder)


def test_build_py_compiles_what_can_be_checked(small: Program, tmp_path: Path) -> None:
    """What its own script compiled belongs to the module."""
    folder = published(small, tmp_path / "toy").folder
    for name in json.loads((folder / compiler.BINARIES).read_text()):
        os.unlink(folder / name)
    subprocess.run([sys.executable, "build.py"], cwd=folder, check=True, capture_output=True)
    assert module_in(folder).backend == "extension"


@pytest.mark.slow
@needs_compiler
def test_a_module_knows_where_the_file_begins(tmp_path: Path) -> None:
    """With the constraints met; nothing where the equations are of no model."""
    four_bar = loader.load(published(program(derived("four_bar")), tmp_path / "four_bar").folder)
    assert four_bar.initial[0] == pytest.approx(np.pi / 3, rel=1e-11)
    assert np.abs(four_bar.constraints(0.0, four_bar.initial, [0.0])).max() < 1e-11
    with pytest.raises(ValueError, match="read-only"):
        four_bar.initial[0] = 0.0
    alone = loader.load(published(program(toy()), tmp_path / "toy").folder)
    assert alone.initial is None
