"""Other people's engines: where one is installed its check is green on what it knows, red on what
is wrong, silent on the rest.

Of hamel.verify.reference: engines.
Of hamel.verify.reference.engines: exudyn, mujoco, pinocchio, records.
"""

import importlib.util
from dataclasses import replace

import casadi as ca
import pytest

from derive.formulations import equations
from derive.model import load, load_text
from derive.states import system
from hamel.verify.checks import CHECKS, engines
from hamel.verify.checks.samples import terms
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence
from tests.scenes import MODELS
from tests.texts import ARM

FITS = {
    "Pinocchio": ("stanford_arm", "free_body", "extremes/heavy_top", "cart_pole"),
    "MuJoCo": ("stanford_arm", "four_bar", "planar_3r"),
    "Exudyn": ("four_bar", "rolling_disk", "slider_crank", "bicycle"),
}
PAIRS = [(engine, name) for engine, names in FITS.items() for name in names]


def check(name):
    return next(check for check in CHECKS if check.name == name)


def seen_of(model):
    return evidence(reference(model), equations(system(model)), None, 5)


def needs(engine):
    if importlib.util.find_spec(engine.lower()) is None:
        pytest.skip(f"{engine} is not installed")


@pytest.mark.parametrize("engine, name", PAIRS)
def test_engines_agree(engine, name):
    needs(engine)
    error = check(engine).error(seen_of(load(MODELS / f"{name}.yaml")))
    assert error is not None and error <= check(engine).tolerance


@pytest.mark.parametrize("engine", FITS)
def test_what_an_engine_does_not_have_is_not_compared(engine):
    """An analytic energy, and in a tree engine a constraint."""
    assert check(engine).error(seen_of(load(MODELS / "bead_in_bowl.yaml"))) is None


@pytest.mark.parametrize(
    "engine, name", [("Pinocchio", "stanford_arm"), ("MuJoCo", "four_bar"), ("MuJoCo", "planar_3r")]
)
def test_a_wrong_term_is_caught(engine, name):
    needs(engine)
    seen = seen_of(load(MODELS / f"{name}.yaml"))
    for term in ("M", "h"):
        wrong = replace(seen.system, **{term: ca.SX(getattr(seen.system, term)) * (1 + 1e-6)})
        assert (
            not check(engine).error(replace(seen, terms_at=terms(wrong))) <= check(engine).tolerance
        )


def test_a_reference_that_moves_otherwise_is_caught(monkeypatch):
    """Exudyn is given the model, and the reference that is carried on another gravity."""
    needs("Exudyn")
    model = load(MODELS / "rolling_disk.yaml")
    wrong = reference(replace(model, gravity=model.gravity[::-1]))
    monkeypatch.setattr(engines, "reference", lambda bare: wrong)
    assert not check("Exudyn").error(seen_of(model)) <= check("Exudyn").tolerance


def test_without_an_engine_there_is_no_check(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    seen = seen_of(load_text(ARM))
    assert all(check(engine).error(seen) is None for engine in FITS)
