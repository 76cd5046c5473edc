"""Targets on request through the front door: what a build writes of them, what it does where one
disagrees or its tool is missing, and `verify --target`.

Of hamel.build: targets.
Of hamel.verify.targets: records.
"""

import json
from dataclasses import replace

import pytest

import hamel
from codegen.compiler import find_compiler
from codegen.passes import program
from derive.diagnostics import HamelError, ToolchainError, VerificationError
from hamel.build import targets
from hamel.verify import CheckResult
from hamel.verify.targets import TargetCheck
from tests.scenes import MODELS
from tests.toy import toy

MADE = replace(program(toy()), targets=("casadi",))


def outcome(passed):
    return lambda subject: (CheckResult("values", 2.0, 1.0, passed, "what it says"),)


def missing(subject):
    """As a generator, which says so when it is asked for its first result."""
    yield from ()
    raise ToolchainError("it is not there", "pip install it")


def checked(monkeypatch, run):
    monkeypatch.setattr(targets, "TARGET_CHECKS", (TargetCheck("casadi", "its tool", run),))
    subject = targets.Subject("toy", MODELS, pytest, {})
    return targets.checked_targets(MADE, subject)


def test_how_a_target_was_verified_is_said(monkeypatch):
    assert checked(monkeypatch, outcome(True)) == {"casadi": "by its tool: values"}


def test_a_target_that_disagrees_ends_the_build(monkeypatch):
    with pytest.raises(VerificationError, match="disagrees with the module, nothing is written"):
        checked(monkeypatch, outcome(False))


def test_a_missing_tool_is_warned_of_and_said(monkeypatch):
    """The one that is missing: with Octave there and no mkoctfile, it said "for want of Octave"."""
    with pytest.warns(RuntimeWarning, match="pip install it"):
        said = checked(monkeypatch, missing)
    assert said == {"casadi": "not checked: it is not there"}


def test_a_name_that_is_no_target_is_refused_with_the_nearest(tmp_path):
    for verb in (hamel.build, hamel.verify):
        with pytest.raises(HamelError, match="casadi"):
            verb(MODELS / "cart_pole.yaml", targets=["casady"])


@pytest.mark.slow
@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_a_build_with_targets_and_their_verification(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "cart_pole"
    built = hamel.build(MODELS / "cart_pole.yaml", out=folder, targets="casadi,cpp")
    said = json.loads((folder / "manifest.json").read_text("utf-8"))["targets"]
    assert {name: how["verified"] for name, how in said.items()} == dict(built.targets)
    assert all(how["verified"].startswith("by ") for how in said.values())
    assert hamel.verify(folder).passed  # every file is known to the manifest
    again = hamel.build(MODELS / "cart_pole.yaml", out=folder, targets="casadi,cpp")
    assert again.kept and dict(again.targets) == dict(built.targets)
    plain = hamel.build(MODELS / "cart_pole.yaml", out=folder)
    assert not plain.targets and not (folder / "README.md").exists()
    found = hamel.verify(MODELS / "cart_pole.yaml", targets="casadi", states=5)
    assert found.passed and {line.name.split(":")[0] for line in found.checks} == {"casadi"}
