"""`--set name=value`: what can be set, in which units, and what is refused."""

import math
from pathlib import Path

import pytest

from derive.diagnostics import HamelError
from derive.model import load
from hamel.settings import settings

MODEL = load(Path(__file__).parents[2] / "models" / "four_bar.yaml")


def test_nothing_set_is_the_file():
    found = settings(MODEL, {})
    assert found.initial == {} and found.inputs == {"tau": 0.0}
    assert found.parameters["l1"] == 0.2


def test_each_kind_goes_to_its_place():
    found = settings(MODEL, {"q1": "30 deg", "der( q1 )": 2, "tau": "0.5 N*m", "l1": "2*l2/5"})
    assert found.initial == {"q1": pytest.approx(math.pi / 6), "der(q1)": 2.0}
    assert found.inputs["tau"] == 0.5
    assert found.parameters["l1"] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("q9", "1", "q9"),
        ("l1", "3 kg", "3 kg"),
        ("q1", "1 +", "expected"),
        ("q1", "q2", "no parameter"),
        ("q1", "__import__('os')", "error"),
        ("m1", float("nan"), "finite"),
        ("m1", "1e999", "value of m1:1:1"),
    ],
)
def test_mistakes_are_named(name, value, said):
    with pytest.raises(HamelError, match=said):
        settings(MODEL, {name: value})


def test_near_names_are_offered():
    with pytest.raises(HamelError, match="did you mean 'tau'"):
        settings(MODEL, {"tua": 1.0})


CART = """model: cart
plane: xy
parameters: {m: 2 kg, k: 50 N/m, s: 3}
bodies: {cart: {mass: m}}
joints: {rail: {type: prismatic, parent: ground, child: cart, axis: x, spring: {stiffness: s*k}}}
"""


def test_a_quantity_may_have_the_unit_of_a_parameters_name(tmp_path):
    file = tmp_path / "cart.yaml"
    file.write_text(CART)
    model = load(file)
    assert settings(model, {"k": "40 N/m"}).parameters["k"] == 40.0
    assert settings(model, {"k": "40 kN / m"}).parameters["k"] == 40e3
    assert settings(model, {"k": "2*k"}).parameters["k"] == 100.0
    with pytest.raises(HamelError, match="the model's own name"):
        settings(model, {"k": "40 N*s/m"})
