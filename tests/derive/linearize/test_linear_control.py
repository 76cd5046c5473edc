"""Linear equations at work: as generated code, in discrete time, under a regulator, in the hands of
python-control."""

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import hamel
from derive.diagnostics import AssumptionError
from derive.formulations import equations
from derive.linearize.discrete import Discrete
from derive.linearize.minimal import linear
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.build.stages import equations_of

ROOT = Path(__file__).parents[3]
FOUR_BAR = ROOT / "models" / "four_bar.yaml"


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    folder = tmp_path_factory.mktemp("linear") / "four_bar"
    return hamel.load(
        hamel.build(FOUR_BAR, out=folder, functions=("default", "linearization")).folder
    )


def start(module) -> np.ndarray:
    """The consistent initial state."""
    found = initial_state(equations_of(FOUR_BAR).system)
    return module.state(0.0, np.concatenate([found.q, found.v]))


def test_generated_code_gives_the_slopes_of_the_motion_on_the_constraints(four_bar):
    """Against differences between consistent neighbours, at states along a motion: what a
    predictive controller asks for."""
    x = start(four_bar)
    form = linear(equations_of(FOUR_BAR), x[:3], np.array(four_bar.defaults))
    n, nu, ny = len(form.states), len(form.inputs), len(form.outputs)
    path = four_bar.simulate(np.linspace(0, 0.5, 4), x, np.array([0.3])).x
    found = four_bar.linearization(0.0, path, np.array([0.3]))
    assert found.shape == (4, n + ny, n + nu)
    rows, h = list(form.independent), 1e-6
    for x, AB_CD in zip(path, found):
        for k, j in enumerate(rows):
            pair = [_shifted(four_bar, x, rows, j, s * h) for s in (1, -1)]
            slope = (
                four_bar.dynamics(0.0, pair[0], [0.3]) - four_bar.dynamics(0.0, pair[1], [0.3])
            )[rows] / (2 * h)
            outputs = (
                four_bar.outputs(0.0, pair[0], [0.3]) - four_bar.outputs(0.0, pair[1], [0.3])
            ) / (2 * h)
            scale = 1 + np.max(np.abs(AB_CD))
            assert np.max(np.abs(AB_CD[:n, k] - slope)) < 1e-6 * scale
            assert np.max(np.abs(AB_CD[n:, k] - outputs)) < 1e-6 * scale
        push = (four_bar.dynamics(0.0, x, [1.3]) - four_bar.dynamics(0.0, x, [-0.7]))[rows] / 2
        assert np.max(np.abs(AB_CD[:n, n] - push)) < 1e-9 * (1 + np.max(np.abs(push)))


def _shifted(module, x, independent, j, by):
    """x with one independent entry changed and the dependent coordinates solved for."""
    x, dependent = x.copy(), [i for i in range(3) if i not in independent]
    x[j] += by
    for _ in range(8):
        phi = module.constraints(0.0, x)[: len(dependent)]
        J = np.column_stack(
            [
                (module.constraints(0.0, x + 1e-7 * np.eye(len(x))[i])[: len(dependent)] - phi)
                / 1e-7
                for i in dependent
            ]
        )
        x[dependent] -= np.linalg.solve(J, phi)
    return x


def test_discrete_time_is_the_exponential_at_rest_and_the_flow_elsewhere(four_bar):
    derived = equations_of(FOUR_BAR)
    p, x = np.array(four_bar.defaults), start(four_bar)
    form = linear(derived, x[:3], p)
    Phi, Gamma = Discrete(form)(0.0, x, np.array([0.3]), p, 0.05)

    def end(x, u):
        return solve_ivp(
            lambda t, y: four_bar.dynamics(t, y, u),
            (0, 0.05),
            x,
            method="DOP853",
            rtol=1e-12,
            atol=1e-12,
        ).y[:, -1]

    rows, h = list(form.independent), 1e-5
    for k, j in enumerate(rows):
        pair = [end(_shifted(four_bar, x, rows, j, s * h), [0.3]) for s in (1, -1)]
        assert np.max(np.abs(Phi[:, k] - (pair[0] - pair[1])[rows] / (2 * h))) < 1e-6
    assert np.max(np.abs(Gamma[:, 0] - (end(x, [0.31]) - end(x, [0.29]))[rows] / 0.02)) < 1e-6


MASS = """
model: mass
plane: xy
parameters: {{k: {k} N/m, c: {c} N*s/m}}
bodies: {{a: {{mass: 1 kg, inertia: 0.1 kg*m^2}}}}
joints: {{s: {{type: prismatic, parent: ground, child: a, axis: x, coordinate: x}}}}
loads:
  spring: {{type: spring, joint: s, stiffness: k}}
  damper: {{type: damper, joint: s, coefficient: c}}
inputs: {{f: {{joint: s}}}}
"""


@pytest.mark.parametrize("k, c, h", [(0, 5e3, 0.01), (100, 0, 1.0), (1e6, 1e6, 0.1)])
def test_discrete_time_of_what_is_damped_or_turns_within_the_step(k, c, h):
    derived = equations(system(load_text(MASS.format(k=k, c=c)), "all"))
    x, p = np.zeros(2), np.zeros(0)
    Phi, Gamma = Discrete(linear(derived, x[:1], p))(0.0, x, np.zeros(1), p, h)
    both = expm(h * np.array([[0.0, 1.0, 0.0], [-k, -c, 1.0], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(Phi, both[:2, :2], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(Gamma, both[:2, 2:], rtol=1e-9)


def test_a_step_over_which_nothing_settles_is_refused(monkeypatch):
    monkeypatch.setattr("derive.linearize.discrete.DISCRETE_MOST", 256)
    derived = equations(system(load_text(MASS.format(k=1e12, c=0)), "all"))
    form = linear(derived, np.zeros(1), np.zeros(0))
    with pytest.raises(AssumptionError, match="do not settle in 256 steps"):
        Discrete(form)(0.0, np.zeros(2), np.zeros(1), np.zeros(0), 1.0)


def test_the_command_gives_both_forms(capsys):
    from hamel.cli import main

    with pytest.raises(SystemExit) as ended:
        main(["linearize", str(ROOT / "models" / "cart_pole.yaml"), "--step", "0.01", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert ended.value.code == 0
    A, B = np.array(found["A"]), np.array(found["B"])
    both = expm(0.01 * np.block([[A, B], [np.zeros((1, 5))]]))
    assert np.max(np.abs(np.array(found["Phi"]) - both[:4, :4])) < 1e-12
    assert np.max(np.abs(np.array(found["Gamma"]) - both[:4, 4:])) < 1e-13
    assert found["rows"][0]["spurious"] == 0 and found["states"] == ["s", "th", "s_dot", "th_dot"]


def test_the_regulator_holds_the_nonlinear_pole():
    path = example("lqr_cart_pole").main()
    assert np.degrees(path[0, 1]) == pytest.approx(10)
    late = path[len(path) // 2 :]
    assert np.max(np.abs(np.degrees(late[:, 1]))) < 1.0 and np.max(np.abs(late[:, 0])) < 0.08


@pytest.mark.slow
def test_a_and_b_go_to_python_control():
    found = example("bicycle_state_space").state_space(5.0)
    weave = -0.775341882195841925 + 4.46486771378822514j
    assert np.min(np.abs(found.poles() - weave)) < 1e-12
