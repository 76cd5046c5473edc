"""What `hamel linearize` prints where there is little: no eigenvalues, no shape of a mode, ranges.

Of hamel.verbs: linearize. Of hamel.linear: words.
"""

from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

import hamel
from derive.diagnostics import AssumptionError
from hamel.build import stages
from hamel.records import Linearized
from hamel.verbs import linearize as verb

HELD = """
model: held
plane: xy
bodies: {a: {mass: 1 kg, inertia: 1}}
joints: {A: {type: revolute, parent: ground, child: a, coordinate: q}}
constraints: {e: {type: prescribed, joint: A, motion: 0 rad}}
"""
DAMPED = """
model: damped
parameters: {c: 1 N*s/m}
bodies: {b: {mass: 1 kg}}
joints:
  j: {type: prismatic, axis: x, parent: ground, child: b, coordinate: x, spring: {stiffness: 1 N/m}, damper: c}
"""
# Of a sled that a knife ties and a wheel on it that nothing does.
SLED = """
model: sled
plane: xy
bodies: {sled: {mass: 1 kg, inertia: 1}, wheel: {mass: 1 kg, inertia: 1}}
joints:
  base: {type: planar, parent: ground, child: sled}
  hub: {type: revolute, parent: sled, child: wheel, coordinate: q}
constraints: {knife: {type: no_slip, body: sled, direction: y}}
"""
DRIVEN = {
    "torque": SLED + "loads: {s: {type: expression, joint: hub, expression: 1 N*m*sin(t/(1 s))}}",
    "position": HELD.replace("0 rad", "1 rad/s*t"),
    "still": SLED,
}


def printed(record: Linearized) -> str:
    out = StringIO()
    verb.show(record, Console(file=out, width=300))
    return out.getvalue()


def test_no_degree_of_freedom_is_said(tmp_path: Path) -> None:
    """An empty table stood there."""
    file = tmp_path / "held.yaml"
    file.write_text(HELD)
    text = printed(hamel.linearize(file, at="guess"))
    assert "no eigenvalues: the constraints leave no degree of freedom" in text
    assert "eigenvalues (1/s)" not in text


@pytest.mark.parametrize(
    ("ends", "told"),
    [
        ((-2.0, 2.0), ["no unstable eigenvalue for c from 0 to 2", "from -2 to 0"]),
        ((1.0, 2.0), ["no unstable eigenvalue for c from 1 to 2"]),
    ],
)
def test_the_rest_of_a_range_is_unstable(
    ends: tuple[float, float], told: list[str], tmp_path: Path
) -> None:
    file = tmp_path / "damped.yaml"
    file.write_text(DAMPED)
    record = hamel.linearize(
        file, at="guess", sweep={"c": f"{ends[0]:g}:{ends[1]:g}:41"}, out=tmp_path
    )
    text, page = printed(record), (tmp_path / "linearization.html").read_text()
    for line in told:
        assert line in text
    assert ("\nunstable eigenvalues for c" in text) == (ends[0] < 0)
    assert ("Some mode grows from -2 to 0." in page) == (ends[0] < 0)
    bare = replace(record, modes=(replace(record.modes[0], shape=""),))
    assert not any(line.endswith("; ") for line in printed(bare).splitlines())


@pytest.mark.parametrize("load", DRIVEN)
def test_what_depends_on_time_is_refused_before_a_choice_is_looked_for(
    load: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nothing ties the velocity that it acts on, or the position itself follows the time."""
    (tmp_path / "m.yaml").write_text(DRIVEN[load])

    def chosen(*given: object, **how: object) -> None:
        raise AssertionError("a choice was made")

    monkeypatch.setattr(stages, "equations", chosen)
    if load == "still":
        with pytest.raises(AssertionError, match="a choice was made"):
            hamel.linearize(tmp_path / "m.yaml")
    else:
        with pytest.raises(AssumptionError, match="depends on time and has no steady motion"):
            hamel.linearize(tmp_path / "m.yaml")
