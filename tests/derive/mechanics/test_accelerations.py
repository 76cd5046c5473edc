"""Accelerations in outputs: in closed form, along motions, and as the reference has them.

Of derive.model: kinematics.
Of derive.model.motion: motions.
Of derive.mechanics: measures, outputs, scene.
Of derive.formulations: functions.
Of derive.textbook: outputs.
Of hamel.verify.reference: measures, outputs.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.diagnostics import ModelError
from derive.formulations import equations
from derive.formulations.evaluate import Evaluator, evaluator
from derive.mechanics import measures
from derive.model import load, load_text
from derive.states import system
from derive.textbook.derivation import derivation
from hamel.verify.checks import agreement
from hamel.verify.checks.evidence import evidence
from hamel.verify.reference.outcome import reference
from tests.agreement import disagreement
from tests.derive.textbook.test_roads import State, printed_errors

FOUR_BAR = """
model: fourbar
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {a: 1 m, b: 2.5 m, c: 2 m, d: 2.2 m}
bodies:
  crank: {mass: 2 kg, com: [a/2, 0], inertia: 0.1}
  rod: {mass: 3 kg, com: [b/2, 0], inertia: 0.6}
  rocker: {mass: 2.5 kg, com: [c/2, 0], inertia: 0.4}
joints:
  A: {type: revolute, parent: ground, child: crank, coordinate: q1}
  B: {type: revolute, parent: crank, child: rod, at: [[a, 0], [0, 0]], coordinate: q2}
  D: {type: revolute, parent: ground, child: rocker, at: [[d, 0], [0, 0]], coordinate: q3}
closures: {C: {type: revolute, between: [rod, rocker], at: [[b, 0], [c, 0]]}}
inputs: {drive: {joint: A}}
outputs:
  r: reaction(C)
  tip: "acceleration(rod, [b, 0])"
  seen: "acceleration(rod, [b, 0], crank)"
  spin: angular_acceleration(rocker, rod)
  turn: der(angular_velocity(rod))
  first: der(der(q1))
  gap: der(der(distance(rod, rocker)))
events: {peak: tip.x - 0.1*turn*a}
quasi_velocities: {crank: {w: der(q1)}, rocker: {w: der(q3)}}
initial: {q1: 60 deg, guess: {q2: -40 deg, q3: 80 deg}}
"""
SLED = """
model: sled
plane: xy
parameters: {m: 4 kg, c: 0.2 m}
bodies: {sled: {mass: m, com: [c, 0], inertia: 0.3}, plate: {mass: 1 kg, inertia: 0.2}}
joints:
  base: {type: planar, parent: ground, child: sled, coordinates: [x, y, heading]}
  turn: {type: revolute, parent: ground, child: plate, coordinate: th}
constraints:
  skate: {type: no_slip, body: sled, at: [0, 0], direction: y}
  driven: {type: prescribed, joint: turn, motion: 0.2*sin((3 rad/s)*t)}
inputs: {push: {}, twist: {}}
loads:
  f: {type: force, body: sled, at: [0, 0.1], components: [push + lag, 0], frame: body}
  g: {type: torque, body: sled, components: twist}
states: {lag: {rate: (push - lag)/(0.2 s), initial: 2 N}}
where: {side: "velocity(sled, [c, 0], plate).y*position(sled).x"}
quasi_velocities: {body: {speed: base.vx, spin: base.w}, smooth: orthonormal}
outputs:
  lateral: dot(acceleration(sled, [c, 0]), direction(sled, y))
  rate: der(base.vx)
  spin: der(turn.w) + der(base.w)
  seen: "acceleration(sled, [c, 0], plate)"
  along: der(side)
  back: "[der(der(x)), der(der(y))] - acceleration(sled)"
  r: reaction(skate)
  speed: velocity(sled).x
  slowing: acceleration(sled).x
events: {e: seen.x - 1 m/s^2}
initial: {base.vx: 1 m/s, base.w: 0.5 rad/s}
"""
FLOATING = """
model: floating
gravity: [0, 0, -9.81 m/s^2]
bodies:
  hull: {mass: 3 kg, inertia: [0.1, 0.2, 0.25], com: [0.1, 0.05, -0.1]}
  wheel: {mass: 1 kg, inertia: [0.1, 0.12, 0.07], com: [0.1, 0, 0.2]}
joints:
  f: {type: free, parent: ground, child: hull, position: [x, y, z]}
  r: {type: revolute, parent: hull, child: wheel, axis: [1, 1, 0], at: {parent: {position: [1, 0, 0], rpy: [0.2, 0.3, 0.4]}, child: {position: [0, 0, 0]}}, coordinate: w}
frames: {tool: {body: wheel, position: [0.2, 0.1, 0.3], rpy: [0.1, 0.5, 0.2]}}
inputs: {push: {joint: r}}
outputs:
  seen: "acceleration(hull, [0.2, 0.1, 0], tool)"
  al: angular_acceleration(hull)
  gyro: der(angular_velocity(hull, tool))
  vx: der(f.vx)
  wx: der(f.wx)
  qw: der(der(f_qw))
  imu: "dot(acceleration(tool) - [0, 0, -9.81 m/s^2], direction(tool, x))"
  entry: der(der(orientation(tool).xy))
events: {e: gyro.x + qw}
initial: {w: 0.3 rad, f.wx: 1 rad/s}
"""
EULER = """
model: turned
coordinates: {s: m}
kinetic: (1 kg)*(1 + sin(s/(1 m))^2)*der(s)^2
potential: (3 N/m)*s^2
bodies: {b: {mass: 2 kg, inertia: [0.1, 0.2, 0.25]}}
joints: {f: {type: free, parent: ground, child: b, orientation: {euler: zxy, angles: [yaw, lean, spin]}}}
paths: {p: [{body: ground, at: [1, 0, 0]}, {body: b, at: [0, 0, 0.5]}]}
loads: {k: {type: force, body: b, components: [(2 N/m)*s, 0, 1 N]}}
outputs: {turn: der(der(yaw)), slide: der(der(s)), rope: der(der(length(p)))}
initial: {lean: 0.4 rad, s: 0.5 m, guess: {f_x: 0.2 m}}
"""
PENDULUM = """
model: pendulum
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l: 0.7 m}
bodies: {bob: {mass: 2 kg, com: [0, -l]}}
joints: {hinge: {type: revolute, parent: ground, child: bob, coordinate: q}}
outputs:
  tip: "acceleration(bob, [0, -l])"
  felt: "dot(acceleration(bob, [0, -l]) - [0, -9.81 m/s^2], direction(bob, y))"
  turn: der(der(q))
"""
FALLING = """
model: falling
gravity: [0, 0, -9.81 m/s^2]
bodies: {b: {mass: 2 kg, inertia: 0.1}}
joints: {f: {type: free, parent: ground, child: b}}
outputs: {a: acceleration(b), felt: "acceleration(b) - [0, 0, -9.81 m/s^2]"}
"""
DRIVEN = """
model: driven
plane: xy
bodies: {arm: {mass: 2 kg, com: [0.2, 0], inertia: 0.1}}
joints: {A: {type: revolute, parent: ground, child: arm, coordinate: q}}
constraints: {drive: {type: prescribed, joint: A, motion: 0.5*sin((2 rad/s)*t)}}
outputs: {turn: der(der(q)), tip: "acceleration(arm, [0.4, 0])"}
"""


def derived(text: str, choice: str | None = None, formulation: str = "quasi_velocities"):
    return equations(system(load_text(text)), choice, formulation)


def y(found: Evaluator, t: float, x: np.ndarray | list[float]) -> np.ndarray:
    p = np.array(found.equations.system.parameters)
    return found("outputs", t, np.array(x), np.zeros(0), p)


@pytest.mark.parametrize("text", [FOUR_BAR, SLED, FLOATING, EULER], ids=lambda x: x[7:13])
def test_agree_with_the_reference(text: str) -> None:
    """In loops, with constraints of velocities and of time, quaternions, Euler angles, energies by
    formula and paths, at v̇ of the reference."""
    worst = disagreement(text)
    assert max(worst.values()) < 1e-12, worst


@pytest.mark.parametrize(
    "text, choice, formulation",
    [
        (FOUR_BAR, "rocker", "quasi_velocities"),
        (FOUR_BAR, "crank", "maggi"),
        (FOUR_BAR, None, "udwadia_kalaba"),
        (SLED, "smooth", "quasi_velocities"),
        (SLED, "body", "augmented"),
        (FLOATING, None, "quasi_velocities"),
        (DRIVEN, None, "quasi_velocities"),
    ],
)
def test_are_those_of_the_motion(text: str, choice: str | None, formulation: str) -> None:
    """At v̇ that the formulation found, events too; also where no freedom is left."""
    found = derived(text, choice, formulation)
    e = evidence(reference(found.system.model), found, None, 8)
    assert agreement.results(e) < 1e-10
    assert (agreement.happenings(e) or 0.0) < 1e-10


@pytest.mark.parametrize(
    "quantity", ["acceleration", "angular_acceleration", "second_turning", "speeding"]
)
def test_a_wrong_one_is_seen(quantity: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One per thousand is enough."""
    right = measures._QUANTITIES[quantity]
    wrong = {**measures._QUANTITIES, quantity: lambda scene, x: 1.001 * right(scene, x)}
    monkeypatch.setattr(measures, "_QUANTITIES", wrong)
    found = derived(FLOATING)
    e = evidence(reference(found.system.model), found, None, 3)
    check = next(x for x in agreement.CHECKS if x.name == "outputs")
    assert agreement.results(e) > check.tolerance


def test_the_tip_of_a_pendulum() -> None:
    """l (q̈ along the circle, q̇² to the centre) with q̈ = −g/l sin q; the rope alone is felt."""
    q, w, g, l = 0.4, 1.3, 9.81, 0.7
    turn = -g / l * np.sin(q)
    tip = l * turn * np.array([np.cos(q), np.sin(q)])
    tip += l * w**2 * np.array([-np.sin(q), np.cos(q)])
    felt = l * w**2 + g * np.cos(q)
    got = y(evaluator(derived(PENDULUM)), 0.0, [q, w])
    np.testing.assert_allclose(got, [*tip, felt, turn], rtol=1e-14)


def test_what_falls_freely_feels_nothing() -> None:
    found = evaluator(derived(FALLING))
    x = [0.3, -0.2, 1.0, 0.5, 0.5, 0.5, 0.5, 0.2, -0.4, 0.9, 1.0, -2.0, 3.0]
    np.testing.assert_allclose(y(found, 0.0, x), [0, 0, -9.81, 0, 0, 0], atol=1e-13)


def test_a_drive_alone_accelerates() -> None:
    """Zero degrees of freedom: q̈ is that of the drive, at any time."""
    t = 0.4
    turn, speed = -2.0 * np.sin(2 * t), np.cos(2 * t)
    got = y(evaluator(derived(DRIVEN)), t, [0.5 * np.sin(2 * t)])
    angle = 0.5 * np.sin(2 * t)
    tip = 0.4 * np.array([-np.sin(angle), np.cos(angle)]) * turn
    tip -= 0.4 * np.array([np.cos(angle), np.sin(angle)]) * speed**2
    np.testing.assert_allclose(got, [turn, *tip], rtol=1e-12)


def test_what_stands_still_does_not_accelerate() -> None:
    text = FALLING.replace("a: acceleration(b)", 'a: "acceleration(ground, [1, 2, 3])"')
    text = text.replace("felt:", 'own: "acceleration(b, [1, 0, 0], b)", felt:')
    got = y(evaluator(derived(text)), 0.0, [0, 0, 0, 1, 0, 0, 0, 1, 2, 3, 4, 5, 6])
    np.testing.assert_allclose(got[:6], 0.0)


def test_units_are_told() -> None:
    units = {x.name: x.unit for x in load_text(FLOATING).outputs}
    assert units["seen"] == units["vx"] == units["imu"] == "m/s^2"
    assert units["wx"] == "rad/s^2" and units["qw"] == units["al"] == "1/s^2"
    four_bar = {x.name: x.unit for x in load_text(FOUR_BAR).outputs}
    assert four_bar["first"] == "rad/s^2" and four_bar["gap"] == "m/s^2"


def test_a_motion_has_them(tmp_path: Path) -> None:
    """The rate of a velocity by differences along a simulated motion; events by the names of
    outputs; a sweep keeps them."""
    file = tmp_path / "sled.yaml"
    file.write_text(SLED)
    found = hamel.simulate(file, time=1.0, step=0.002, rtol=1e-11, out=tmp_path / "x.csv")
    motion = found.motion
    rates = np.gradient(motion["speed"], motion["t"], edge_order=2)
    np.testing.assert_allclose(motion["slowing"][2:-2], rates[2:-2], rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(motion["back[0]"], 0.0, atol=1e-12)
    assert "seen[1]" in (tmp_path / "x.csv").read_text().partition("\n")[0]
    kept = hamel.sweep(
        file,
        vary={"m": [2.0, 4.0]},
        keep=["highest(lateral)", "seen.y"],
        time=0.2,
        out=tmp_path / "s",
    )
    assert not kept.failed and [x.count for x in kept.kept] == [2, 2]


def test_the_linear_equations_have_them() -> None:
    """∂y/∂x of outputs with v̇ in them, against differences."""
    found, step = derived(PENDULUM), 1e-6
    (request,) = (x for x in found.requests if x.name == "outputs_jacobian")
    of = evaluator(replace(found, functions=(*found.functions, request.function)))
    at, p = np.array([0.4, 1.3]), np.array(found.system.parameters)
    sides = [(y(of, 0.0, at + d) - y(of, 0.0, at - d)) / (2 * step) for d in step * np.eye(2)]
    got = of("outputs_jacobian", 0.0, at, np.zeros(0), p)
    np.testing.assert_allclose(got, np.array(sides).T, rtol=1e-6, atol=1e-8)


def test_a_part_is_seen_from_its_ground(tmp_path: Path) -> None:
    """On a body that moves it accelerates against that body, with the names of the whole."""
    (tmp_path / "leg.yaml").write_text(
        "model: leg\nplane: xy\nbodies: {shin: {mass: 2 kg, inertia: 0.1}}\n"
        "joints: {slip: {type: planar, parent: ground, child: shin}}\n"
        'outputs: {a: "acceleration(shin, [0.3, 0])", v: "velocity(shin, [0.3, 0])", '
        "al: angular_acceleration(shin), d: der(slip.vx)}\n"
    )
    whole = tmp_path / "whole.yaml"
    whole.write_text(
        "model: whole\nplane: xy\nbodies: {trunk: {mass: 5 kg, inertia: 1}}\n"
        "joints: {base: {type: planar, parent: ground, child: trunk}}\n"
        "submodels: {left: {use: leg.yaml, ground: trunk}}\n"
    )
    model = load(whole)
    seen = {x.name: (x.quantity, x.relative) for x in model.accelerations}
    assert ("acceleration", "trunk") in seen.values()
    assert ("angular_acceleration", "trunk") in seen.values()
    assert "der(left_slip.vx)" in seen


def test_the_page_says_what_they_are() -> None:
    """With v̇ as it is called where the equations of motion tell it; every line is what is
    compiled."""
    for text, road in ((PENDULUM, "block_inversion"), (FOUR_BAR, "kane")):
        found = derived(text)
        document = derivation(found, [road])
        errors = printed_errors(document, State(found))
        assert max(errors.values()) < 1e-12 and "output tip" in errors
    assert "Outputs use accelerations" in str(document)


BODY = """model: a
plane: xy
bodies: {b: {mass: 1 kg, inertia: 1}, c: {mass: 1 kg, inertia: 1}}
joints: {A: {type: revolute, parent: ground, child: b, coordinate: q}, base: {type: planar, parent: ground, child: c}}
inputs: {F: {joint: A}}
"""
ALONE = "accelerations can stand in `outputs:` alone"
REFUSED = {
    "where: {w: der(der(q))}": ("der() of the rate of 'q'", ALONE),
    "where: {w: der(velocity(b).x)}": ("der() of 'velocity(b).x', a velocity", ALONE),
    "where: {w: acceleration(b).x}": ("acceleration() in this formula", ALONE),
    "where: {v: velocity(b).x, w: der(v)}": ("der() of 'velocity(b).x', a velocity", ALONE),
    "events: {e: der(base.vx)}": ("der() of 'base.vx', a velocity", ALONE),
    "events: {e: der(A.w)}": ("der() of 'A.w', a velocity", ALONE),
    "outputs: {o: q}\nevents: {e: der(o)}": ("der() of 'o', which is not a coordinate", "q"),
    "loads: {g: {type: torque, body: b, components: angular_acceleration(b)*(1 kg*m^2)}}": (
        "angular_acceleration() in this formula",
        ALONE,
    ),
    "constraints: {c: {nonholonomic: der(base.vx)}}": ("der() of 'base.vx', a velocity", ALONE),
    "constraints: {c: {holonomic: der(der(q))}}": ("der() of the rate of 'q'", ALONE),
    "quasi_velocities: {c: {w: der(der(q))}}": ("der() of the rate of 'q'", ALONE),
    "states: {z: {rate: der(der(q)), unit: 1/s}}": ("der() of the rate of 'q'", ALONE),
    "outputs: {o: der(der(der(q)))}": ("der() of 'der(der(q))', an acceleration", "velocities"),
    "outputs: {o: der(acceleration(b).x)}": ("'acceleration(b).x', an acceleration", "velocities"),
    "outputs: {o: der(2*F)}": ("der() of 'F', an input", "coordinates, velocities and t"),
    f"outputs: {{o: der(der({'*'.join(['(1 + q)'] * 60)}))}}": (
        "der() of what is itself a rate, which is written out in 100000 terms",
        "shorter definitions",
    ),
    "outputs: {o: acceleration(nob)}": ("unknown body or frame 'nob'", "ground, b, c"),
    "outputs: {o: acceleration(b) + velocity(b)}": ("cannot add m/s to m/s^2", "m/s^2"),
}


@pytest.mark.parametrize("more", REFUSED, ids=lambda x: x[:60])
def test_they_stand_nowhere_else(more: str) -> None:
    with pytest.raises(ModelError) as caught:
        load_text(f"{BODY}{more}\n")
    for said in REFUSED[more]:
        assert said in str(caught.value)


def test_a_vector_has_a_rate_by_component() -> None:
    """Everywhere where its components have one."""
    model = load_text(
        BODY + 'where: {w: "dot(der(position(c)), direction(c, x))"}\n'
        'outputs: {a: "der(velocity(c, [1, 0]))", b: "acceleration(c, [1, 0])", w: w}\n'
    )
    first, second, _ = model.outputs
    assert first.expression == second.expression and first.unit == "m/s^2"


def test_a_table_may_be_called_so() -> None:
    """It goes before the function, as it did when there was none."""
    model = load_text(
        BODY + "tables: {acceleration: {points: [[0, 0], [1, 1]], units: [s, m/s^2]}}\n"
        'outputs: {o: acceleration(t), v: "velocity(b).x + acceleration(t)*(1 s)"}\n'
    )
    assert not model.accelerations
