"""What a reaction is, and which way it acts, as docs/models.md says it.

Of derive.mechanics.closures: cylindrical, fixed, planar, prismatic, screw, universal.
Of derive.mechanics.constraints: distance, no_slip, point_on_surface, rolling.
"""

from __future__ import annotations

import numpy as np
import pytest

from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.model import load_text
from derive.states import system

FREE = "joints: {j: {type: free, parent: ground, child: a, position: [x, y, z]}}\n"
PLANAR = "joints: {j: {type: planar, parent: ground, child: a, coordinates: [x, y, turn]}}\n"
BODY = "bodies: {a: {mass: 2 kg, inertia: 0.1}}\n"
BALL = "constraints: {R: {type: rolling, body: a, shape: {sphere: {radius: 0.5}}, %s}}\n"


def reactions(text: str, q: list[float]) -> dict[str, float]:
    """Of a model at rest at q, which is admissible."""
    derived = equations(system(load_text(text)), None, "augmented")
    graph = evaluator(derived)
    names = derived.function("reactions").result.labels
    v = np.zeros(derived.system.v.numel())
    x = np.concatenate([q, v])
    return dict(zip(names, graph("reactions", 0.0, x, [], []).ravel().round(9)))


def pulled(force: str, *, moment: str = "", rest: str, joint: str = FREE) -> str:
    """A body that a force and a moment pull, held by the rest of the file."""
    loads = [f"f: {{type: force, body: a, components: [{force}]}}"] * bool(force)
    loads += [f"m: {{type: torque, body: a, components: [{moment}]}}"] * bool(moment)
    plane = "plane: xy\n" * (joint == PLANAR)
    return f"model: held\n{plane}{BODY}{joint}{rest}loads: {{{', '.join(loads)}}}\n"


AT_HALF, STRAIGHT = [0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "on, forward, sideways",
    [
        ("plane: {normal: z}", [0, 1, 0], [-1, 0, 0]),
        ("surface: z", [1, 0, 0], [0, 1, 0]),
    ],
)
def test_a_sphere_is_held_along_the_axes_of_its_plane_or_surface(on, forward, sideways):
    """Of the force on it a third is taken up by what it rolls on: I/(I + m r²) of 1/6, here."""
    force = np.array([3.0, 4.0, -20.0])
    found = reactions(pulled("3, 4, -20", rest=BALL % on), AT_HALF)
    part = 0.1 / (0.1 + 2 * 0.25)
    assert found["R.normal"] == pytest.approx(20.0)
    assert found["R.forward"] == pytest.approx(-part * force @ forward)
    assert found["R.sideways"] == pytest.approx(-part * force @ sideways)


def test_a_disk_is_held_along_its_axis_cross_the_normal():
    disk = (BALL % "plane: {normal: z}").replace("sphere: {", "disk: {axis: x, ")
    found = reactions(pulled("3, 4, -20", rest=disk), AT_HALF)
    assert found["R.normal"] == pytest.approx(20.0)
    assert found["R.forward"] == pytest.approx(4.0 * 0.1 / 0.6)  # forward is -y …
    assert found["R.sideways"] < 0.0  # … and sideways x


def test_a_wheel_in_the_plane_is_held_along_the_normal_turned_by_a_right_angle():
    wheel = (BALL % "plane: {normal: y}").replace("sphere: {", "wheel: {")
    found = reactions(pulled("3, -20", rest=wheel, joint=PLANAR), [0.0, 0.5, 0.0])
    assert found["R.normal"] == pytest.approx(20.0)
    assert found["R.forward"] == pytest.approx(3.0 * 0.1 / 0.6)  # forward is -x


@pytest.mark.parametrize("between", ["[ground, a]", "[a, ground]"])
def test_a_rod_under_tension_has_a_negative_reaction_in_newton(between):
    """φ is the distance less the length, and not its square: λ is the force itself."""
    rod = f"constraints: {{rod: {{type: distance, between: {between}, at: [[0, 0, 0], [0, 0, 0]], length: 0.5 m}}}}\n"
    assert reactions(pulled("0, 0, 20", rest=rod), AT_HALF)["rod"] == pytest.approx(-20.0)


def test_a_knife_edge_and_a_surface_hold_along_their_direction_and_slope():
    edge = "constraints: {e: {type: no_slip, body: a, at: [0, 0, 0], direction: y}}\n"
    assert reactions(pulled("3, 4, 5", rest=edge), STRAIGHT)["e"] == pytest.approx(-4.0)
    slope = "constraints: {s: {type: point_on_surface, body: a, at: [0, 0, 0], surface: 2*y}}\n"
    assert reactions(pulled("3, 4, 5", rest=slope), STRAIGHT)["s"] == pytest.approx(-2.0)


CLOSURE = "closures: {{C: {{type: {}, between: [ground, a], at: [[0, 0, 0], [0, 0, 0]]{}}}}}\n"


@pytest.mark.parametrize(
    "kind, keys, wanted",
    [
        ("fixed", "", {"x": -1, "y": -2, "z": -3, "turn1": 40, "turn2": 50, "turn3": -60}),
        ("planar", ", axis: z", {"shift1": -3, "turn1": 40, "turn2": 50}),
        ("cylindrical", ", axis: z", {"shift1": -2, "shift2": 1, "turn1": 40, "turn2": 50}),
        ("universal", ", axis: x, axis2: y", {"x": -1, "y": -2, "z": -3, "cross": 60}),
    ],
)
def test_closures_hold_along_their_own_axes(kind, keys, wanted):
    """For an axis z, e₁ is y and e₂ is -x: turn1 and turn2 are about -x and -y, turn3 about z, and
    `cross` is about axis2 × axis, which is -z here."""
    text = pulled("1, 2, 3", moment="40, 50, 60", rest=CLOSURE.format(kind, keys))
    found = reactions(text, STRAIGHT)
    assert found == pytest.approx({f"C.{name}": value for name, value in wanted.items()})


def test_a_screw_holds_by_a_thrust_and_the_moment_that_goes_with_it():
    """F = λ along the axis and -pitch/2π λ about it: a force of 3 N and no moment turn the screw."""
    screw = CLOSURE.format("screw", ", axis: z, pitch: 6.283185307179586")
    found = reactions(pulled("0, 0, 3", rest=screw), STRAIGHT)
    assert found["C.advance"] == pytest.approx(-3.0 * 0.1 / (0.1 + 2.0))


@pytest.mark.parametrize(
    "kind, keys, wanted",
    [
        ("prismatic", ", axis: x", {"shift1": -2, "turn1": -50}),
        ("fixed", "", {"x": -1, "y": -2, "turn1": 50}),
    ],
)
def test_turns_in_the_plane_are_about_its_normal_or_the_opposite(kind, keys, wanted):
    closure = CLOSURE.format(kind, keys).replace("[0, 0, 0]", "[0, 0]")
    found = reactions(pulled("1, 2", moment="50", rest=closure, joint=PLANAR), [0.0, 0.0, 0.0])
    assert found == pytest.approx({f"C.{name}": value for name, value in wanted.items()})


POINT = PLANAR.replace("planar", "point").replace(", turn", "")


@pytest.mark.parametrize(
    "motion, said", [("(0.1 m/s)*t", "and of constraints that move: d(T"), ("0.1", "l: d(T")]
)
def test_the_power_is_all_that_the_energy_gains(motion, said):
    """P + λᵀc: of 3 N along x that the drive holds nothing is left, whether it moves or not."""
    drive = f"constraints: {{d: {{type: prescribed, coordinate: x, motion: {motion}}}}}\n"
    text = pulled("3, 4", rest=drive, joint=POINT).replace("model: held", "model: held\nplane: xy")
    derived = equations(system(load_text(text)), None, "augmented")
    power, graph = derived.function("power"), evaluator(derived)
    assert said in power.about
    speed = 0.1 if "t" in motion else 0.0
    x = np.array([0.1, 0.0, speed, 2.0])
    assert graph("reactions", 0.0, x, [], []).item() == pytest.approx(-3.0)
    assert graph("power", 0.0, x, [], []).item() == pytest.approx(4.0 * 2.0)
