"""`hamel simulate`: motions against closed forms, on their constraints, in balance; files; starts
that contradict themselves.

Of hamel.simulate: automatic, files, inputs, limits, method, motion, record.
"""

import csv
import math
import xml.etree.ElementTree as ET
from contextlib import nullcontext

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, HamelError, ModelError
from hamel import progress
from hamel.simulate.energies import largest_error
from hamel.simulate.motion import Covered
from tests.scenes import MODELS

FOUR_BAR = MODELS / "four_bar.yaml"
SLEIGH = MODELS / "chaplygin_sleigh.yaml"


def sleigh(t, m=1.0, inertia=0.2, a=0.5, w0=2.0):
    """Speed, spin and heading of the Chaplygin sleigh started in pure rotation (Chaplygin;
    Caratheodory)."""
    kappa = math.sqrt(m / (inertia + m * a * a))
    V = w0 / kappa
    s = a * kappa**2 * V * t
    return V * np.tanh(s), kappa * V / np.cosh(s), 2 / (a * kappa) * np.arctan(np.tanh(s / 2))


@pytest.mark.parametrize("choice", ["body", "best"])
def test_chaplygin_sleigh_is_its_closed_form(choice):
    found = hamel.simulate(SLEIGH, choice=choice, time=5.0).motion
    v, w, th = sleigh(found["t"])
    assert np.max(np.abs(found["base.vx"] - v)) < 1e-9
    assert np.max(np.abs(found["base.w"] - w)) < 1e-9
    assert np.max(np.abs(found["th"] - th)) < 1e-9


@pytest.mark.parametrize("choice", ["crank", "best"])
def test_four_bar_stays_closed_and_in_balance(choice):
    found = hamel.simulate(FOUR_BAR, choice=choice, time=10.0)
    assert found.position_violation <= 1e-12
    assert found.velocity_violation <= 1e-12
    assert found.energy_balance <= 1e-9
    assert found.motion["work"][-1] < -0.1  # the bearing's damper


def test_the_balance_notices_a_loss():
    none, ramp = np.zeros(3), np.array([1.0, 1.1, 1.2])
    assert largest_error({"T": ramp, "V": none, "work": none}) == pytest.approx(0.2 / 1.2)


def test_inputs_parameters_and_initial_values_can_be_set():
    still = hamel.simulate(SLEIGH, time=1.0, values={"base.w": 0})
    assert np.all(still.motion["th"] == 0)
    heavy = hamel.simulate(SLEIGH, time=1.0, values={"m": "2 kg", "base.w": "1 rad/s"})
    v, w, _ = sleigh(1.0, m=2.0, w0=1.0)
    assert heavy.final["base.vx"] == pytest.approx(v, abs=1e-9)
    assert heavy.final["base.w"] == pytest.approx(w, abs=1e-9)
    driven = hamel.simulate(FOUR_BAR, choice="crank", time=0.5, values={"tau": "1 N*m"})
    assert driven.motion["work"][-1] == pytest.approx(
        driven.final["q1"] - driven.motion["q1"][0], rel=0.1
    )


def test_rows_come_at_multiples_of_the_step_and_at_the_end():
    t = hamel.simulate(SLEIGH, time=1.0, step=0.3).motion["t"]
    assert t.tolist() == pytest.approx([0.0, 0.3, 0.6, 0.9, 1.0])
    assert hamel.simulate(SLEIGH, time=0.3, step=0.1).motion["t"].tolist() == pytest.approx(
        [0.0, 0.1, 0.2, 0.3]
    )
    assert len(hamel.simulate(SLEIGH, time=7.0).motion["t"]) == 501


def test_csv_npz_and_plot_hold_the_motion(tmp_path):
    found = hamel.simulate(FOUR_BAR, time=0.5, out=tmp_path / "m.csv", plot=tmp_path / "new/m.svg")
    hamel.simulate(FOUR_BAR, time=0.5, out=tmp_path / "m.npz")
    with open(tmp_path / "m.csv", newline="") as file:
        names, *rows = csv.reader(file)
    table = np.array(rows, dtype=float)
    with np.load(tmp_path / "m.npz") as arrays:
        assert arrays.files == names == list(found.motion)
        assert all(np.array_equal(arrays[name], table[:, i]) for i, name in enumerate(names))
    assert np.array_equal(table[:, 1], found.motion["q1"])  # every digit
    assert ET.parse(tmp_path / "new/m.svg").getroot().tag.endswith("svg")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.csv", "m.npz", "new"]


def test_progress_is_told_up_to_the_end():
    told: list[float] = []
    hamel.simulate(FOUR_BAR, time=1.0, progress=told.append)
    assert told[-1] == 1.0 and told == sorted(told)


@pytest.mark.filterwarnings("ignore:no C compiler")
@pytest.mark.slow
def test_without_a_compiler_numpy_finds_the_same_motion(monkeypatch):
    compiled = hamel.simulate(FOUR_BAR, choice="crank", time=0.3).final
    monkeypatch.setenv("CC", "no-such-compiler")
    plain = hamel.simulate(FOUR_BAR, choice="crank", time=0.3).final
    assert plain["q1"] == pytest.approx(compiled["q1"], rel=1e-11)


# Starts and ends
# ---------------------------------------------------------------------------------------------------


def changed(tmp_path, old, new):
    text = FOUR_BAR.read_text()
    assert old in text
    (tmp_path / "changed.yaml").write_text(text.replace(old, new))
    return tmp_path / "changed.yaml"


@pytest.mark.slow
def test_guesses_move_silently_and_held_values_are_reported_when_they_move(tmp_path):
    assert hamel.simulate(FOUR_BAR, time=0.01).moved == {}
    path = changed(tmp_path, "guess: {q2: -30 deg, q3: 100 deg}", "q2: -30 deg, q3: 100 deg")
    found = hamel.simulate(path, time=0.01)
    assert set(found.moved) >= {"q2"}
    assert found.moved["q2"]["given"] == pytest.approx(math.radians(-30))
    assert found.position_violation < 1e-12


def test_a_linkage_that_cannot_close_is_said_where_it_starts(tmp_path):
    path = changed(tmp_path, "l4: {value: 0.55 m", "l4: {value: 5.5 m")
    with pytest.raises(HamelError, match="satisf") as caught:
        hamel.simulate(path)
    assert caught.value.exit_code in (1, 2)
    assert caught.value.diagnostics[0].file == str(path)


@pytest.mark.slow
def test_a_pivot_that_vanishes_on_the_way_is_told():
    crank = hamel.simulate(FOUR_BAR, choice="crank", time=1.0)
    assert crank.crossings == 0 and not crank.switches
    rocker = hamel.simulate(FOUR_BAR, choice="rocker", time=1.0)
    assert (
        rocker.switches[0].left == "rocker" and 0.3 < rocker.switches[0].time < 0.4257
    )  # it is singular there
    assert rocker.final["q1"] == pytest.approx(crank.final["q1"], abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("enforcement", ("feedback", "partitioning", "tangent"))
def test_another_choice_takes_over_whatever_the_enforcement(enforcement: str):
    """Feedback and its like change the equations; those of the other choice are changed alike."""
    crank = hamel.simulate(FOUR_BAR, choice="crank", time=1.0)
    rocker = hamel.simulate(FOUR_BAR, choice="rocker", enforcement=enforcement, time=1.0)
    (switch,) = rocker.switches
    assert (switch.left, switch.entered) == ("rocker", "crank") and switch.time < 0.4257
    assert rocker.final["q1"] == pytest.approx(crank.final["q1"], abs=1e-8)


@pytest.mark.parametrize("value", (0.0, 1.5))
def test_an_input_that_does_not_change_is_among_the_columns(value: float):
    """`hamel identify` asks for the column of every input."""
    motion = hamel.simulate(FOUR_BAR, values={"tau": value}, time=0.1).motion
    assert list(motion["tau"]) == [value] * len(motion["t"])


def test_a_motion_that_ends_is_an_assumption_that_fails(tmp_path):
    text = "model: escape\ncoordinates: {x: m}\nkinetic: der(x)**2/2*1 kg\nforces: {x: x**3*1 N/m^3}\ninitial: {x: 1 m}\n"
    (tmp_path / "escape.yaml").write_text(text)
    with pytest.raises(AssumptionError, match="stopped at t = ") as caught:
        hamel.simulate(tmp_path / "escape.yaml", time=10.0)
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    "options",
    [
        {"time": -1.0},
        {"time": math.inf},
        {"step": 0.0},
        {"rtol": 0.0},
        {"atol": math.nan},
        {"alpha": 0.0, "enforcement": "baumgarte"},
        {"alpha": 1.0, "enforcement": "projection"},
        {"conserve": ["x"], "enforcement": "none"},
        {"values": {"m": -1}},
        {"time": 1e9, "step": 1e-9},
        {"out": "motion.txt"},
        {"plot": "motion.png"},
    ],
    ids=str,
)
def test_numbers_and_files_that_make_no_sense(tmp_path, monkeypatch, options):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ModelError):
        hamel.simulate(SLEIGH, **options)
    assert not list(tmp_path.iterdir())


FREE = "joints: {b: {type: free, parent: ground, child: a, position: [x, y, z], orientation: {euler: zxz, angles: [q1, q2, q3]}}}\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "coordinates: {x: m}\nparameters: {k: 1 kg, e: 0}\nkinetic: k*der(x)^2/e\n",
            "masses and rates of the coordinates finite",
        ),
        (
            "coordinates: {x: m, y: m}\nkinetic: 1 kg*(der(x)^2 + der(y)^2)\n"
            "constraints: {c: {type: prescribed, coordinate: x, motion: 1 m*sqrt(t/(1 s))}}\n",
            "the constraints' rates are not finite at the initial position",
        ),
        (
            "bodies: {a: {mass: 1, inertia: [1, 2, 2.5]}}\n" + FREE,
            "q1, q3 change without bound at the initial position",
        ),
    ],
)
def test_a_start_that_is_not_finite_is_told_by_its_cause(tmp_path, text, said):
    (tmp_path / "start.yaml").write_text(f"model: start\n{text}")
    with pytest.raises(HamelError, match=said):
        hamel.simulate(tmp_path / "start.yaml", time=1.0)


def test_a_motion_that_would_take_all_night_says_so(tmp_path, monkeypatch):
    """Once, with what could help; the motion goes on."""
    monkeypatch.setattr(progress, "SLOW", 0.0)
    monkeypatch.setattr(progress, "LONG", 0.0)
    text = "model: stiff\ncoordinates: {x: m}\nkinetic: der(x)**2/2*1 kg\npotential: x**2*1e10 N/m\ninitial: {x: 1 m}\n"
    (tmp_path / "stiff.yaml").write_text(text)
    with pytest.warns(
        RuntimeWarning, match="s of 1 s are done after .* --integrator radau"
    ) as said:
        hamel.simulate(tmp_path / "stiff.yaml", time=1.0)
    assert len([warning for warning in said if "are done after" in str(warning.message)]) == 1


def test_energy_is_not_held_where_inputs_do_work():
    """At rest the input does nothing and energy is conserved; with it the enforcement would make a
    wrong answer look right."""
    snake = MODELS / "snake3.yaml"
    assert (
        hamel.simulate(
            snake, enforcement="invariants", time=0.5, values={"base.vx": 0.3}
        ).energy_balance
        < 1e-12
    )
    with pytest.raises(AssumptionError, match="energy is not conserved"):
        hamel.simulate(
            snake, enforcement="invariants", time=0.5, values={"base.vx": 0.3, "tau1": 0.01}
        )


TRUSS = """model: truss
plane: xy
gravity: [0, -9.81 m/s^2]
bodies:
  a: {mass: 1 kg, com: [0.5 m, 0], inertia: 0.1 kg*m^2}
  b: {mass: 1 kg, com: [0.5 m, 0], inertia: 0.1 kg*m^2}
joints:
  A: {type: revolute, parent: ground, child: a, coordinate: q1}
  B: {type: revolute, parent: ground, child: b, at: [1 m, 0], coordinate: q2}
closures:
  C: {type: revolute, between: [a, b], at: [[1 m, 0], [1 m, 0]]}
initial: {guess: {q1: 60 deg, q2: 120 deg}}
"""


def test_the_rounding_of_a_structure_at_rest_is_no_energy_that_came_from_nowhere(tmp_path):
    path = tmp_path / "truss.yaml"
    path.write_text(TRUSS, encoding="utf-8")
    record = hamel.simulate(path, time=1.0)
    assert record.final["q1"] == pytest.approx(math.pi / 3)
    assert record.energy_balance == 0.0


@pytest.mark.parametrize(
    ("paces", "stands"),
    [
        ([0.3] + [1e-6 / k**2 for k in range(1, 200)], True),  # to a place it never reaches
        ([1e-8] * 200, False),  # stiff, but it comes on
        ([1e-9 * 1.02**k for k in range(200)], False),  # the worst is over
        ([1.0 / k**2 for k in range(1, 60)], False),
    ],
)
def test_a_motion_that_comes_to_a_standstill_ends(paces: list[float], stands: bool) -> None:
    """Of a delta robot whose platform came free the steps became shorter for ever."""
    watch = Covered(None, 1.0, "m.simulate", 2.0, "")
    ends = (
        pytest.raises(AssumptionError, match=r"no further than t = 2\.3")
        if stands
        else nullcontext()
    )
    with ends:
        for covered in np.cumsum(paces).tolist():
            watch(covered)


CORNER = """model: corner
plane: xy
bodies: {a: {mass: 1 kg, inertia: 0.1}}
joints: {j: {type: revolute, parent: ground, child: a, coordinate: q}}
constraints: {m: {type: prescribed, joint: j, motion: "(1 rad/s)*abs(t - 1 s)"}}
"""


def test_a_blow_ends_a_motion_without_freedom(tmp_path):
    """Other choices, which were tried then, know no way on, either, and did not compile."""
    file = tmp_path / "corner.yaml"
    file.write_text(CORNER)
    with pytest.raises(AssumptionError, match="a prescribed velocity becomes another at once"):
        hamel.simulate(file, time=2.0)
    with pytest.warns(RuntimeWarning, match="scipy_dop853 does not see where constraints"):
        hamel.simulate(file, time=2.0, integrator="scipy_dop853")


BOUNCE = """model: bounce
plane: xz
gravity: [0, -9.81]
bodies: {ball: {mass: 1 kg}}
joints: {j: {type: prismatic, parent: ground, child: ball, axis: z, coordinate: z}}
loads: {floor: {type: expression, joint: j, expression: "(1e5 N/m)*exp(-z/(1 mm))*(1 mm)"}}
initial: {z: 0.5 m}
"""


def test_a_step_of_a_library_that_is_too_long_is_made_again(tmp_path):
    """It leads to forces that no number holds, which ended the motion."""
    file = tmp_path / "bounce.yaml"
    file.write_text(BOUNCE)
    own = hamel.simulate(file, time=1.0)
    other = hamel.simulate(file, time=1.0, integrator="scipy_dop853", rtol=1e-9)
    assert abs(own.final["z"] - other.final["z"]) < 1e-5


def test_stages_that_do_not_converge_are_no_constraints(tmp_path):
    """Of a model that has none it was said that its state could not be put back on them."""
    file = tmp_path / "dry.yaml"
    file.write_text(
        "model: dry\ncoordinates: {x: m}\nkinetic: 1 kg*der(x)^2/2\npotential: 5 N/m*x^2\n"
        'forces: {x: "(-2 N)*sign(der(x))"}\ninitial: {x: 0.95 m}\n'
    )
    with pytest.raises(AssumptionError, match="the stages of an implicit step do not converge"):
        hamel.simulate(file, time=3.0, integrator="radau")


STIFF = """model: two_masses
coordinates: {x: m, y: m}
parameters: {k: 1e6 N/m, c: 0 N*s/m}
kinetic: 1 kg*(der(x)^2 + der(y)^2)/2
potential: k/2*(x - y)^2 + 5 N/m*x^2
forces: {x: -c*(der(x) - der(y)), y: c*(der(x) - der(y))}
initial: {x: 1 m, y: 1 m}
"""


@pytest.mark.parametrize("integrator", ["implicit_midpoint", "radau"])
def test_equal_implicit_steps_of_stiff_springs_converge_as_far_as_rounding_lets(
    integrator, tmp_path
):
    """The stages were asked for more digits than slopes have where large forces cancel."""
    file = tmp_path / "two_masses.yaml"
    file.write_text(STIFF)
    for values in ({}, {"k": 1e12}, {"k": 1e6, "c": 1e6}, {"k": 1e12, "c": 1e6}):
        found = hamel.simulate(
            file, time=1.0, integrator=integrator, step_size=1e-3, step=0.5, values=values
        )
        assert found.motion["x"][-1] == pytest.approx(math.cos(math.sqrt(5)), abs=2e-5)


SWING = """model: swing
coordinates: {th: rad}
kinetic: 1 kg*m^2*der(th)^2/2
potential: (-9.81 N*m)*cos(th)
initial: {th: 3 rad}
"""


def test_a_step_that_is_too_long_for_its_stages_is_told(tmp_path):
    file = tmp_path / "swing.yaml"
    file.write_text(SWING)
    with pytest.raises(AssumptionError, match="the step is too long there") as refused:
        hamel.simulate(file, time=10.0, integrator="implicit_midpoint", step_size=0.5)
    assert "shorter steps" in str(refused.value)


def test_a_motion_of_one_equal_step_has_no_estimate(tmp_path):
    """Its companion took the same step, and the error was said to be rounding."""
    file = tmp_path / "swing.yaml"
    file.write_text(SWING)
    one, two = (
        hamel.simulate(file, time=1.0, integrator="rk4", step_size=size, step=1.0)
        for size in (1.0, 0.5)
    )
    assert one.steps == 1 and one.error is None
    assert two.steps == 2 and two.error is not None and two.error > 1e-2


BOUNCE_ONCE = """model: bounce
plane: xy
gravity: [0, -10 m/s^2]
bodies: {ball: {mass: 1 kg}}
joints: {j: {type: point, parent: ground, child: ball, coordinates: [x, y]}}
loads: {floor: {type: contact, body: ball, at: [0, 0], plane: {normal: [0, 1]}, stiffness: 1e9 N/m}}
initial: {y: 1 m}
"""
RUBBED_FROM_REST = """model: rubbed
coordinates: {x: m}
kinetic: 1 kg*der(x)^2/2
potential: 50 N/m*x^2
forces: {x: (-5 N)*sign(der(x))}
initial: {x: 1 m}
"""


def test_series_end_at_pieces_as_exactly_as_they_are(tmp_path):
    """What was left of a step was carried on by a slope, which long steps know little of."""
    file = tmp_path / "bounce.yaml"
    file.write_text(BOUNCE_ONCE)
    k, g = 1e9, 10.0
    w, v = math.sqrt(k), math.sqrt(2 * g)
    contact = 2 * (math.pi / 2 + math.atan(g / (w * v))) / w
    flight = 0.8 - v / g - contact
    found = hamel.simulate(file, time=0.8, step=0.8, integrator="taylor")
    assert found.motion["y"][-1] == pytest.approx(v * flight - g * flight**2 / 2, abs=1e-9)
    assert found.motion["y_dot"][-1] == pytest.approx(v - g * flight, abs=1e-9)


def test_series_begin_at_a_jump(tmp_path):
    """Steps became as long as the tolerance lets, from above, for ever: sticking, it was said."""
    file = tmp_path / "rubbed.yaml"
    file.write_text(RUBBED_FROM_REST)
    found = hamel.simulate(file, time=0.5, step=0.5, integrator="taylor", rtol=1e-9)
    turned = -0.9  # about 0.05 m, then about −0.05 m
    assert found.motion["x"][-1] == pytest.approx(
        -0.05 + (turned + 0.05) * math.cos(10 * 0.5 - math.pi), abs=1e-9
    )


def test_auto_leaves_a_series_whose_steps_become_too_small(tmp_path):
    """With masses of 1 and 1e9 kg the high terms of the series are rounding."""
    file = tmp_path / "whip.yaml"
    file.write_text(
        "model: whip\nplane: xy\ngravity: [0, -9.81 m/s^2]\n"
        "bodies: {a: {mass: 1 kg, com: [0, -1]}, b: {mass: 1e9 kg, com: [0, -1]}}\n"
        "joints:\n  A: {type: revolute, parent: ground, child: a, coordinate: q1}\n"
        "  B: {type: revolute, parent: a, child: b, at: [0, -1], coordinate: q2}\n"
        "initial: {q1: 1 rad, q2: 0.5 rad, der(q1): 0.3 rad/s}\n"
    )
    with pytest.raises(AssumptionError, match="too small"):
        hamel.simulate(file, time=0.3, integrator="taylor", rtol=1e-9)
    found = hamel.simulate(file, time=0.3, integrator="auto", rtol=1e-9)
    assert found.integrator == "verner9" and "its series" in found.why
    both = hamel.simulate(file, time=0.3, integrator="dop853", rtol=1e-9)
    assert found.motion["q2"][-1] == pytest.approx(both.motion["q2"][-1], abs=1e-6)
