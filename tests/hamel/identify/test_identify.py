"""Base parameters have the counts by the rule of the literature, and noisy motions give them back.

Of derive.mechanics.regression: regrouping.
Of hamel.identify: base, estimate, excitation, fit, limits, measured, page, writing.
Of hamel.verbs: identify.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import nnls

import hamel
from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import equations
from derive.formulations.evaluate import function_of
from derive.model import load, load_text
from derive.states import system
from hamel.identify.base import base_parameters
from hamel.identify.estimate import ordinary, rows_of, weighted
from hamel.identify.excitation import Bounds, within
from hamel.identify.fit import own_values
from hamel.identify.measured import at_rows, measured

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "identification.md").read_text("utf-8")
PUMA = PAGE.split("```yaml\n")[1].split("```")[0]
ARM = """
model: arm
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l: 0.5 m}
bodies:
  upper: {mass: 2 kg, com: [0.2 m, 0.01 m], inertia: 0.04}
  lower: {mass: 1 kg, com: [0.15 m, -0.02 m], inertia: 0.02}
joints:
  A: {type: revolute, parent: ground, child: upper, coordinate: q1, limits: [-2, 2]}
  B: {type: revolute, parent: upper, child: lower, at: [l, 0], coordinate: q2, limits: [-1, 2]}
inputs: {tau1: {joint: A}, tau2: {joint: B}}
loads: {rub: {type: friction, joint: A, viscous: 0.1, coulomb: 0.3 N*m, smoothing: 0.05 rad/s}}
"""
CARTS = """
model: carts
plane: xy
bodies: {c1: {mass: 1 kg}, c2: {mass: 1 kg}}
joints:
  A: {type: prismatic, parent: ground, child: c1, axis: x, coordinate: x1}
  B: {type: prismatic, parent: ground, child: c2, axis: x, coordinate: x2}
inputs: {u1: {joint: A}, u2: {joint: B}}
loads:
  d: {type: damper, joint: A, coefficient: 1 N*s/m}
  e: {type: damper, joint: B, coefficient: 1 N*s/m}
"""


def write(file: Path, names: list[str], rows: np.ndarray) -> None:
    np.savetxt(file, rows, delimiter=",", header=",".join(names), comments="")


@pytest.fixture(scope="module")
def motion(tmp_path_factory):
    """The model file, and the columns of a motion with forces without noise."""
    folder = tmp_path_factory.mktemp("arm")
    model, data = folder / "arm.yaml", folder / "data.csv"
    model.write_text(ARM)
    hamel.excitation(model, data, period=5.0, harmonics=3, rate=40.0)
    rows = np.loadtxt(data, delimiter=",", skiprows=1)
    names = data.read_text().splitlines()[0].split(",")
    found = equations(system(load(str(model))))
    inverse, idle = function_of(found, "inverse_dynamics"), np.zeros((len(rows), 2))
    tau = at_rows(inverse, rows[:, 0], rows[:, 1:], idle, found.parameters)[:, :, 0]
    return model, found, [*names, "tau1", "tau2"], np.hstack([rows, tau])


@pytest.mark.parametrize("text, count", [(PUMA, 36), (ROOT / "models" / "stanford_arm.yaml", 33)])
def test_the_base_parameters_of_serial_arms_are_told_by_structure(text, count):
    """36 of the Puma 560 and 33 of the Stanford arm, inertial parameters alone, the first axis
    along gravity: 7 of each turning joint and 4 of each sliding one, less 6 of the first."""
    model = load_text(text) if isinstance(text, str) else load(str(text))
    found = base_parameters(equations(system(model)))
    assert (len(found.standard), found.by_structure, len(found.leading)) == (60, count, count)
    assert found.kept > 1e-3


def test_loops_leave_fewer_by_rank():
    """Eight of the four-bar's twelve inertial ones, and its damper."""
    found = base_parameters(equations(system(load(str(ROOT / "models" / "four_bar.yaml")))))
    assert (found.by_structure, len(found.leading)) == (10, 9)
    assert found.kept > 1e-4 and found.dropped < 1e-12


@pytest.mark.slow
def test_the_stewart_platform_is_told_by_rank():
    file = ROOT / "models" / "gallery" / "stewart.yaml"
    found = base_parameters(equations(system(load(str(file)))))
    assert (len(found.standard), found.by_structure, len(found.leading)) == (130, 76, 70)
    assert found.kept > 1e-4 and found.dropped < 1e-12


def test_the_base_parameters_give_the_same_forces(motion, tmp_path):
    """Y π = Y_b b at motions that were not used to find them."""
    _, found, names, rows = motion
    write(tmp_path / "a.csv", names, rows)
    base = base_parameters(found)
    there = rows_of(found, base, measured(found, tmp_path / "a.csv", None))
    left = there.y - there.A @ (base.combination @ own_values(found))
    assert np.abs(left).max() < 1e-11
    assert "mx_upper + l m_lower" in base.sums and "Izz_upper + l^2 m_lower" in base.sums


def test_noise_of_one_per_cent_gives_values_within_their_deviations(motion, tmp_path):
    """Three standard deviations hold 99 % of the values of many draws, both ways of weighting."""
    _, found, names, rows = motion
    write(tmp_path / "a.csv", names, rows)
    rng, base = np.random.default_rng(0), base_parameters(found)
    wanted = base.combination @ own_values(found)
    clean = rows_of(found, base, measured(found, tmp_path / "a.csv", None))
    size = 0.01 * np.sqrt(np.mean(clean.y**2, axis=0))
    inside = {ordinary: [], weighted: []}
    for _ in range(60):
        noisy = type(clean)(clean.t, clean.A, clean.y + size * rng.normal(size=clean.y.shape))
        for way, hits in inside.items():
            estimate = way(noisy)
            hits.extend(np.abs(estimate.values - wanted) < 3.0 * estimate.deviations)
    assert all(np.mean(hits) >= 0.99 for hits in inside.values())


@pytest.mark.parametrize("cutoff", [6.0, 12.0, 16.0])
def test_deviations_count_what_the_filter_leaves_from_row_to_row(motion, tmp_path, cutoff):
    """Noise of the forces that was white is not white behind the filter: values scatter by their
    deviations whatever its cutoff. At 12 of 20 Hz they were told to be a quarter better known."""
    _, found, names, rows = motion
    write(tmp_path / "a.csv", [*names[:3], *names[-2:]], rows[:, [0, 1, 2, -2, -1]])
    rng, base = np.random.default_rng(0), base_parameters(found)
    seen = measured(found, tmp_path / "a.csv", cutoff)
    clean, low = rows_of(found, base, seen), seen.filter
    size = 0.01 * np.sqrt(np.mean(clean.y**2, axis=0))
    inside = slice(low.ends, len(rows) - low.ends, low.every)
    apart = []
    for _ in range(150):
        noise = low(size * rng.normal(size=(len(rows), 2)))[inside]
        estimate = weighted(replace(clean, y=clean.A @ ordinary(clean).values + noise))
        apart.append((estimate.values - ordinary(clean).values) / estimate.deviations)
    assert np.std(apart) == pytest.approx(1.0, abs=0.08)
    assert np.mean(np.abs(apart) < 3.0) >= 0.99


def test_positions_alone_are_filtered_and_predict_another_motion(motion, tmp_path):
    """Noise on encoders and forces; a motion that was not fitted is predicted to 3 %."""
    model, _, names, rows = motion
    rng = np.random.default_rng(1)
    write(tmp_path / "check.csv", names, rows)
    noisy = rows[:, [0, 1, 2, -2, -1]].copy()
    noisy[:, 1:3] += 1e-5 * rng.normal(size=(len(rows), 2))
    noisy[:, 3:] *= 1.0 + 0.01 * rng.normal(size=(len(rows), 2))
    data, page = tmp_path / "a.csv", tmp_path / "page.html"
    write(data, ["t", "q1", "q2", "tau1", "tau2"], noisy)
    record = hamel.identify(model, data, check=tmp_path / "check.csv", cutoff=8.0, page=page)
    assert max(record.check_residuals) < 0.03
    assert any("Butterworth" in note for note in record.notes)
    text = page.read_text("utf-8")
    assert "<svg" in text and "↑ N m<" in text and "N or N m" not in text
    assert 'table class="base"' in text and "overflow-wrap: anywhere" in text  # sums are long


def test_the_written_model_is_physical_and_has_the_values(motion, tmp_path):
    """Consistent values lie in the cone; those told by the motion are the ones fitted."""
    pytest.importorskip("clarabel")
    model, _, names, rows = motion
    write(tmp_path / "a.csv", names, rows)
    out = tmp_path / "identified.yaml"
    record = hamel.identify(model, tmp_path / "a.csv", out=out)
    assert max(record.residuals) < 1e-4
    again = hamel.identify(out, tmp_path / "a.csv")
    for x, y in zip(record.base, again.base):
        assert x.consistent is not None and y.file is not None
        assert y.file == pytest.approx(x.consistent, rel=1e-6, abs=1e-9)
    assert all(x.value is not None and x.value > 0 for x in record.standard if x.name[:2] == "m_")


def test_what_a_joint_itself_is_given_is_written_into_the_joint(motion, tmp_path):
    """Friction, damper and armature in the joint, of which the motion has the friction alone."""
    pytest.importorskip("clarabel")
    _, _, names, rows = motion
    law = "friction: {viscous: 0 N*m*s/rad, coulomb: 1 N*m, smoothing: 0.05 rad/s}"
    text = ARM.replace("q1,", f"q1, {law},").replace("q2,", "q2, damper: 1, armature: 0.1,")
    (tmp_path / "arm.yaml").write_text("\n".join(text.splitlines()[:-1]))
    write(tmp_path / "a.csv", names, rows)
    hamel.identify(tmp_path / "arm.yaml", tmp_path / "a.csv", out=tmp_path / "out.yaml")
    again = hamel.identify(tmp_path / "out.yaml", tmp_path / "a.csv")
    found = {x.name: x.file for x in again.base}
    wanted = {"A_friction_viscous": 0.1, "A_friction_coulomb": 0.3, "B_damper": 0, "B_armature": 0}
    assert {name: found[name] for name in wanted} == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("noise", [0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize(
    "truth",
    [(2.5, 0.7, 1.5, 0.4), (2.5, -0.7, 1.5, 0.4), (-1, 0.7, 1.5, 0.4), (2.5, -0.7, -1, 0.4)],
)
def test_consistent_values_do_not_depend_on_how_unlike_the_noise_is(tmp_path, truth, noise):
    """Two carts that know nothing of each other, one with a noise of 0.5 N: of each, least squares
    without negative mass and damping are found by another method, one cart at a time."""
    pytest.importorskip("clarabel")
    (tmp_path / "carts.yaml").write_text(CARTS)
    t, rng = np.arange(0.0, 5.0, 0.01), np.random.default_rng(0)
    carts = [np.column_stack([-w * np.sin(w * t), np.cos(w * t)]) for w in (2.0, 3.0)]
    forces = [A @ m + n * rng.normal(size=len(t)) for A, m, n in
              zip(carts, (truth[:2], truth[2:]), (0.5, noise))]  # fmt: skip
    x = [np.sin(w * t) / w for w in (2.0, 3.0)]
    head = ["t", "x1", "x2", "der(der(x1))", "der(x1)", "der(der(x2))", "der(x2)", "u1", "u2"]
    write(tmp_path / "a.csv", head, np.column_stack([t, *x, *carts, *forces]))
    record = hamel.identify(tmp_path / "carts.yaml", tmp_path / "a.csv")
    found = {x.name: x for x in record.base}
    for A, force, names in zip(carts, forces, (("m_c1", "d"), ("m_c2", "e"))):
        for value, name in zip(nnls(A, force)[0], names):
            deviation = found[name].deviation
            assert found[name].consistent == pytest.approx(value, abs=1e-8 + 0.1 * deviation)
    if min(truth) > 0.0:
        assert all(x.consistent == pytest.approx(x.weighted, rel=1e-12) for x in record.base)


def test_first_order_states_that_act_on_no_force_change_nothing(motion, tmp_path):
    _, _, names, rows = motion
    write(tmp_path / "data.csv", names, rows)
    found = []
    for more in ("", "states: {f: {rate: (q1 - f)/(0.1 s), initial: 0.3 rad}}\n"):
        (tmp_path / "arm.yaml").write_text(ARM + more)
        record = hamel.identify(tmp_path / "arm.yaml", tmp_path / "data.csv")
        found.append([x.weighted for x in record.base])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9, atol=1e-12)


def test_first_order_states_that_act_are_refused_by_name(motion, tmp_path):
    _, _, names, rows = motion
    write(tmp_path / "data.csv", names, rows)
    late = ARM.replace("tau1: {joint: A}", "tau1: {joint: A, delay: 20 ms}")
    (tmp_path / "arm.yaml").write_text(late)
    with pytest.raises(AssumptionError, match="depend on first-order states"):
        hamel.identify(tmp_path / "arm.yaml", tmp_path / "data.csv")


def test_series_keep_the_limits_of_joints(motion):
    _, _, names, rows = motion
    q = rows[:, [names.index("q1"), names.index("q2")]]
    assert (q.max(axis=0) <= 2.0).all() and (q.min(axis=0) >= [-2.0, -1.0]).all()


@pytest.mark.parametrize("harmonics", [1, 5, 30])
def test_series_keep_the_speed_between_points_too(harmonics):
    """Speeds are looked at at some times; at all others they are below the bound as well."""
    coefficients = np.random.default_rng(0).normal(size=(2, 50, harmonics))
    wide = Bounds(-1e3 * np.ones(50), 1e3 * np.ones(50), 2.0)
    _, rate, _ = within(coefficients, 1.0, wide).motion(np.linspace(0.0, 2.0 * np.pi, 20011))
    assert np.abs(rate).max() <= 2.0 and np.abs(rate).max(axis=0).min() > 1.998


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda names, rows: (["s", *names[1:]], rows), "no column 't'"),
        (lambda names, rows: ([*names[:-1], "tau"], rows), "no column 'tau2'"),
        (lambda names, rows: (names, rows[::-1]), "even steps"),
        (lambda names, rows: (names, rows[:5]), "5 rows"),
        (lambda names, rows: (names, rows[:1]), "one row"),
        (lambda names, rows: (["t", "t", *names[2:]], rows), "there twice"),
        (lambda names, rows: (names[:-1], rows), "than there are names"),
    ],
)
def test_files_that_are_wrong_are_refused(motion, tmp_path, change, message):
    _, found, names, rows = motion
    write(tmp_path / "a.csv", *change(names, rows))
    with pytest.raises(ModelError, match=message):
        measured(found, tmp_path / "a.csv", None)


def test_only_coordinates_that_loops_tell_may_be_missing(motion, tmp_path):
    """One without a column does not stand still: a loop has to tell it, and one loop tells one."""
    _, found, names, rows = motion
    write(tmp_path / "a.csv", ["t", "q1", *names[-2:]], rows[:, [0, 1, -2, -1]])
    with pytest.raises(ModelError, match="no column 'q2', which no loop tells; it has t, q1"):
        measured(found, tmp_path / "a.csv", None)
    tie = "constraints: {tie: {holonomic: x1 + 2*x2 - x3}}"
    slide = "  C: {type: prismatic, parent: c2, child: c3, axis: x, coordinate: x3}\ninputs"
    text = CARTS.replace("c2: {mass: 1 kg}", "c2: {mass: 1 kg}, c3: {mass: 1 kg}") + tie
    tied = equations(system(load_text(text.replace("inputs", slide))))
    motions = rows[:, [0, 1, 2, -2, -1]]
    write(tmp_path / "b.csv", ["t", "x1", "x2", "u1", "u2"], motions)
    q = measured(tied, tmp_path / "b.csv", None).q
    assert q[:, 2] == pytest.approx(q[:, 0] + 2.0 * q[:, 1])
    write(tmp_path / "c.csv", ["t", "x1", "x", "u1", "u2"], motions)
    with pytest.raises(ModelError, match="'x2' and 'x3', coordinates of which the loops tell 1"):
        measured(tied, tmp_path / "c.csv", None)


def test_a_motion_that_constraints_decide_is_told_as_that(tmp_path):
    """There is a body with a mass, and it moves."""
    (tmp_path / "a.yaml").write_text(CARTS + """
constraints:
  a: {type: prescribed, coordinate: x1, motion: (1 m)*sin((2 rad/s)*t)}
  b: {holonomic: x2 - x1}
""")  # fmt: skip
    with pytest.raises(AssumptionError, match="carts has no freedom: its constraints decide"):
        hamel.base_parameters(tmp_path / "a.yaml")


def test_a_motion_that_tells_nothing_is_refused(motion, tmp_path):
    """At rest only weights are felt."""
    _, found, names, rows = motion
    still = rows.copy()
    still[:, 1:3], still[:, 3:7] = still[0, 1:3], 0.0
    write(tmp_path / "a.csv", names, still)
    with pytest.raises(
        AssumptionError, match=rf"(?s)nothing moves .* all {len(rows)} rows .*excite"
    ):
        ordinary(rows_of(found, base_parameters(found), measured(found, tmp_path / "a.csv", None)))


def test_loops_have_no_series(tmp_path):
    with pytest.raises(AssumptionError, match="trees"):
        hamel.excitation(ROOT / "models" / "four_bar.yaml", tmp_path / "x.csv")


@pytest.mark.parametrize("noise", (0.0, 1e-5))
def test_a_small_fast_part_of_a_long_way_is_not_filtered_away(tmp_path: Path, noise: float):
    """A ramp holds nearly all of the power, and none of the accelerations."""
    t, random = np.arange(1000) / 500.0, np.random.default_rng(0)
    q1 = 10.0 * t + 0.01 * np.sin(2.0 * np.pi * 30.0 * t)
    rows = np.column_stack([t, q1, 0.0 * t, 0.0 * t, 0.0 * t])
    rows[:, 1:3] += noise * random.normal(size=(len(t), 2))
    path = tmp_path / "data.csv"
    np.savetxt(path, rows, delimiter=",", header="t,q1,q2,tau1,tau2", comments="")
    low = measured(equations(system(load_text(ARM))), path, None).filter
    assert low is not None and low.cutoff > 40.0
    assert noise == 0.0 or low.cutoff < 100.0


@pytest.mark.slow
def test_what_was_simulated_is_found_again(tmp_path: Path):
    model, data = ROOT / "models" / "four_bar.yaml", tmp_path / "data.csv"
    hamel.simulate(model, time=2.0, values={"tau": 0.5}, out=data)
    record = hamel.identify(model, data)
    assert max(record.residuals) < 0.02 and not any("trusted" in note for note in record.notes)
    slow = hamel.identify(model, data, cutoff=20.0)
    assert any("not to be trusted" in note for note in slow.notes)


ASKEW = """
model: askew
gravity: [0, 0, -9.81 m/s^2]
bodies:
  a: {mass: 2 kg, com: [0, 0.02, 0.15], inertia: [0.02, 0.021, 0.004]}
  b: {mass: 1.5 kg, com: [0.2, 0, 0.01], inertia: [0.003, 0.02, 0.02]}
  c: {mass: 0.6 kg, com: [0.1, 0.02, 0], inertia: [0.001, 0.004, 0.004, 0.0002, 0, 0]}
joints:
  J1: {type: revolute, parent: ground, child: a, axis: z, coordinate: q1}
  J2: {type: revolute, parent: a, child: b, axis: y, at: [0, 0, 0.3], coordinate: q2}
  J3: {type: revolute, parent: b, child: c, axis: [0.6, 0.8, 0], at: [0.4, 0, 0], coordinate: q3}
inputs: {u1: {joint: J1}, u3: {joint: J3}}
"""


def test_base_parameters_have_names_of_their_own(tmp_path: Path) -> None:
    """Two were Ixx_c, and a reader by name lost one."""
    path = tmp_path / "askew.yaml"
    path.write_text(ASKEW)
    names = [x.name for x in hamel.base_parameters(path).base]
    assert len(set(names)) == len(names)


def test_joints_that_no_input_moves_are_told(tmp_path: Path) -> None:
    path = tmp_path / "askew.yaml"
    path.write_text(ASKEW)
    words = {"period": 5.0, "harmonics": 2, "rate": 10.0}
    assert hamel.excitation(path, tmp_path / "x.csv", **words).undriven == ("q2",)
    path.write_text(ASKEW.replace("inputs: {u1: {joint: J1}, u3: {joint: J3}}", ""))
    assert hamel.excitation(path, tmp_path / "x.csv", **words).undriven == ()
