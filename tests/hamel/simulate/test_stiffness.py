"""`auto` goes over to radau where explicit steps are held down by stiffness, and says so; else not.

Of hamel.simulate: stiffness.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import hamel
from codegen import compiler
from hamel.simulate import stiffness
from hamel.simulate.limits import LOOKS
from tests.scenes import MODELS

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

# A rod in thick oil: what moves takes hours, what is stiff 1e-5 s.
OIL = """
model: oil
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {rod: {mass: 1 kg, com: [0, -0.5 m], inertia: 0.1 kg*m^2}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
loads: {oil: {type: damper, joint: hinge, coefficient: 3e4 N*m*s/rad}}
initial: {q: 60 deg}
"""


@pytest.fixture
def oil(tmp_path: Path) -> Path:
    place = tmp_path / "oil.yaml"
    place.write_text(OIL)
    return place


def test_a_stiff_motion_is_made_by_radau(oil: Path) -> None:
    record = hamel.simulate(oil, time=1.0, integrator="auto")
    assert record.integrator == "radau" and record.automatic
    assert "held down by stiffness" in record.why
    explicit = hamel.simulate(oil, time=1.0, integrator="dop853")
    assert explicit.integrator == "dop853" and not explicit.why
    assert record.steps < explicit.steps / 10
    assert abs(record.final["q"] - explicit.final["q"]) < 1e-8


def test_many_steps_alone_are_not_stiff() -> None:
    """Swinging for long takes many steps, by accuracy."""
    record = hamel.simulate(MODELS / "double_pendulum.yaml", time=400.0, integrator="auto")
    assert record.steps > LOOKS[0]
    assert record.integrator in ("taylor", "verner9", "dop853") and not record.why


def test_without_the_look_the_explicit_one_goes_on(
    oil: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tests above see that it is looked at."""
    monkeypatch.setattr(stiffness, "HELD", 1e9)
    assert hamel.simulate(oil, time=0.5, integrator="auto").integrator != "radau"
