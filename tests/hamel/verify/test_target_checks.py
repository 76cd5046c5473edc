"""Targets whose tools are Python packages agree with a module at random states, by their own checks.

Of hamel.verify.targets: records.
"""

from __future__ import annotations

import importlib.util

import pytest

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
