"""Bodies whose mass depends on t: thrust as by hand and as the reference has it, refused where
nobody says what leaves.

Of derive.mechanics.loads: exhaust.
Of hamel.verify.reference: exhaust.
"""

from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, ModelError
from derive.mechanics import loads
from derive.mechanics.loads.records import Applied
from derive.model import load_text
from derive.model.load_records import Exhaust
from derive.states import system
from tests.agreement import disagreement, places, terms

ROCKET = Path(__file__).parents[3] / "models/gallery/rocket.yaml"
STAGE = """
model: stage
gravity: [0, 0, -9.81 m/s^2]
parameters: {m0: 500 kg, flow: 3 kg/s, u: 2000 m/s}
where: {m: m0 - flow*t - (2 kg)*sin(t*(1 1/s))}
bodies:
  stage:
    mass: m
    com: [0.1, 0.2, 0.3]
    inertia: [(3 m^2)*m, (3 m^2)*m, (1 m^2)*m]
    exhaust: {velocity: [swivel*u, 0, -u]}
  arm: {mass: 20 kg, com: [0.5, 0, 0], inertia: 1}
joints:
  base: {type: free, parent: ground, child: stage}
  pin: {type: revolute, parent: stage, child: arm, at: [0, 0, 2 m], axis: y, coordinate: q}
inputs: {swivel: {}}
"""
UP = """
model: up
plane: xz
gravity: [0, -9.81 m/s^2]
parameters: {m0: 500 kg, flow: 3 kg/s, u: 2000 m/s}
bodies: {rocket: {mass: m0 - flow*t, exhaust: {velocity: [0, -u]}}}
joints: {rail: {type: prismatic, parent: ground, child: rocket, axis: z, coordinate: z}}
"""


FAR = """
model: far
gravity: [0, 0, -9.81 m/s^2]
bodies:
  a: {mass: 1 kg, com: [0.1, 0, 0], inertia: [0.01, 0.02, 0.03]}
  b: {mass: 1 kg, com: [0.1, 0, 0], inertia: [0.01, 0.02, 0.03]}
  r: {mass: "2 kg - (0.1 kg/s)*t", com: [0.1, 0, 0], inertia: [0.01, 0.02, 0.03], exhaust: {velocity: [-20 m/s, 3 m/s, 0]}}
joints:
  A: {type: revolute, parent: ground, child: a, axis: z}
  B: {type: revolute, parent: a, child: b, axis: y, at: [0.3, 0, 0]}
  C: {type: revolute, parent: b, child: r, axis: x, at: [0.3, 0.1, 0]}
"""


def test_equals_the_form_by_hand() -> None:
    """Meshchersky: m z̈ = −m g + ṁ (−u)."""
    found = system(load_text(UP))
    for place in places(found):
        m0, flow, u = place.p
        wanted = -9.81 + flow * u / (m0 - flow * place.t)
        got = terms(found, place)
        assert got["vdot"][0] == pytest.approx(wanted, rel=1e-12)
        # what leaves takes ½ ṁ v² and ṁ g z along
        power = flow * u * place.v[0] - flow * (place.v[0] ** 2 / 2 + 9.81 * place.q[0])
        assert got["power"].item() == pytest.approx(power, rel=1e-12)


@pytest.mark.parametrize("text", [STAGE, UP, ROCKET, FAR], ids=["stage", "up", "rocket", "far"])
def test_agrees_with_the_reference(text: str | Path) -> None:
    worst = disagreement(text)
    assert max(worst.values()) < 1e-12, worst


def test_a_wrong_thrust_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    right = loads.LAW_OF[Exhaust]

    def wrong(scene, load):
        return Applied(right(scene, load).energy, 1.001 * right(scene, load).force)

    monkeypatch.setitem(loads.LAW_OF, Exhaust, wrong)
    worst = disagreement(STAGE, 2)
    assert worst["Q"] > 1e-7 and worst["power"] > 1e-9


def test_matter_that_is_let_go_changes_no_velocity() -> None:
    """Without relative velocity there is no force: sand that runs out of a cart."""
    sand = UP.replace("[0, -u]", "[0, 0]")
    found = system(load_text(sand))
    for place in places(found, 2):
        assert np.allclose(terms(found, place)["vdot"], -9.81, rtol=1e-14)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            ", exhaust: {velocity: [0, -u]}",
            "",
            "6:25: error: mass or inertia of 'rocket' depends on",
        ),
        ("mass: m0 - flow*t", "mass: m0", "'rocket' has an exhaust and a mass without t"),
        (
            "mass: m0 - flow*t",
            "mass: m0 - flow*z",
            "'z' is a coordinate and cannot stand in a mass",
        ),
        ("axis: z", "at: [0, (1 m/s)*t], axis: z", "'t' is time and cannot stand in a point"),
        ("[0, -u]", "[0, -flow]", "an exhaust velocity in N*s/m"),
    ],
)
def test_what_is_not_clear_is_refused(old: str, new: str, said: str) -> None:
    with pytest.raises(ModelError) as error:
        load_text(UP.replace(old, new))
    assert said in str(error.value)


def test_roads_that_differentiate_momenta_are_refused(tmp_path: Path) -> None:
    with pytest.raises(AssumptionError, match="the mass of 'rocket' depends on t"):
        hamel.derive(ROCKET, road=("boltzmann_hamel",), out=tmp_path)


@pytest.mark.slow
def test_a_mass_by_a_table_is_verified(tmp_path: Path) -> None:
    """Thrust from a curve of what is burnt: verify once ended in an internal error."""
    file = tmp_path / "up.yaml"
    table = "tables: {left: {points: [[0, 500], [2, 480], [9, 300], [10, 300]], units: [s, kg], smooth: C1}}\nbodies:"
    file.write_text(UP.replace("m0 - flow*t", "left(t)").replace("bodies:", table))
    assert hamel.verify(file, states=5).passed
