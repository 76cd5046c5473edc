"""Targets whose tools are Python packages agree with a module at random states, by their own checks.

Of hamel.verify.targets: records.
"""

from __future__ import annotations

import importlib.util

import pytest

import hamel
from codegen.compiler import find_compiler
from hamel.build.targets import target_checks
from hamel.verify.targets import Subject
from tests.subjects import subject

PACKAGES = {"casadi": "casadi", "fmu": "fmpy", "fmu2": "fmpy", "numba": "numba", "jax": "jax"}

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def cart_pole(tmp_path_factory) -> Subject:
    base = tmp_path_factory.mktemp("checked")
    targets = [name for name, package in PACKAGES.items() if importlib.util.find_spec(package)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "cart_pole", targets, ("dynamics", "energy"))


@pytest.mark.parametrize("target", PACKAGES)
def test_what_a_python_package_carries_is_checked(cart_pole, target):
    pytest.importorskip(PACKAGES[target])
    (check,) = target_checks([target])
    results = list(check.run(cart_pole))
    assert len(results) >= 2
    assert [result.name for result in results if not result.passed] == []


POWER = """
model: powered
plane: xy
parameters: {power: 2 N*m}
bodies: {B: {mass: 1 kg, inertia: 0.1 kg*m^2}}
joints: {J: {type: revolute, parent: ground, child: B, coordinate: q}}
loads: {L: {type: expression, joint: J, expression: power}}
"""


@pytest.mark.parametrize("target", ["fmu", "fmu2"])
def test_a_parameter_may_have_the_name_of_a_result(target, tmp_path, monkeypatch):
    """The variable of the power is then called `power (2)`."""
    pytest.importorskip("fmpy")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    file = tmp_path / "powered.yaml"
    file.write_text(POWER)
    built = hamel.build(
        file, out=tmp_path / "powered", targets=[target], functions=["dynamics", "power"]
    )
    assert "values" in built.targets[target]
