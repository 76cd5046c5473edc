"""Numbers with units keep them in vectors of formulas.

Of derive.model: quantities.
"""

from __future__ import annotations

import pytest

from derive.diagnostics import ModelError
from derive.model import load_text
from derive.states import system

MODEL = """
model: vec
bodies: {A: {mass: 1 kg, inertia: 0.1}}
joints: {ja: {type: free, parent: ground, child: A}}
outputs: {o: "FORMULA"}
"""


@pytest.mark.parametrize(
    ("formula", "unit"),
    [
        ("norm((0.5 m)*angular_velocity(A))", "m/s"),
        ("norm(angular_velocity(A)*(50 cm))", "m/s"),
        ("norm(-(1 m)*direction(A, x))", "m"),
        ("dot((2 N)*direction(A, x), velocity(A))", "W"),
        ("norm(velocity(A) + (0.5 m)*angular_velocity(A))", "m/s"),
        ("norm((2 N)*(3 m)*direction(A, x))", "N*m"),
        ("norm([1 m, 2, 3] - [1 m, 2 m, 2 m])", "m"),
        ("norm(cross([1 m, 0, 0], velocity(A)))", "m^2/s"),
        ("norm(2*velocity(A))", "m/s"),
        ("(position(A) - 2*velocity(A)*(1 s)).y", "m"),
        ("2*(position(A)*(2 m)).x^2", "m^4"),
    ],
)
def test_a_quantity_times_a_vector_has_the_unit_of_both(formula, unit):
    (found,) = system(load_text(MODEL.replace("FORMULA", formula)), "all").outputs
    assert found[2] == unit


@pytest.mark.parametrize(
    ("formula", "said", "at"),
    [
        ("norm(velocity(A) + (50 cm)*velocity(A))", "cannot add m^2/s to m/s", "(50 cm)"),
        ("norm([1 m, 0, 0] + [1 s, 0, 0])", "cannot add s to m", "1 s"),
        ("(distance(A, ground)).x", "a number where a vector is needed", "distance"),
    ],
)
def test_vectors_of_other_units_are_not_added(formula, said, at):
    with pytest.raises(ModelError) as caught:
        load_text(MODEL.replace("FORMULA", formula))
    message = str(caught.value)
    assert said in message
    line, caret = message.splitlines()[1:3]
    assert line[caret.index("^") :].startswith(at)
