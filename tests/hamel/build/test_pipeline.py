"""The pipeline: stages in the log, names that clash, what is stored, and the shipped module
verified by itself.

Of hamel.build: clock, files, limits.
"""

from __future__ import annotations

import json
import logging
import os
import py_compile
import signal
import subprocess
import sys
import time
import typing
from dataclasses import fields, replace
from pathlib import Path

import pytest

import hamel
from codegen import emit
from codegen.passes import program
from derive.diagnostics import Diagnostic, ModelError, ToolchainError, VerificationError
from derive.model import load
from hamel import failures
from hamel.build import folder, keys, pipeline, store
from hamel.build.options import BuildOptions
from tests.hamel.build.conftest import needs_compiler
from tests.scenes import MODELS
from tests.toy import toy

ROOT = Path(__file__).parents[3]
PENDULUM = ROOT / "models" / "pendulum.yaml"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A module that was built and verified."""
    place = tmp_path_factory.mktemp("built") / "pendulum"
    pipeline.build(PENDULUM, place)
    return place


@pytest.fixture
def copied(built: Path, tmp_path: Path) -> Path:
    files = {path.name: path.read_bytes() for path in built.iterdir() if path.is_file()}
    folder.publish(tmp_path / "pendulum", files)
    return tmp_path / "pendulum"


@needs_compiler
def test_every_stage_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "hamel"):
        record = hamel.build(PENDULUM, out=tmp_path / "pendulum")
    stages = [line.split()[0] for line in caplog.messages]
    assert set(stages) == set(record.seconds) and stages[-1] == "publish"
    assert {"model", "mechanics", "formulation", "passes", "code", "compile", "verify"} <= {*stages}
    assert all(line.endswith(" s") and "→" in line for line in caplog.messages)


@needs_compiler
def test_a_stored_module_is_checked(tmp_path: Path, own_store: Path) -> None:
    """One changed byte in the store, and the module is built again."""
    first = hamel.build(PENDULUM, out=tmp_path / "pendulum")
    again = hamel.build(PENDULUM, out=tmp_path / "pendulum")
    assert again.kept and not first.kept
    library = next(own_store.glob("built-*/files/lib*"))
    content = bytearray(library.read_bytes())
    content[len(content) // 2] ^= 1
    library.write_bytes(content)
    assert not hamel.build(PENDULUM, out=tmp_path / "pendulum").kept
    hamel.load(tmp_path / "pendulum")


def test_options_tell_builds_apart() -> None:
    usual = BuildOptions()
    seen = {keys.file_key(PENDULUM, usual.said())}
    other = {
        "choice": "a", "constants": "all", "functions": ("dynamics",), "formulation": "maggi",
        "integrators": ("rk4",), "numpy": True, "tune": True, "header": True, "fix": {"g": 1.0},
        "real": "float32", "states": 3, "targets": ("casadi",), "roll": "never",
    }  # fmt: skip
    assert set(other) == {option.name for option in fields(BuildOptions)}
    for name, value in other.items():
        seen.add(keys.file_key(PENDULUM, replace(usual, **{name: value}).said()))
    assert len(seen) == len(other) + 1 and None not in seen


@needs_compiler
def test_the_shipped_module_is_verified(copied: Path) -> None:
    found = hamel.verify(copied)
    assert found.passed and len(found.checks) == 4
    assert {check.name for check in found.checks} >= {
        "shipped: extension = shipped values",
        "shipped: ctypes = shipped values",
        "shipped: NumPy = shipped values",
    }


@needs_compiler
def test_a_module_of_few_functions_is_verified_by_these(tmp_path: Path) -> None:
    hamel.build(PENDULUM, out=tmp_path / "few", functions=["dynamics", "energy"])
    found = hamel.verify(tmp_path / "few")
    assert found.passed and len(found.checks) == 4
    functions = json.loads((tmp_path / "few/verification.json").read_text())["functions"]
    assert {"dynamics", "energy"} <= set(functions) and "reactions" not in functions


@needs_compiler
def test_spoiled_byte_code_beside_a_module_is_told(copied: Path) -> None:
    """Python reads what it keeps beside a module without a check; a missing end was taken for an
    interrupt."""
    for name in ("__init__", "_numpy"):
        path = Path(str(py_compile.compile(str(copied / f"{name}.py"))))
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(ToolchainError, match="cannot be imported") as told:
            hamel.verify(copied)
        assert "__pycache__" in str(told.value)
        path.write_bytes(whole)
    assert hamel.verify(copied).passed


@needs_compiler
def test_a_wrong_module_with_a_right_manifest_is_seen(copied: Path) -> None:
    """Somebody changes a number and all hashes with it: the values say no."""
    text = (copied / "_numpy.py").read_text()
    (copied / "_numpy.py").write_text(text.replace(" * z1\n", " * z1 * 1.00001\n"))
    assert " * z1\n" in text
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["files"]["_numpy.py"] = folder.hashlib.sha256(
        (copied / "_numpy.py").read_bytes()
    ).hexdigest()
    manifest["seal"] = folder.manifest_seal(manifest)
    (copied / "manifest.json").write_text(json.dumps(manifest))
    found = hamel.verify(copied)
    failed = [check.name for check in found.checks if not check.passed]
    assert failed == ["shipped: NumPy = shipped values"]


@needs_compiler
def test_a_changed_file_fails_verify_and_load(copied: Path) -> None:
    (copied / "pendulum.h").write_text("")
    found = hamel.verify(copied)
    assert not found.passed and "pendulum.h was changed" in found.checks[0].name
    with pytest.raises(VerificationError, match=r"pendulum\.h was changed"):
        hamel.load(copied)
    with pytest.raises(ModelError, match="choice is for model files"):
        hamel.verify(copied, choice="a")


NAMES = ("example", "manifest", "build", "math", "string", "main", "Example", "int", "lib", "init")


@pytest.mark.parametrize("name", NAMES)
def test_no_two_files_of_one_name(name: str) -> None:
    files = emit.emit(program(toy(name), ["energy"]))
    assert len({file.lower() for file in files}) == len(files)
    assert sum("int main(" in text for text in files.values()) == 1


@pytest.mark.parametrize("name", ["numpy", "library", "shared", "simulate", "Simulate"])
def test_names_that_clash_are_refused(name: str) -> None:
    with pytest.raises(ModelError, match="cannot be called"):
        emit.emit(program(toy(name), ["dynamics"]))


@needs_compiler
def test_a_model_called_example(tmp_path: Path) -> None:
    text = PENDULUM.read_text().replace("model: pendulum", "model: example")
    (tmp_path / "example.yaml").write_text(text)
    place = hamel.build(tmp_path / "example.yaml", out=tmp_path / "example").folder
    assert hamel.load(place).backend == "extension" and hamel.verify(place).passed


def test_hints_of_types_resolve() -> None:
    for name in hamel.__all__:
        function = getattr(hamel, name)
        if not isinstance(function, type):
            assert "return" in typing.get_type_hints(function)


def test_a_message_is_one_line() -> None:
    problem = Diagnostic(file="a\nb.yaml", message="one\ntwo \x1b[31m", hint="three\nfour")
    assert str(problem).count("\n") == 1 and "\x1b" not in str(problem)


def test_simulate_runs_nothing_that_build_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assurance = sys.modules["hamel.build.assurance"]
    calls = []
    usual = assurance.quick_verification

    def planted(model, equations, module, states, functions=None):
        calls.append(model.name)
        found = usual(model, equations, module, states, functions=functions)
        wrong = replace(found.checks[0], passed=False)
        return replace(found, checks=(wrong, *found.checks[1:]))

    with monkeypatch.context() as patch:
        patch.setattr(assurance, "quick_verification", planted)
        with pytest.raises(VerificationError, match="nothing is simulated"):
            hamel.simulate(PENDULUM, time=0.01)
    hamel.simulate(PENDULUM, time=0.01)
    monkeypatch.setattr(assurance, "quick_verification", planted)
    hamel.simulate(PENDULUM, time=0.01, values={load(PENDULUM).parameters[0].name: 1.1})
    assert calls == ["pendulum"]  # it costs once
    assert store.root() is not None


def test_a_choice_that_fails_on_the_way_is_not_verified(monkeypatch: pytest.MonkeyPatch) -> None:
    """What goes on in charts is verified with all of them."""
    assurance = sys.modules["hamel.build.assurance"]
    seen = []
    usual = assurance.check_all

    def noted(equations, *others):
        seen.append(len(equations.charts))
        return usual(equations, *others)

    monkeypatch.setattr(assurance, "check_all", noted)
    assert hamel.simulate(MODELS / "four_bar.yaml", choice="rocker", time=0.6).switches
    assert len(seen) == 1 and seen[0] > 0  # charts beside it


MACROS = """
model: macros
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {PART: 1 m, WHOLE: 1 kg, RARE: 0.1 kg*m^2, FAR: 1 N*s*m, ALIGNED: 0.3 N*m, SIZE_MAX: 1 N*m}
inputs: {INLINE: {unit: N*m}, SEPARATE: {unit: N*m}}
bodies:
  a: {mass: WHOLE, com: [PART/2, 0], inertia: RARE}
  b: {mass: WHOLE, com: [PART/2, 0], inertia: RARE}
joints:
  h: {type: revolute, parent: ground, child: a, coordinate: look}
  g: {type: revolute, parent: a, child: b, at: [PART, 0], coordinate: take}
loads:
  m: {type: expression, joint: h, expression: INLINE - FAR*der(look) + ALIGNED*sin(look)}
  l: {type: expression, joint: g, expression: SEPARATE + SIZE_MAX*cos(take)}
"""


@needs_compiler
def test_names_of_a_model_may_be_those_of_macros(tmp_path: Path) -> None:
    file = tmp_path / "macros.yaml"
    file.write_text(MACROS, encoding="utf-8")
    assert hamel.build(file, out=tmp_path / "macros").verified


STARTED = (
    "import sys; print('.', flush=True); sys.argv = ['hamel', 'build', sys.argv[1]];"
    "from hamel.__main__ import main; main()"
)


def test_an_interrupt_before_the_command_is_told_like_any_other(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What prepares for it compiles a pattern, in which an interrupt once was a traceback."""

    def interrupted(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(failures.warnings, "filterwarnings", interrupted)
    assert failures.guarded(lambda: 0, []) == failures.INTERRUPTED
    assert capsys.readouterr().err == "error: interrupted\n"


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("seconds", [0.05, 0.1, 0.15, 0.2, 0.3, 0.6])
def test_an_interrupt_is_quiet_from_the_start(tmp_path: Path, seconds: float) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", STARTED, str(PENDULUM)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    process.stdout.read(1)  # Python itself has started
    time.sleep(seconds)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=120)
    assert said.strip() in ("error: interrupted", "") and process.returncode in (130, 0)
    assert not [name for name in os.listdir(tmp_path) if name.startswith(".")]
