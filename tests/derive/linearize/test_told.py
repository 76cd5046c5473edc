"""What `hamel linearize` prints where there is little: no eigenvalues, no shape of a mode, ranges.

Of hamel.verbs: linearize. Of hamel.linear: words.
"""

from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

import hamel
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
