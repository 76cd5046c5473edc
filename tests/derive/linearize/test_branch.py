"""Motions of a sweep are on one branch, and where it ends is said.

Of derive.linearize: branch, fold, nearest.
Of hamel.linear: courses.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import equations
from derive.linearize.many import steady_motions
from derive.linearize.steady import motion_of
from derive.linearize.study import study
from derive.model import load_text
from derive.states import system

# A bead on a hoop that turns at a given rate. At rest below, it turns unstable at √(g/l); from
# there it can rest at cos θ = g/(l om²), too.
HOOP = """
model: hoop
plane: xy
parameters: {m: 1 kg, l: 0.4 m, om: 3 rad/s, g: 9.81 m/s^2, d: 0.05}
coordinates: {th: rad}
kinetic: m/2*l^2*der(th)^2
potential: -m*g*l*cos(th) - m/2*l^2*om^2*sin(th)^2
forces: {th: -d*der(th)}
initial: {th: START}
steady_motion: {round: {guess: {th: START}, sweep: {om: [RANGE]}}}
"""
ONSET = np.sqrt(9.81 / 0.4)
# Two springs that are longer than the way: snaps through under the load F.
TRUSS = """
model: truss
plane: xy
gravity: [0, 0]
parameters: {F: 1 N, c: 0.5 N*s/m}
bodies: {a: {mass: 1 kg}}
joints: {A: {type: prismatic, parent: ground, child: a, axis: [0, 1], coordinate: y, damper: c}}
loads:
  left: {type: spring, between: [ground, a], at: [[-1, 0], [0, 0]], stiffness: 100 N/m, length: 1.1 m}
  right: {type: spring, between: [ground, a], at: [[1, 0], [0, 0]], stiffness: 100 N/m, length: 1.1 m}
  weight: {type: force, body: a, components: [0, -F]}
initial: {y: 0.45 m}
"""
PENDULUM = """
model: pendulum
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 1 kg}
bodies: {a: {mass: m, com: [0, -1 m]}}
joints: {A: {type: revolute, parent: ground, child: a, coordinate: q}}
inputs: {tau: {joint: A}}
initial: {q: 5 deg}
"""
FALLING = """
model: falling
gravity: [0, 0, -9.81 m/s^2]
bodies:
  hull: {mass: 3 kg, com: [0.05, -0.02, 0.01], inertia: [0.2, 0.3, 0.25, 0.01, -0.02, 0.03]}
  wheel: {mass: 0.4 kg, inertia: [0.005, 0.005, 0.01]}
joints:
  base: {type: free, parent: ground, child: hull, position: [x, y, z]}
  A: {type: revolute, parent: hull, child: wheel, axis: z, at: [0.25, 0, 0.1], coordinate: f1}
initial: {base.wx: 1 rad/s, der(f1): 30 rad/s}
"""


def written(tmp_path: Path, text: str, **words: object) -> Path:
    for word, value in words.items():
        text = text.replace(word, str(value))
    path = tmp_path / "model.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("count", [10, 26, 33])
def test_critical_values_are_those_of_one_branch(count: int, tmp_path: Path) -> None:
    """Between rows it is found anew: from further off, that led to the motion off the axis, and
    the value was one just below the next row, 5 % off."""
    path = written(tmp_path, HOOP, START="0.3 rad", RANGE=f"1 rad/s, 10 rad/s, {count}")
    found = hamel.linearize(path)
    (double, zero) = found.critical
    assert double.value == pytest.approx(np.sqrt(ONSET**2 - (0.05 / 0.4**2 / 2) ** 2), rel=1e-12)
    assert zero.value == pytest.approx(ONSET, rel=1e-12)
    assert found.stable == ((1.0, zero.value),)


def test_rows_are_of_the_branch_that_is_studied(tmp_path: Path) -> None:
    """From the first row on it was the motion on the axis that was followed, to its end: the study's
    own is the other. Where both meet, they go on as one."""
    path = written(tmp_path, HOOP, START="50 deg", RANGE="3 rad/s, 10 rad/s, 8")
    found = hamel.linearize(path, values={"om": 6.5})
    for row in found.rows:
        om = row["om"]
        cosine = min(1.0, ONSET**2 / om**2)
        stiffness = ONSET**2 * cosine - om**2 * (2 * cosine**2 - 1)
        frequency = np.sqrt(stiffness - (0.05 / 0.4**2 / 2) ** 2)
        assert abs(row["eigenvalues"][0][1]) == pytest.approx(frequency, rel=1e-9)
    assert (found.breaks, found.stable) == ((), ((3.0, 10.0),))


def test_a_branch_that_ends_is_said(tmp_path: Path) -> None:
    """Stable on both sides of where the truss snaps through, which no row is evidence of."""
    path = written(tmp_path, TRUSS)
    found = hamel.linearize(path, sweep={"F": "0:6:13"})
    assert found.breaks == (7,)
    double, fold = found.critical
    assert (double.kind, fold.kind) == ("double", "fold")
    assert found.stable == ((0.0, fold.value), (3.5, 6.0))
    lengths = np.sqrt(1 + (y := np.sqrt(1.1 ** (2 / 3) - 1)) ** 2)  # where dF/dy = 0
    assert fold.value == pytest.approx(-200 * (lengths - 1.1) * y / lengths, rel=1e-13)


# s = b and s = 0 pass through each other at b = 0; stable is s = b for b > 0.
CROSSING = """
model: crossing
plane: xy
parameters: {b: -1}
bodies: {m: {mass: 1 kg, inertia: 1}}
joints: {j: {type: revolute, parent: ground, child: m, coordinate: s}}
loads:
  f: {type: expression, joint: j, expression: "(1 N*m)*(b*s - s^2)"}
  d: {type: damper, joint: j, coefficient: 0.1 N*m*s/rad}
initial: {s: -1 rad}
"""


def test_branches_that_cross_are_not_mistaken_for_each_other(tmp_path: Path) -> None:
    """Newton's method from the row before came to the branch that is nearer there."""
    found = hamel.linearize(written(tmp_path, CROSSING), sweep={"b": "-1:1:4"})
    assert abs(found.rows[-1]["eigenvalues"][0][1]) == pytest.approx(np.sqrt(1 - 0.05**2))
    (zero, _) = found.critical
    assert zero.value == pytest.approx(0.0, abs=1e-12)
    assert found.stable == ((zero.value, 1.0),)


def test_a_map_stays_on_the_branch_and_says_where_it_ends(tmp_path: Path) -> None:
    """The way straight to a row of the map may cross a fold that there is a way round."""
    text = TRUSS.replace("length: 1.1 m", "length: 1.1*l").replace("F: 1 N,", "F: 1 N, l: 1 m,")
    text = text.replace("[-1, 0]", "[-l, 0]").replace("[1, 0]", "[l, 0]")
    path = written(tmp_path, text)
    one = hamel.linearize(path, values={"l": 2.0, "y": 0.9}, sweep={"F": "0:6:7"})
    both = hamel.linearize(path, sweep={"F": "0:6:7", "l": "1:2:3"})
    wide = [row["eigenvalues"][0][1] for row in both.rows if row["l"] == 2.0]
    assert wide == pytest.approx([row["eigenvalues"][0][1] for row in one.rows])
    assert not one.breaks and both.breaks


def test_motions_made_at_once_do_not_leave_their_branch() -> None:
    """Newton's method alone came to the truss that has snapped through."""
    found = equations(system(load_text(TRUSS)))
    one = study(found, motion_of(found, None))
    motions, good = steady_motions(one, {"F": np.linspace(0.0, 6.0, 13)})
    assert good.tolist() == [True] * 7 + [False] * 6
    rows = one.motions({"F": np.linspace(0.0, 3.0, 7)})
    assert np.max(np.abs(motions.x[:7] - rows.x)) < 1e-9


def test_motions_made_at_once_go_round_bends() -> None:
    """From the motion off the axis to that on it, where both meet close by and far off."""
    for own, start in ((5.0, "12 deg"), (6.5, "50 deg"), (9.0, "70 deg")):
        text = HOOP.replace("START", start).replace(", sweep: {om: [RANGE]}", "")
        found = equations(system(load_text(text)))
        one = study(found, motion_of(found, None), {"om": own})
        om = np.linspace(3.0, 10.0, 29)
        motions, good = steady_motions(one, {"om": om})
        wanted = np.arccos(np.minimum(1.0, ONSET**2 / om**2))
        assert good.all()
        assert np.max(np.abs(motions.x[:, 0] - wanted)) < 1e-6


def test_rows_without_a_motion_are_left_empty_and_told(tmp_path: Path) -> None:
    """They refused the whole range."""
    path = written(tmp_path, PENDULUM)
    found = hamel.linearize(path, sweep={"m": "0:2:3"})
    assert found.absent == (0,)
    assert [len(row["eigenvalues"]) for row in found.rows] == [0, 2, 2]
    assert found.stable == ((1.0, 2.0),)
    with pytest.raises(AssumptionError, match="at m = 0: the equations of 'auto' are singular"):
        hamel.linearize(path, sweep={"m": "0:0:2"})


def test_a_branch_ends_where_it_turns_back(tmp_path: Path) -> None:
    """m g sin q = tau has no solution beyond tau = m g."""
    path = written(tmp_path, PENDULUM)
    found = hamel.linearize(path, sweep={"tau": "0:12:13"}, out=tmp_path)
    assert found.absent == (10, 11, 12)
    (fold,) = found.critical
    assert (fold.kind, fold.value) == ("fold", pytest.approx(9.81, rel=1e-13))
    assert found.stable == ((0.0, fold.value),)
    page = (tmp_path / "linearization.html").read_text("utf-8")
    assert "No steady motion was found at tau = 10 … 12." in page


# A plate on a spring that a voltage pulls to another one, from which it is d apart: at s = d/3 it
# snaps to it (Senturia, Microsystem Design, 2001: V² = 8 k d³/27 εA).
PLATE = """
model: plate
plane: xy
parameters: {m: 1e-9 kg, k: 2 N/m, d: 2 um, V: 1}
bodies: {b: {mass: m}}
joints: {j: {type: prismatic, parent: ground, child: b, axis: x, coordinate: s}}
loads:
  spring: {type: spring, joint: j, stiffness: k}
  field: {type: expression, joint: j, expression: "(1e-18 N*m^2)*V^2/(2*(d - s)^2)"}
  film: {type: damper, joint: j, coefficient: 1e-6 N*s/m}
initial: {s: 0 m}
"""


@pytest.mark.parametrize("range_", ["0:3:16", "3:0:16", "2.1:2.3:3"])
def test_pull_in_is_found_to_the_last_digits(range_: str, tmp_path: Path) -> None:
    found = hamel.linearize(written(tmp_path, PLATE), sweep={"V": range_})
    (fold,) = (c for c in found.critical if c.kind == "fold")
    assert fold.value == pytest.approx(np.sqrt(8 * 2 * (2e-6) ** 3 / (27 * 1e-18)), rel=1e-13)
    (double,) = (c for c in found.critical if c.kind == "double")
    assert 0 < fold.value - double.value < 1e-8
    assert {edge for ends in found.stable for edge in ends} >= {fold.value}
    assert not found.unstable


def test_families_go_with_rows_without_a_motion(tmp_path: Path) -> None:
    """The pendulum hangs on a slide that may glide at any speed."""
    text = PENDULUM.replace("{a: {mass", "{slide: {mass: 2 kg}, a: {mass").replace(
        "joints: {A: {type: revolute, parent: ground",
        "joints: {S: {type: prismatic, parent: ground, child: slide, axis: x, coordinate: x}, "
        "A: {type: revolute, parent: slide",
    )
    path = written(tmp_path, text)
    found = hamel.linearize(path, sweep={"tau": "0:12:7"}, out=tmp_path)
    assert (found.families, found.absent) == (1, (5, 6))
    (fold,) = (c for c in found.critical if c.kind == "fold")
    assert fold.value == pytest.approx(9.81, rel=1e-13)
    both = hamel.linearize(path, sweep={"tau": "0:12:4", "m": "0.5:2:4"})
    assert both.absent == (8, 12, 13)


def test_a_range_may_begin_beyond_a_fold(tmp_path: Path) -> None:
    """x³ − x = b: the branch of x = 1 turns back at b = −2/√27."""
    path = written(
        tmp_path, CROSSING.replace("b*s - s^2", "b + s - s^3").replace("s: -1 ", "s: 1 ")
    )
    found = hamel.linearize(path, values={"b": 0.0}, sweep={"b": "-1:1:9"})
    values = [c.value for c in found.critical if c.kind == "fold"]
    assert values == pytest.approx([-2 / np.sqrt(27)], rel=1e-13)
    assert found.absent == (0, 1, 2)
    assert found.stable == ((values[0], 1.0),)


@pytest.mark.parametrize("e", [0.1, 0.01])
def test_both_folds_between_two_rows_are_found(e: float, tmp_path: Path) -> None:
    """s³ − e s = b: a step along the curve went across both, and where a row had been left out its
    branch came there from the other side."""
    text = CROSSING.replace("b*s - s^2", f"b + {e}*s - s^3")
    path = written(tmp_path, text.replace("{b: -1}", "{b: -0.3}"))
    found = hamel.linearize(path, sweep={"b": "-0.3:0.35:7"})
    fold = 2 / np.sqrt(27) * e**1.5
    folds = [c.value for c in found.critical if c.kind == "fold"]
    assert folds == pytest.approx([fold, -fold], rel=1e-9)
    assert (found.absent, len(found.breaks)) == ((), 1)
    assert found.stable == ((-0.3, folds[0]), (folds[1], 0.35))


def test_a_fold_on_a_row_is_one(tmp_path: Path) -> None:
    """s² = 1 − b²: rounding made a change of stability there, and it took a minute."""
    text = CROSSING.replace("b*s - s^2", "1 - b^2 - s^2").replace("{b: -1}", "{b: 0}")
    path = written(tmp_path, text.replace("s: -1 rad", "s: START"))
    for start, stable in (("0.9 rad", True), ("-0.9 rad", False)):
        path = written(tmp_path, text.replace("s: -1 rad", f"s: {start}"))
        found = hamel.linearize(path, sweep={"b": "-2:2:9"})
        folds = [c.value for c in found.critical if c.kind == "fold"]
        assert folds == pytest.approx([-1.0, 1.0], rel=1e-13)
        assert not any(c.kind == "zero" for c in found.critical)
        assert found.absent == (0, 1, 7, 8)
        ends = [edge for part in (found.stable if stable else found.unstable) for edge in part]
        assert ends == pytest.approx([-1.0, 1.0], rel=1e-13)
        assert not (found.unstable if stable else found.stable)


def test_the_files_own_value_may_have_no_motion(tmp_path: Path) -> None:
    """12 N m is more than m g l holds up: the equations are those of a row that has a motion."""
    text = PENDULUM.replace("{m: 1 kg}", "{m: 1 kg, T: 12 N*m}")
    load = "loads: {push: {type: expression, joint: A, expression: T}}"
    path = written(tmp_path, text.replace("inputs: {tau: {joint: A}}", load))
    for values, sweep in (({}, {}), ({"T": 12}, {"T": "0:8:5"})):
        with pytest.raises(AssumptionError, match="no steady motion"):
            hamel.linearize(path, values=values, sweep=sweep)
    with pytest.warns(RuntimeWarning, match="no steady motion 'guess' with its own T: .* at T = 0"):
        found = hamel.linearize(path, sweep={"T": "0:8:5"})
    stiffness = [-(row["eigenvalues"][0][1] ** 2) for row in found.rows]
    exact = [-np.sqrt(9.81**2 - T**2) for T in np.linspace(0, 8, 5)]
    assert stiffness == pytest.approx(exact, rel=1e-9)


def test_a_map_has_places_without_a_motion(tmp_path: Path) -> None:
    path = written(tmp_path, PENDULUM)
    found = hamel.linearize(path, sweep={"tau": "0:12:4", "m": "0.5:2:4"}, out=tmp_path)
    for k, row in enumerate(found.rows):
        assert (k in found.absent) == (row["tau"] > 9.81 * row["m"])
        assert bool(row["eigenvalues"]) == (k not in found.absent)
    text = (tmp_path / "linearization.html").read_text("utf-8")
    assert f"{len(found.absent) / 16:.0%} no motion (grey)" in text


def test_inputs_can_be_given_to_what_is_found_near_the_initial_values(tmp_path: Path) -> None:
    path = written(tmp_path, PENDULUM)
    found = hamel.linearize(path, values={"tau": 2.0})
    assert found.steady["q"] == pytest.approx(np.arcsin(2 / 9.81))
    rows = hamel.linearize(path, sweep={"tau": "0:9:4"}).rows
    wanted = [np.sqrt(9.81 * np.cos(np.arcsin(tau / 9.81))) for tau in (0, 3, 6, 9)]
    assert [abs(row["eigenvalues"][0][1]) for row in rows] == pytest.approx(wanted)
    path.write_text(PENDULUM + "steady_motion: {held: {q: 0.3, tau: free}}\n")
    with pytest.raises(ModelError, match="'tau' is found, not given, along the steady"):
        hamel.linearize(path, values={"tau": 2.0})


def test_what_falls_is_never_steady(tmp_path: Path) -> None:
    """A velocity of 8·10⁶ m/s that turns by 10⁻⁶ rad/s balanced the weight, all but 10⁻⁴ m/s²."""
    path = written(tmp_path, FALLING)
    with pytest.raises(AssumptionError, match="no steady motion was found"):
        hamel.linearize(path)
