"""Functions over quasi-velocities: M_w ẇ + b_w = B_w u is the dynamics, with loops and without slip;
C_w by identities; what has no such function says why.

Of derive.formulations: control, distribution, requests.
"""

from functools import cache

import casadi as ca
import numpy as np
import pytest

from derive.diagnostics import AssumptionError
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.formulations.requests import request_of, unknown_function
from derive.model import load_text
from derive.model.mechanism.named_frames import TAKEN, readings
from derive.states import system
from derive.states.sampling import states
from tests.scenes import derived
from tests.texts import ARM, CAR_AXIS

MODELS = ("four_bar", "spatial_four_bar", "snakeboard", "rolling_disk", "slider_crank")
REDUNDANT = ARM + "inputs: {t1: {joint: A}, t2: {joint: B}, t3: {joint: C}, all: {joint: A}}\n"


@cache
def made(text: str) -> Equations:
    return equations(system(load_text(text)))


def function(found: Equations, name: str) -> ca.Function:
    request = request_of(found, name)
    assert request is not None, name
    made = request.function
    slots = [
        made.x.symbols if made.x is not None and slot.name == "x" else slot.symbols
        for slot in found.arguments
    ]
    return ca.Function(name, slots, [made.result.value])


def places(found: Equations, count: int = 4) -> list[tuple]:
    """Admissible (t, x, u, p)."""
    s = states(found.system, count)
    own = found.function("state")
    assert own.x is not None
    slots = [own.x.symbols if slot.name == "x" else slot.symbols for slot in found.arguments]
    to_x = ca.Function("x", slots, [own.result.value])
    rest = np.array(found.parameters)[found.system.p.numel() :]
    return [
        (
            t,
            np.array(to_x(t, np.append(q, v), u, np.append(p, rest))).ravel(),
            u,
            np.append(p, rest),
        )
        for t, q, v, u, p in zip(s.t, s.q, s.v, s.u, s.p)
    ]


@pytest.mark.parametrize("name", MODELS)
def test_the_equations_over_w_are_the_dynamics(name):
    """M_w ẇ + b_w = B_w u at ẇ of `dynamics`."""
    found = derived(name)
    parts = ["mass_w", "bias_w", *(["input_map"] if found.system.u.numel() else [])]
    slots = [slot.symbols for slot in found.arguments]
    xdot = ca.Function("f", slots, [found.function("dynamics").result.value])
    mass, bias, *driven = (function(found, part) for part in parts)
    nq = found.system.q.numel()
    for at in places(found):
        wdot = np.array(xdot(*at)).ravel()[nq:]
        left = np.array(mass(*at)) @ wdot + np.array(bias(*at)).ravel()
        right = np.array(driven[0](*at)) @ at[2] if driven else 0.0
        assert np.allclose(left, right, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_the_rate_of_mass_w_is_c_and_its_transpose(name):
    """By CasADi's differentiation of mass_w along the motion: with loops and nonholonomic rows."""
    found = derived(name)
    x = found.argument("x").symbols
    nq = found.system.q.numel()
    M = request_of(found, "mass_w").function.result.value
    C = request_of(found, "coriolis_w").function.result.value
    qdot = found.function("dynamics").result.value[:nq]
    rate = ca.reshape(ca.jtimes(ca.vec(M), x[:nq, 0], qdot), *M.shape)
    gap = ca.Function("gap", [slot.symbols for slot in found.arguments], [rate - C - C.T, C])
    for at in places(found):
        left, size = map(np.array, gap(*at))
        assert np.abs(left).max() <= 1e-10 * (1.0 + np.abs(size).max())


def test_of_redundant_inputs_the_least_is_given():
    """Two inputs at one joint share its torque evenly."""
    found = made(REDUNDANT)
    inverse, driven = function(found, "inverse_dynamics_u"), function(found, "input_map")
    mass, bias = function(found, "mass_w"), function(found, "bias_w")
    for t, x, u, p in places(found):
        wdot = np.array([1.0, -2.0, 0.5])
        u = np.array(inverse(t, np.append(x, wdot), u, p)).ravel()
        B = np.array(driven(t, x, u, p))
        needed = np.array(mass(t, x, u, p)) @ wdot + np.array(bias(t, x, u, p)).ravel()
        assert np.allclose(B @ u, needed)
        assert u == pytest.approx(np.linalg.pinv(B) @ needed)
        assert u[0] == pytest.approx(u[3])


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        (ARM + "inputs: {t1: {joint: A}}\n", "inverse_dynamics_u", "no input acts on q2_dot"),
        (
            ARM + "inputs: {f: {unit: '1'}}\nloads: {p: {type: force, body: c, "
            "components: [f*1 N, f**2*1 N]}}\n",
            "input_map",
            "a force is not linear in the inputs",
        ),
        (
            ARM + "inputs: {f: {unit: '1'}}\nloads: {p: {type: expression, joint: A, "
            "expression: f*der(q1)*1 N*m*s}}\n",
            "input_map",
            "depends on velocities",
        ),
        (CAR_AXIS, "coriolis_w", "move by themselves"),
    ],
)
def test_what_there_is_not_is_refused_with_the_reason(text, name, words):
    request = request_of(made(text), name)
    assert request is not None
    with pytest.raises(AssumptionError, match=words):
        _ = request.function


def test_too_few_inputs_for_a_coupled_motion_are_refused():
    text = ARM + "inputs: {f: {unit: N}}\nloads: {p: {type: force, body: c, components: [f, 0]}}\n"
    request = request_of(made(text), "inverse_dynamics_u")
    assert request is not None
    with pytest.raises(
        AssumptionError, match=r"^error: inverse_dynamics_u cannot be had: .*f cannot give every ẇ"
    ):
        _ = request.function


def test_inputs_that_act_alike_are_refused():
    """As many inputs as motions, and one force of the two in common."""
    text = ARM + (
        "inputs: {f: {unit: N*m}, g: {unit: N*m}, h: {joint: C}}\n"
        "loads: {p: {type: expression, joint: A, expression: f + g}, "
        "r: {type: expression, joint: B, expression: 2*f + 2*g}}\n"
    )
    request = request_of(made(text), "inverse_dynamics_u")
    assert request is not None
    with pytest.raises(AssumptionError, match="effects depend on each other, 1 for 2"):
        _ = request.function


def test_without_inputs_there_is_no_inverse():
    request = request_of(made(ARM), "inverse_dynamics_u")
    assert request is not None and "arm has no inputs" in str(request.refusal)


def test_generalized_velocities_have_no_functions_over_w():
    found = derived("four_bar", None, "augmented")
    assert request_of(found, "mass_w") is None and request_of(found, "jacobian_w_coupler") is None
    said = str(unknown_function(found, "jacobian_w_coupler"))
    assert "augmented chooses no quasi-velocities" in said
    assert request_of(found, "jacobian_coupler") is not None


@pytest.mark.parametrize(
    ("scene", "name", "words"),
    [
        ("rolling_disk", "jacobian_u", "it has no inputs"),
        ("rolling_disk", "events", "it has no events"),
        ("rolling_disk", "jacobian_u_values", "it has no inputs"),
        ("cart_pole", "constraints", "it has no constraints"),
    ],
)
def test_what_a_model_lacks_for_a_function_is_said(scene, name, words):
    found = derived(scene)
    assert words in str(unknown_function(found, name))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("pose_cuopler", "did you mean 'pose_coupler'?"),
        ("jacobian_local_crnk", "did you mean 'jacobian_local_crank'?"),
        ("pose_nowhere", "four_bar has no frame 'nowhere'"),
        ("jacobian_locl_crank", "did you mean 'jacobian_local_crank'?"),
        ("poes_crank", "did you mean 'pose_crank'?"),
        ("mas_w", "did you mean 'mass_w'?"),
        ("something_else", "pose_FRAME"),
        ("pose", "give pose_FRAME, with one of the frames ground, crank"),
    ],
)
def test_an_unknown_function_is_told_the_nearest_one(name, words):
    found = derived("four_bar")
    assert request_of(found, name) is None
    assert words in str(unknown_function(found, name))


def test_a_name_with_two_meanings_is_refused():
    """Bodies may be called as they like; where that leaves a name open, nothing is guessed."""
    text = ARM.replace("  b:", "  local_a:").replace("child: b", "child: local_a")
    text = text.replace("parent: b", "parent: local_a")
    found = made(text)
    with pytest.raises(AssumptionError, match="jacobian of local_a or jacobian_local of a"):
        request_of(found, "jacobian_local_a")
    assert request_of(found, "pose_local_a") is not None


def test_the_jacobian_of_outputs_is_their_derivative():
    found = derived("four_bar")
    x = found.argument("x").symbols
    y = found.function("outputs").result.value
    J = request_of(found, "outputs_jacobian").function.result.value
    gap = ca.Function("gap", [slot.symbols for slot in found.arguments], [J - ca.jacobian(y, x)])
    assert np.abs(np.array(gap(*places(found)[0]))).max() == 0.0


def test_no_frame_can_be_named_so_that_a_known_function_is_meant():
    """Every function that a name of a frame function could be is reserved."""
    found = derived("four_bar")
    single = {x.name for x in (*found.functions, *found.requests)} | {"jacobian_p_values"}
    families = [family.name for family in found.families]
    meant = {x for x in single for family in families if x.startswith(f"{family}_")}
    assert {x for x in meant if readings(x, {x.split("_", 1)[1], x.rsplit("_", 1)[1]})} == set()
    assert {x for x in meant if x.startswith("jacobian_")} <= {*TAKEN}
