"""Free parameters by multiple shooting: noisy motions give them back, and what cannot be is told.

Of hamel.identify: shooting, variation.
"""

from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, ModelError
from derive.formulations.frames import based
from hamel.build.module import temporary_module
from hamel.build.stages import equations_of
from hamel.identify import shooting
from hamel.identify.measured import recorded
from hamel.identify.variation import is_continuous, varied

ARM = """
model: arm
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l: 0.5 m, k: 3 N*m/rad^3, mu: 0.1 N*m, s: 0.2 rad/s, tau: 0.1 s, idle: 1}
bodies: {rod: {mass: 1 kg, com: [0, -l], inertia: 0.02}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
inputs: {u: {unit: N*m}}
states: {act: {rate: (u - act)/tau, initial: 0 N*m}}
loads: {all: {type: expression, joint: hinge, expression: act - k*q^3 - mu*tanh(der(q)/s)}}
initial: {q: 30 deg}
outputs: {unused: idle}
"""
TRUE = {"l": 0.45, "k": 2.2, "mu": 0.25, "tau": 0.06}
NOISE = 0.002


def write(file: Path, names: str, *columns: np.ndarray) -> Path:
    np.savetxt(file, np.column_stack(columns), delimiter=",", header=names, comments="")
    return file


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    file = tmp_path / "arm.yaml"
    file.write_text(ARM, encoding="utf-8")
    return file


def test_what_the_file_or_the_model_does_not_have_is_told(arm: Path, tmp_path: Path) -> None:
    t = np.linspace(0, 1, 40)
    file = write(tmp_path / "data.csv", "t,u,q", t, t, t)
    with pytest.raises(ModelError, match="'ka' is no parameter of arm"):
        hamel.free_parameters(arm, file, ["ka"])
    with pytest.raises(ModelError, match="'k' is named twice"):
        hamel.free_parameters(arm, file, ["k", "l", "k"])
    with pytest.raises(ModelError, match="whose filter reaches over all 1 s"):
        hamel.free_parameters(arm, file, ["k"], cutoff=0.001)
    with pytest.raises(ModelError, match="0 segments"):
        hamel.free_parameters(arm, file, ["k"], segments=0)
    with pytest.raises(ModelError, match="no column 'u', an input"):
        hamel.free_parameters(arm, write(tmp_path / "b.csv", "t,q", t, t), ["k"])
    with pytest.raises(ModelError, match="measures nothing of the motion"):
        hamel.free_parameters(arm, write(tmp_path / "c.csv", "t,u,Q", t, t, t), ["k"])


@pytest.mark.slow
def test_a_parameter_that_no_formula_uses_is_told_before_anything_is_built(tmp_path: Path) -> None:
    """It was "the motion does not tell 'spare'": another motion would not either."""
    file, t = tmp_path / "arm.yaml", np.linspace(0, 1, 40)
    file.write_text(ARM.replace("idle: 1}", "idle: 1, spare: 2 m}"), encoding="utf-8")
    data = write(tmp_path / "data.csv", "t,u,q", t, t, t)
    with pytest.raises(AssumptionError, match="no formula of the motion of arm uses 'spare'"):
        hamel.free_parameters(file, data, ["l", "spare"])


def test_noisy_positions_give_the_parameters_back(arm: Path, tmp_path: Path) -> None:
    """A length, a cubic spring, friction and the time constant of a state, from one angle; and what
    has no effect is named."""
    t = np.linspace(0.0, 5.0, 501)
    u = 2.0 * np.sin(3.0 * t) + np.sin(7.3 * t)
    how = {"time": 5.0, "step": 0.01, "inputs": {"u": (t, u)}, "rtol": 1e-11}
    q = hamel.simulate(arm, values=TRUE, **how).motion["q"]
    noisy = q + NOISE * np.random.default_rng(1).normal(size=len(t))
    file = write(tmp_path / "data.csv", "t,u,q", t, u, noisy)
    result = hamel.free_parameters(arm, file, list(TRUE))
    for parameter in result.parameters:
        apart = abs(parameter.value - TRUE[parameter.name])
        assert apart < 3.0 * parameter.deviation < 0.02 * parameter.value
    assert result.measured["q"] == pytest.approx(NOISE, rel=0.15)
    assert result.gap < 1e-4
    with pytest.raises(AssumptionError, match="does not tell 'idle'"):
        hamel.free_parameters(arm, file, ["k", "idle"])


TWO_LINKS = """
model: two_links
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l1: 0.4 m, l2: 0.3 m, m1: 2 kg, m2: 1 kg, d: 0.3 N*m*s}
bodies:
  A: {mass: m1, com: [l1/2, 0.01 m], inertia: m1*l1^2/12}
  B: {mass: m2, com: [l2/2, 0], inertia: m2*l2^2/12}
joints:
  J1: {type: revolute, parent: ground, child: A, coordinate: q1}
  J2: {type: revolute, parent: A, child: B, at: [l1, 0], coordinate: q2}
loads: {f1: {type: damper, joint: J1, coefficient: d}}
inputs: {t1: {joint: J1}, t2: {joint: J2}}
"""


def sines(t: np.ndarray, *terms: tuple[float, float, float]) -> tuple[np.ndarray, ...]:
    """Σ A sin(ω t + φ) with its two derivatives."""
    values = [(A * np.sin(w * t + f), A * w * np.cos(w * t + f)) for A, w, f in terms]
    accelerations = [-A * w**2 * np.sin(w * t + f) for A, w, f in terms]
    return (*map(sum, zip(*values)), sum(accelerations))


def turned(angle: np.ndarray, x: float, y: float) -> np.ndarray:
    return np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])


def torques(q1, q2, l1: float, m1: float, d: float) -> tuple[np.ndarray, np.ndarray]:
    """Newton and Euler's, of angles with their two derivatives; the rest as in the file."""

    def moved(p, v, a, x: float, y: float) -> np.ndarray:
        return turned(p, -a * y - v**2 * x, a * x - v**2 * y)

    def moment(r: np.ndarray, f: np.ndarray) -> np.ndarray:
        return r[0] * f[1] - r[1] * f[0]

    p = [a + b for a, b in zip(q1, q2)]
    up = np.array([[0.0], [9.81]])
    first, joint = moved(*q1, l1 / 2, 0.01), moved(*q1, l1, 0.0)
    f2 = joint + moved(*p, 0.15, 0.0) + up
    f1 = m1 * (first + up)
    t2 = 0.3**2 / 12 * p[2] + moment(turned(p[0], 0.15, 0.0), f2)
    own = m1 * l1**2 / 12 * q1[2] + moment(turned(q1[0], l1 / 2, 0.01), f1)
    return t2 + own + moment(turned(q1[0], l1, 0.0), f2) + d * q1[1], t2


def arm_and_data(tmp_path: Path) -> tuple[Path, Path]:
    model = tmp_path / "two_links.yaml"
    model.write_text(TWO_LINKS, encoding="utf-8")
    t = np.arange(0.0, 6.0, 0.005)
    q1 = sines(t, (0.9, 2.0, 0.0), (0.4, 5.3, 1.0))
    q2 = sines(t, (1.1, 3.1, 0.3), (0.3, 7.0, 2.0))
    forces = torques(q1, q2, 0.43, 2.5, 0.45)
    names = "t,q1,q2,der(q1),der(q2),t1,t2"
    data = write(tmp_path / "data.csv", names, t, q1[0], q2[0], q1[1], q2[1], *forces)
    return model, data


@pytest.mark.slow
@pytest.mark.parametrize("segments", [10, 12])
def test_values_are_found_from_far_away(tmp_path: Path, segments: int) -> None:
    """A tenth off in a length, a fifth in a mass, a third in a damper; the digits that are left are
    those of inputs that are straight from row to row."""
    model, data = arm_and_data(tmp_path)
    found = hamel.free_parameters(model, data, ["l1", "m1", "d"], segments=segments)
    values = [x.value for x in found.parameters]
    np.testing.assert_allclose(values, [0.43, 2.5, 0.45], rtol=3e-4)
    assert not found.notes


@pytest.mark.slow
def test_values_that_do_not_explain_the_motion_are_doubted(tmp_path: Path) -> None:
    model, data = arm_and_data(tmp_path)
    found = hamel.free_parameters(model, data, ["d"], segments=30)
    assert "much of" in found.notes[0] and "not to be trusted" in found.notes[0]


FOUR_BAR = """
model: loop
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {k: 2 N*m/rad}
bodies:
  crank: {mass: 1 kg, com: [0.1 m, 0], inertia: 0.01}
  rod: {mass: 1 kg, com: [0.2 m, 0], inertia: 0.02}
  rocker: {mass: 1 kg, com: [0.15 m, 0], inertia: 0.02}
joints:
  A: {type: revolute, parent: ground, child: crank, coordinate: q1}
  B: {type: revolute, parent: crank, child: rod, at: [0.2 m, 0], coordinate: q2}
  D: {type: revolute, parent: ground, child: rocker, at: [0.4 m, 0], coordinate: q3}
closures: {C: {type: revolute, between: [rod, rocker], at: [[0.4 m, 0], [0.3 m, 0]]}}
loads: {spring: {type: expression, joint: A, expression: -k*(q1 - 1)^3}}
initial: {q1: 60 deg, guess: {q2: -30 deg, q3: 100 deg}}
"""


@pytest.mark.slow
def test_a_loop_gives_its_spring_back(tmp_path: Path) -> None:
    model = tmp_path / "loop.yaml"
    model.write_text(FOUR_BAR, encoding="utf-8")
    true = hamel.simulate(model, time=1.0, step=0.005, values={"k": 3.0}, rtol=1e-11).motion
    file = write(tmp_path / "data.csv", "t,q1", true["t"], true["q1"])
    (k,) = hamel.free_parameters(model, file, ["k"], segments=4).parameters
    assert k.value == pytest.approx(3.0, rel=1e-6)


PLANTED = """
model: planted
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l: 0.5 m, r: 0.3 m, k: 3 N*m/rad^3, tau: 0.1 s}
bodies:
  crank: {mass: 1 kg, com: [0.1 m, 0], inertia: 0.01}
  rod: {mass: 1 kg, com: [l/2, 0], inertia: 0.02}
  slider: {mass: 2 kg}
joints:
  A: {type: revolute, parent: ground, child: crank, coordinate: q1}
  B: {type: revolute, parent: crank, child: rod, at: [r, 0], coordinate: q2}
  S: {type: prismatic, parent: ground, child: slider, axis: x, coordinate: s}
closures: {C: {type: revolute, between: [rod, slider], at: [[l, 0], [0, 0]]}}
inputs: {u: {unit: N*m}}
states: {act: {rate: (u - act)/tau + der(s)*(1 N), initial: 0 N*m}}
loads: {all: {type: expression, joint: A, expression: act - k*q1^3 - (0.3 N*m*s)*abs(der(q1))*q1}}
outputs: {tip: "position(rod, [l, 0])"}
initial: {q1: 60 deg, guess: {q2: -90 deg, s: 0.5 m}}
"""


@pytest.mark.slow
def test_slopes_are_those_of_the_motion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Integrated with the motion, by lengths of a loop, a stiffness and the lag of a state, through
    kinks; against differences of motions, which know nothing of them."""
    model = tmp_path / "planted.yaml"
    model.write_text(PLANTED, encoding="utf-8")
    t, free = np.linspace(0.0, 0.6, 61), ["l", "r", "k", "tau"]
    u = np.sin(9.0 * t)
    true = hamel.simulate(model, time=0.6, step=0.01, inputs={"u": (t, u)}).motion
    columns = [true[name] for name in ("s", "der(q2)", "tip[1]", "act")]
    data = write(tmp_path / "data.csv", "t,u,s,der(q2),tip[1],act", t, u, *columns)
    equations = based(equations_of(model, None))
    motion = recorded(equations, data, None)
    whole = varied(equations, free, shooting.scales_of(equations, free).tolist())
    with (
        temporary_module(equations, ("dop853",)) as module,
        temporary_module(whole, ("dop853",), ("none",)) as along,
    ):
        problem = shooting._problem(equations, module, motion, free, 3, along)
        theta = shooting._first(problem) * 1.01
        noise = np.ones(len(problem.names))
        exact = shooting._integrated(problem, noise, theta, shooting.CONTINUOUS)
        differences = np.zeros_like(exact)
        for step in (2e-4, -2e-4):  # forwards and backwards: half of each is central
            monkeypatch.setattr(shooting, "DIFFERENCE", step)
            differences += shooting._differences(problem, noise, theta, shooting.CONTINUOUS) / 2
    sizes = np.abs(differences).max(axis=0)
    assert sizes.min() > 1e-2
    np.testing.assert_allclose(exact / sizes, differences / sizes, atol=5e-7)


def test_forces_that_jump_leave_slopes_to_differences(arm: Path) -> None:
    assert is_continuous(based(equations_of(arm, None)))
    jumping = ARM.replace("k*q^3", "k*q^3 - (1 N*m)*step(q)")
    arm.write_text(jumping, encoding="utf-8")
    assert not is_continuous(based(equations_of(arm, None)))
