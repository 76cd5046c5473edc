"""First-order states: rates of their own beside the motion, coupled both ways.

Of derive.model.motion: states.
Of derive.mechanics: states.
Of derive.textbook: states.
Of hamel.verify.reference: stores.
"""

import functools
import importlib
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hamel
from codegen.passes import program
from derive.diagnostics import AssumptionError, ModelError
from derive.enforcement import ENFORCEMENTS, Options, kept_equations
from derive.formulations import equations, misfits
from derive.formulations.evaluate import evaluator, function_of
from derive.linearize import linear
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from derive.states.sampling import states
from hamel.build.module import temporary_module
from hamel.verify.checks import QUICK
from hamel.verify.checks.evidence import evidence
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import results

MOTOR = (Path(__file__).parents[3] / "models/gallery/dc_motor.yaml").read_text("utf-8")
SNAKE = (Path(__file__).parents[3] / "models/snake3.yaml").read_text("utf-8")
TIED = """
model: tied
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 0.5 kg, l: 0.3 m, tau: 20 ms, F: 8 N, a0: 0.1, r: 0.05 m}
bodies:
  cart: {mass: 2 kg}
  bob: {mass: m, com: [0, -l], inertia: 0.001}
joints:
  rail: {type: prismatic, parent: ground, child: cart, axis: x, coordinate: s}
  hinge: {type: revolute, parent: cart, child: bob, coordinate: q}
inputs: {excitation: {unit: "1"}}
constraints: {tie: {holonomic: s - r*sin(q)}}
where: {level: act^2/(1 + act^2)}
states:
  act:
    rate: (excitation - act)/tau + heat*(0.2 1/s) - der(q)*act/10
    initial: a0
  heat: {rate: level^2*(1 1/s) - heat/(3 s), initial: 0.5}
loads:
  muscle: {type: expression, joint: rail, expression: F*level - (3 N*s/m)*der(s)}
outputs: {pull: F*level, force: reaction(tie)}
events: {full: act - 0.3}
initial: {q: 20 deg, guess: {s: 0.01 m}}
"""


def motor_by_hand(x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
    """(q̇, q̈, di/dt): (m l² + n² J) q̈ = n k i − m g l sin q, L di/dt = u − R i − n k q̇."""
    m, l, n, J, L, R, k = p
    q, rate, current = x
    turning = (n * k * current - m * 9.81 * l * np.sin(q)) / (m * l**2 + n**2 * J)
    return np.array([rate, turning, (u[0] - R * current - n * k * rate) / L])


def test_the_motor_is_the_one_of_textbooks() -> None:
    found = equations(system(load_text(MOTOR)))
    rng, p = np.random.default_rng(0), np.array(found.parameters)
    assert found.argument("x").labels == ("q", "q_dot", "current")
    for _ in range(20):
        x, u = rng.normal(size=3), rng.normal(size=1)
        got = function_of(found, "dynamics")(0.0, x, u, p).full().ravel()
        wanted = motor_by_hand(x, u, p)
        assert np.max(np.abs(got - wanted) / (1.0 + np.abs(wanted))) < 1e-12


def test_what_states_store_is_in_the_balance() -> None:
    """With its energy given the power is u i − R i², without it the torque's."""
    for text, wanted in (
        (MOTOR, lambda x, u, p: u * x[2] - p[5] * x[2] ** 2),
        (
            MOTOR.replace("    energy: L/2*current^2\n", ""),
            lambda x, u, p: p[2] * p[6] * x[2] * x[1],
        ),
    ):
        found = equations(system(load_text(text)))
        x, u, p = np.array([0.4, 1.3, -0.7]), 2.0, np.array(found.parameters)
        got = float(function_of(found, "power")(0.0, x, [u], p))
        assert got == pytest.approx(wanted(x, u, p), rel=1e-12)


@pytest.mark.parametrize("text", [MOTOR, TIED], ids=["motor", "tied"])
def test_agrees_with_the_reference_in_every_formulation(text: str) -> None:
    mechanics = system(load_text(text))
    ref = reference(mechanics.model)
    fitting = [name for name, reason in misfits(mechanics).items() if not reason]
    assert len(fitting) > 3
    for name in fitting:
        seen = evidence(ref, equations(mechanics, None, name), states=4)
        failed = [result.name for result in results(seen, QUICK) if not result.passed]
        assert not failed, (name, failed)


def test_states_are_drawn_at_random() -> None:
    mechanics = system(load_text(TIED))
    drawn = states(mechanics, 10).p[:, -2:]
    assert np.all(np.ptp(drawn, axis=0) > 0.2)


@pytest.mark.parametrize("k", [0, 1])
def test_a_planted_error_in_a_rate_is_seen(k: int) -> None:
    """One per million of one rate, in the system and in ẋ."""
    mechanics = system(load_text(TIED))
    ref = reference(mechanics.model)
    rates = ca.vertcat(
        *(x * (1 + 1e-6 * (i == k)) for i, x in enumerate(ca.vertsplit(mechanics.zdot)))
    )
    wrong = replace(mechanics, zdot=rates)
    seen = evidence(ref, equations(wrong), states=4)
    assert "ż" in [result.name for result in results(seen, QUICK) if not result.passed]


def test_a_load_that_forgets_its_state_is_seen() -> None:
    mechanics = system(load_text(TIED))
    Q = ca.substitute(mechanics.Q, mechanics.z, 1.001 * mechanics.z)
    seen = evidence(reference(mechanics.model), equations(replace(mechanics, Q=Q)), states=4)
    assert "Q" in [result.name for result in results(seen, QUICK) if not result.passed]


def test_every_way_of_integrating_comes_to_the_same_end() -> None:
    """Explicit, implicit, in series and in lanes; against the motor by hand."""
    found = equations(system(load_text(MOTOR)), moving=True)
    ways = ("dop853", "radau", "taylor")
    with temporary_module(found, ways) as module:
        x, u, p = np.array([0.5, 0.0, 0.2]), np.array([6.0]), module.defaults
        times = np.linspace(0.0, 0.05, 3)
        ends = [module.simulate(times, x, u, p, integrator=way, rtol=1e-11).x[-1] for way in ways]
        lanes = module.simulate(times, np.tile(x, (9, 1)), u, p, rtol=1e-11).x[:, -1]
    hand = solve_ivp(
        lambda _, y: motor_by_hand(y, u, p), (0.0, 0.05), x, "DOP853", rtol=1e-12, atol=1e-12
    )
    assert max(np.max(np.abs(end - hand.y[:, -1])) for end in (*ends, *lanes)) < 1e-9


def test_linear_equations_hold_the_states() -> None:
    found = equations(system(load_text(TIED)))
    start = initial_state(found.system)
    p = np.array(found.parameters)
    form = linear(found, start.q, p)
    assert form.states[-2:] == ("act", "heat") and len(form.states) == 4
    x = evaluator(found)("state", 0.0, start.whole, np.zeros(1), p)
    slots = [argument.symbols for argument in found.arguments]
    A = ca.Function("A", slots, [ca.densify(form.A)])(0.0, x, 0.0, p).full()
    assert A[2, 2] == pytest.approx(-1 / 0.02, rel=1e-12)  # ∂ act̊/∂ act at rest
    assert A[2, 3] == pytest.approx(0.2, rel=1e-12)


def test_initial_states_follow_parameters_and_settings() -> None:
    mechanics = system(load_text(TIED))
    p = np.array(mechanics.own_parameters)
    p[4] = 0.7
    assert initial_state(mechanics, {}, p).z.tolist() == [0.7, 0.5]
    assert initial_state(mechanics, {"heat": 2.0}).z.tolist() == [0.1, 2.0]


ON_THE_WAY = ("projection", "none", "partitioning", "selective", "tangent")


@pytest.mark.slow
@pytest.mark.parametrize("formulation", ["quasi_velocities", "augmented"])
def test_every_enforcement_carries_states(formulation: str) -> None:
    """All come to the same end, where the states have had their effect, in (q, w) and in (q, v)."""
    found = equations(system(load_text(TIED)), formulation=formulation, moving=True)
    start, p = initial_state(found.system), np.array(found.parameters)
    x = evaluator(found)("state", 0.0, start.whole, np.zeros(1), p)
    ends: dict[str, np.ndarray] = {}
    with temporary_module(found, ("dop853",), ON_THE_WAY) as module:
        for name in ON_THE_WAY:
            how = {"enforcement": name, "rtol": 1e-11, "atol": 1e-12}
            motion = module.simulate(np.array([0.0, 0.4]), x, np.array([0.8]), p, **how)
            ends[name] = motion.x[-1]
            assert motion.charts > 0 or name in ("projection", "none")
            assert motion.position_violation < 1e-10
    assert all(np.abs(end - ends["projection"]).max() < 1e-8 for end in ends.values())
    assert np.abs(ends["projection"][-2:] - x[-2:]).min() > 5e-3


LAGGING = SNAKE.replace(
    "inputs: {tau1: {joint: hinge1}, tau2: {joint: hinge2}}",
    """inputs: {order: {unit: N*m}}
states: {torque: {rate: (order - torque)/(0.5 s) - der(phi1)*(0.1 N*m), unit: N*m}}
loads: {motor: {type: expression, joint: hinge1, expression: torque}}""",
)

COIL = """
model: coil
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l: 0.3 m, k: 0.4 N*m/A, L: 0.2 H}
bodies: {bob: {mass: 0.5 kg, com: [0, -l]}}
joints: {hinge: {type: revolute, parent: ground, child: bob, coordinate: q}}
states: {current: {rate: -k*der(q)/L, initial: 0.5 A, energy: L/2*current^2}}
loads: {pull: {type: expression, joint: hinge, expression: k*current}}
initial: {q: 30 deg}
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["invariants", "invariants_euclidean"])
def test_energy_that_states_store_is_held_with_the_rest(name: str) -> None:
    """Equal steps lose energy; on the invariants none, though it goes to and fro. Where it flows
    away the enforcement is refused for that."""
    enforcement = next(x for x in ENFORCEMENTS if x.name == name)
    found = kept_equations(
        system(load_text(COIL)), None, "quasi_velocities", enforcement, Options()
    )
    x, p = np.array([0.5, 0.0, 0.5]), np.array(found.parameters)
    lost: dict[str, float] = {}
    with temporary_module(found, ("rk4",), (name, "none")) as module:
        for way in (name, "none"):
            motion = module.simulate(
                np.array([0, 5.0]), x, None, p, enforcement=way, step_size=0.05
            )
            energies = [sum(module.energy(0.0, at, None, p)[:2]) for at in motion.x]
            lost[way] = abs(energies[1] - energies[0])
    assert lost[name] < 1e-13 < 1e-6 < lost["none"]
    flowing = equations(system(load_text(MOTOR)))
    assert "energy is not conserved" in enforcement.refusal(flowing, Options())


@pytest.mark.slow
def test_charts_carry_states_there_and_back() -> None:
    """z is the same in all charts, of one state and of many; verify looks at every chart."""
    mechanics = system(load_text(TIED))
    several = equations(mechanics, "s_dot+q_dot", moving=True)
    with temporary_module(several) as module:
        assert module.chart_states[1] == ("s", "q", "q_dot", "act", "heat")
        x, p = np.array([0.05 * np.sin(0.3), 0.3, 0.7, 0.4, 1.3]), module.defaults
        there = module.transform(0, 1, 0.0, x, [0.2], p)
        np.testing.assert_array_equal(there[3:], x[3:])
        np.testing.assert_allclose(module.transform(1, 0, 0.0, there, [0.2], p), x, atol=1e-14)
        many = module.transform("s_dot", "q_dot", 0.0, np.tile(x, (3, 1)), [0.2], p)
        np.testing.assert_array_equal(many, np.tile(there, (3, 1)))
        seen = evidence(reference(mechanics.model), several, module, 4, 0, several.charts)
        failed = [result.name for result in results(seen) if not result.passed]
        assert not failed, failed


@pytest.mark.slow
def test_a_motion_takes_states_through_charts() -> None:
    """s = r sin q turns back where cos q = 0: there der(s) is no quasi-velocity, and z goes on in
    the other chart. The end is that of the choice that is regular everywhere, in C and in NumPy."""
    mechanics = system(load_text(TIED))
    qvz = initial_state(mechanics, {"der(q)": 9.0}).whole
    u, ends = [0.8], list[np.ndarray]()
    with temporary_module(equations(mechanics, "q_dot")) as module:
        alone = module.simulate([0.0, 0.6], module.state(0.0, qvz, u), u, rtol=1e-10)
        ends.append(np.delete(alone.x[-1], 2))
    with temporary_module(equations(mechanics, "s_dot+q_dot")) as module:
        simulate = importlib.import_module(f"{module.__name__}._simulate")
        x, p = module.state(0.0, qvz, u), np.array(module.defaults)
        numpy = functools.partial(simulate.run, simulate.advance, "numpy")
        for course in (
            module.simulate([0.0, 0.6], x, u, p, rtol=1e-10, atol=1e-12),
            numpy([0.0, 0.6], x, u, p, 1e-10, 1e-12, None, 10_000, None),
        ):
            assert course.switches == 1
            ends.append(np.delete(course.x[-1], 2))
    np.testing.assert_allclose(ends[1:], [ends[0]] * 2, atol=1e-8)


@pytest.mark.slow
def test_directions_that_are_based_anew_carry_states(tmp_path: Path) -> None:
    """The snake with a motor that lags: along its orthonormal directions as in those of the file."""
    file = tmp_path / "snake.yaml"
    file.write_text(LAGGING)
    there, wanted = (
        hamel.simulate(file, choice=choice, time=5.0, values={"base.vx": 0.3, "order": 0.05})
        for choice in ("orthonormal", "head")
    )
    assert [switch.entered for switch in there.switches] == ["orthonormal (base 2)"]
    assert there.energy_balance < 1e-9
    for name in ("x", "y", "th", "phi1", "phi2", "torque"):
        np.testing.assert_allclose(there.motion[name], wanted.motion[name], atol=1e-7)
    assert np.ptp(there.motion["torque"]) > 0.01


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("- R*current", "- R*current - L*der(current)", r":22:\d+: error: der\(\) of the state"),
        ("- R*current", "- R*missing", "unknown name 'missing'"),
        ("- R*current", "- current", "cannot add|the rate of 'current' in|units"),
        ("  current:", "  voltage:", "is the name of a input"),
        ("mass: m,", "mass: m*current/(1 A),", "'current' is a state and cannot stand in a mass"),
        ("{q: 30 deg}", "{q: 30 deg, current: 1 A}", "the initial value of the state"),
        ("L/2*current^2", "L/2*current^2 + (1 J)*q", "cannot stand in the energy of a state"),
    ],
)
def test_mistakes_are_told_where_they_are(old: str, new: str, message: str) -> None:
    assert old in MOTOR
    with pytest.raises(ModelError, match=message):
        load_text(MOTOR.replace(old, new, 1))


def test_a_model_without_states_has_none_anywhere() -> None:
    found = equations(system(load_text(TIED.split("where:")[0] + "initial: {guess: {s: 0.01 m}}")))
    assert not found.z and not program(found).states
    assert found.argument("x").labels == ("s", "q", "q_dot")


LAG = """
model: lag
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 1 kg, T: 0.1 s}
bodies: {b: {mass: m, com: [0.3 m, 0], inertia: 0.1 kg*m^2}}
joints: {J: {type: revolute, parent: ground, child: b, coordinate: q}}
inputs: {cmd: {unit: N*m}}
states: {tau: {rate: (cmd - tau)/T, unit: N*m}}
loads: {motor: {type: expression, joint: J, expression: tau}}
"""


def test_standard_parameters_do_not_mind_states(tmp_path):
    """The regressor takes (q, v, v̇); what states push with is told by no motion."""
    file = tmp_path / "lag.yaml"
    file.write_text(LAG)
    hamel.build(file, out=tmp_path / "lag", functions=("regressor", "regressor_w"))
    assert len(hamel.base_parameters(file).base) == 3
    with pytest.raises(AssumptionError, match="first-order states"):
        hamel.build(file, out=tmp_path / "rest", functions=("regressor_rest",))
