"""Tuning: what was timed is in the manifest, what was chosen is what gets compiled. No times are
asserted."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import hamel
from codegen import compiler
from codegen.passes import program
from derive.diagnostics import ToolchainError
from hamel.build import tune
from hamel.build.module import published
from tests.scenes import MODELS
from tests.toy import toy

needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(tune, "ROUNDS", 3)


@needs_compiler
def test_flags_that_the_compiler_knows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tune, "FLAGS", ((), ("-O1",), ("--no-such-flag",)))
    tuned = tune.with_fastest_flags(program(toy(), ["dynamics"]), {"before": 7.0})
    assert [name for name, _ in tuned.timings] == ["before", "flags as usual", "flags -O1"]
    assert all(ns > 0 for _, ns in tuned.timings) and tuned.flags in ((), ("-O1",))
    folder = published(tuned, tmp_path / "toy").folder
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["flags"] == list(tuned.flags) and manifest["tuned"] == dict(tuned.timings)


@needs_compiler
def test_flags_of_the_manifest_reach_the_compiler(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    seen: list[list[str]] = []
    run = compiler.run
    monkeypatch.setattr(
        compiler, "run", lambda folder, command: (seen.append(command), run(folder, command))[1]
    )
    published(replace(program(toy(), ["energy"]), flags=("-O1",)), tmp_path / "toy")
    kernels = [command for command in seen if command[-1] in ("toy.c", "toy_simulate.c")]
    assert kernels and all("-O1" in command for command in kernels)


@needs_compiler
def test_a_tuned_build_says_what_it_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tune, "FLAGS", ((), ("-O1",)))
    built = hamel.build(
        MODELS / "pendulum.yaml", out=tmp_path / "pendulum", functions=["dynamics"], tune=True
    )
    assert (
        built.verified
        and "flags as usual" in built.tuned
        and len(built.tuned) >= 3
        and built.size > 1000
    )
    assert json.loads((built.folder / "manifest.json").read_text())["tuned"] == built.tuned


def test_nothing_to_tune_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiler, "find_compiler", lambda: None)
    with pytest.raises(ToolchainError, match="nothing to tune"):
        tune.timings({"toy": program(toy(), ["dynamics"])})


@needs_compiler
def test_models_with_events_are_tuned_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whose code without their functions did not compile."""
    monkeypatch.setattr(tune, "FLAGS", ((), ("-O1",)))
    file = tmp_path / "swing.yaml"
    file.write_text(
        "model: swing\nplane: xy\nbodies: {a: {mass: 1, com: [1, 0]}}\n"
        "joints: {j: {type: revolute, parent: ground, child: a, coordinate: q}}\n"
        "events: {bottom: q}\n"
    )
    assert hamel.build(file, tune=True, out=tmp_path / "swing").tuned


def test_what_is_hardly_faster_is_no_reason_for_another() -> None:
    assert tune._best({"usual": 31.4, "other": 31.0}) == "usual"
    assert tune._best({"usual": 31.4, "other": 25.0, "third": 28.0}) == "other"
