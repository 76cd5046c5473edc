"""What the module does with NaN, ±Inf, denormals and huge numbers in any argument: the graph's own
result, or a refusal.

A number that comes out must be the one the graph gives; nothing that is no number may come out at
all.
"""

import importlib

import pytest

from derive.formulations import equations
from derive.model import load
from derive.states import system
from hamel.build.module import temporary_module
from hamel.verify.checks.strange import complaints
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence
from tests.scenes import MODELS

QUICK = ("four_bar", "free_body")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(path.stem, marks=() if path.stem in QUICK else pytest.mark.slow)
        for path in sorted(MODELS.glob("*.yaml"))
    ],
)
def test_what_comes_out_is_right_or_nothing_comes_out(name):
    model = load(MODELS / f"{name}.yaml")
    chosen = equations(system(model))
    with temporary_module(chosen) as module:
        seen = evidence(reference(model), chosen, module, 1)
        for backend in (module, importlib.import_module(f"{module.__name__}._numpy")):
            assert list(complaints(seen, backend)) == []
