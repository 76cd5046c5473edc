"""Kinematics in formulas: the same as written out by hand, and as the reference has it.

Of derive.expressions: differentiate.
Of derive.model: kinematics.
Of derive.mechanics: measures.
Of hamel.verify.reference: measures.
"""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from derive.expressions.differentiate import rate
from derive.expressions.evaluate import float_functions, value
from derive.expressions.parser import expression
from derive.expressions.tree import ONE, Name, Rate
from derive.mechanics import measures
from derive.states.nonideal import system
from tests.agreement import apart, disagreement, model, places, terms

PLANAR = """
model: slung
plane: PLANE
gravity: [0, -9.81 m/s^2]
parameters: {m: 20 kg, l: 3 m, k: 100 N/m}
bodies:
  trolley: {mass: 50 kg}
  load: {mass: m, inertia: 0.4}
  arm: {mass: 2 kg, inertia: 0.2, com: [0.3, 0.1]}
joints:
  rail: {type: prismatic, parent: ground, child: trolley, axis: [0.6, 0.8], coordinate: s}
  rope: {type: revolute, parent: trolley, child: load, at: {parent: {position: [0, 0], angle: 0.3 rad}, child: {position: [0, l]}}, coordinate: swing}
  free: {type: planar, parent: ground, child: arm, coordinates: [ax, ay, at]}
frames:
  hook: {body: load, position: [0.2, 0.1], angle: 0.4 rad}
where:
  stretch: distance(load, [0.1, 0], arm) - 1 m
  pull: k*stretch + (3 N*s/m)*der(stretch)
loads:
  f: {type: force, body: load, components: ["(2 N/m)*position(arm, [0.1, 0.2], hook).X", "(1 N*s/m)*velocity(hook, arm).Y"]}
  g: {type: torque, body: arm, components: "(1 N*m)*angle(hook, arm) - (0.3 N*m*s)*angular_velocity(hook)"}
  h: {type: expression, joint: rail, expression: pull}
constraints:
  tie: {holonomic: "norm(position(hook) - position(arm, [0.3, 0])) - 2 m"}
  roll: {nonholonomic: "dot(velocity(arm), direction(arm, X)) - (0.1 m)*angular_velocity(load)"}
outputs:
  d: distance(hook, trolley)
  a: angle(hook)
  b: angle(load)
  o: orientation(hook, arm).XY
events: {e: position(hook).Y + 2 m}
initial: {guess: {ax: 1 m}}
"""
SPATIAL = """
model: spatial
gravity: [0, 0, -9.81 m/s^2]
parameters: {k: 100 N/m}
bodies:
  base: {mass: 3 kg, inertia: [0.1, 0.2, 0.25], com: [0.1, 0.05, -0.1]}
  arm: {mass: 2 kg, inertia: [0.1, 0.15, 0.07], com: [0.3, 0.1, 0]}
  tip: {mass: 1 kg, inertia: [0.1, 0.12, 0.07], com: [0.1, 0, 0.2]}
joints:
  f: {type: free, parent: ground, child: base, position: [x, y, z], orientation: {euler: zxy, angles: [a, b, c]}}
  u: {type: ball, parent: base, child: arm, at: [[0.2, 0, 0.1], [0, 0.1, 0]]}
  r: {type: revolute, parent: arm, child: tip, axis: [1, 1, 0], at: {parent: {position: [1, 0, 0], rpy: [0.2, 0.3, 0.4]}, child: {position: [0, 0, 0]}}, coordinate: w}
frames:
  tool: {body: tip, position: [0.2, 0.1, 0.3], rpy: [0.1, 0.5, 0.2]}
where:
  stretch: distance(tool, [0.1, 0, 0], base) - 1 m
  tw: angle(tool, z, base)
potential: k/4*stretch^2
loads:
  f: {type: force, body: tip, components: ["(2 N/m)*position(arm, [0.1, 0.2, 0], tool).x", "(1 N*s/m)*velocity(tool, arm).y", "k*stretch"]}
  g: {type: torque, body: arm, components: ["(1 N*m)*angle(tool, [1, 2, 0])", "(0.3 N*m*s)*angular_velocity(tool, arm).x", "(1 N*m*s)*der(tw)"]}
constraints:
  tie: {holonomic: "cross(position(tool), direction(arm, x)).y - 0.1 m + 0.2 m*sin(1 rad/s * t)"}
  roll: {nonholonomic: "dot(velocity(arm), direction(tool, x)) - (0.1 m)*angular_velocity(tip, arm).z - x*der(z)/(1 m)*position(arm).z/(1 m)"}
outputs:
  d: distance(tool, base)
  a: angle(tool, y)
  b: position(tool).z
  o: orientation(tool, arm).xy
  v: velocity(tool, [0, 0, 1], base).y
events: {e: position(tool).y + 2 m}
"""


def planar(plane: str) -> str:
    """The planar model in one of the planes."""
    first, second = plane
    letters = (("PLANE", plane), (".XY", f".{first}{second}"), (".X", f".{first}"))
    text = PLANAR
    for old, new in (*letters, (".Y", f".{second}"), ("arm, X", f"arm, {first}")):
        text = text.replace(old, new)
    return text


@pytest.mark.parametrize("text", [*map(planar, ("xy", "xz", "yz")), SPATIAL], ids=lambda x: x[7:14])
def test_agrees_with_the_reference(text: str) -> None:
    """Every term, output and event of models that use every measure in every place."""
    worst = disagreement(text)
    assert max(worst.values()) < 1e-12, worst


@pytest.mark.parametrize("quantity", ["position", "velocity", "orientation", "angular_velocity"])
def test_a_wrong_measure_is_seen(quantity: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One per thousand is enough."""
    right = measures._QUANTITIES[quantity]
    wrong = {**measures._QUANTITIES, quantity: lambda scene, x: 1.001 * right(scene, x)}
    monkeypatch.setattr(measures, "_QUANTITIES", wrong)
    assert max(disagreement(SPATIAL, 3).values()) > 1e-6


TWO = """
model: two
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {a: 1 m, b: 0.7 m, k: 50 N/m}
bodies:
  one: {mass: 2 kg, com: [0.5, 0], inertia: 0.2}
  two: {mass: 1 kg, com: [0.3, 0], inertia: 0.1}
  slider: {mass: 3 kg}
joints:
  A: {type: revolute, parent: ground, child: one, coordinate: q1}
  B: {type: revolute, parent: one, child: two, at: [[a, 0], [0, 0]], coordinate: q2}
  C: {type: prismatic, parent: ground, child: slider, axis: x, coordinate: s}
"""
BY_WORD = """
loads: {f: {type: expression, joint: A, expression: "k*position(two, [b, 0]).x*(1 m) - (2 N*s)*velocity(two, [b, 0]).y"}}
constraints: {c: {holonomic: "distance(two, [b, 0], slider) - 2 m"}, n: {nonholonomic: "velocity(two, [b, 0]).x - der(s)/3 - (0.1 m)*angular_velocity(two)"}}
"""
BY_HAND = """
where:
  x: a*cos(q1) + b*cos(q1 + q2)
  y: a*sin(q1) + b*sin(q1 + q2)
  vx: -a*sin(q1)*der(q1) - b*sin(q1 + q2)*(der(q1) + der(q2))
  vy: a*cos(q1)*der(q1) + b*cos(q1 + q2)*(der(q1) + der(q2))
loads: {f: {type: expression, joint: A, expression: "k*x*(1 m) - (2 N*s)*vy"}}
constraints: {c: {holonomic: "sqrt((s - x)^2 + y^2) - 2 m"}, n: {nonholonomic: "vx - der(s)/3 - (0.1 m)*(der(q1) + der(q2))"}}
"""


def test_equals_the_form_by_hand() -> None:
    """A load, a holonomic and a nonholonomic constraint with the kinematics written out."""
    start = "initial: {guess: {s: 2 m, q2: 1 rad}}\n"
    assert apart(TWO + BY_WORD + start, TWO + BY_HAND + start) < 1e-12


FORMULAS = (
    "x^3 - 2*x/y + y^2", "sin(x*y)*exp(x) + log(y)", "sqrt(x^2 + y^2)", "atan2(x, y) + atan(x*y)",
    "tanh(x)/cosh(y) + sinh(x)", "x^y", "asin(x/4) + acos(y/4) + tan(x)", "abs(x)*t", "(x*y)^0.5",
)  # fmt: skip


@pytest.mark.parametrize("text", FORMULAS)
def test_rates_of_formulas(text: str) -> None:
    """Against a central difference along x(t), y(t)."""

    def at(t: float) -> dict[str, float]:
        return {"t": t, "x": 0.7 + 0.3 * t, "y": 1.1 - 0.2 * t * t}

    def leaf(node: Name | Rate):
        return ONE if node.name == "t" else Rate(node.name)

    tree, t, h = expression(text), 0.4, 1e-5
    found = value(rate(tree, leaf), at(t), {"x": 0.3, "y": -0.4 * t}, float_functions())
    ends = [value(tree, at(t + k * h), {}, float_functions()) for k in (1, -1)]
    np.testing.assert_allclose(found, (ends[0] - ends[1]) / (2 * h), rtol=1e-8)


LEG = """
model: leg
plane: xy
parameters: {k: 50 N/m}
bodies: {thigh: {mass: 2 kg, com: [0.2, 0], inertia: 0.2}}
joints: {hip: {type: planar, parent: ground, child: thigh, coordinates: [x, y, th]}}
paths: {cord: [{body: ground}, {body: ground, at: [1, 1], pulley: {radius: 0.1 m, side: left}}, {body: thigh, at: [0.4, 0]}]}
loads:
  pull: {type: tension, path: cord, tension: k*length(cord) + (1 N*s/m)*der(length(cord))}
  push: {type: force, body: thigh, components: ["(1 N)*direction(thigh, x).x", k*position(thigh).y]}
  floor: {type: contact, body: thigh, surface: y + x^2/(9 m), stiffness: k}
"""


def test_words_of_the_motion_in_a_part(tmp_path: Path) -> None:
    """Bodies, paths and coordinates of a submodel get its prefix, letters of axes and surfaces do
    not: the motion is that of the model by itself."""
    (tmp_path / "leg.yaml").write_text(LEG)
    whole = tmp_path / "whole.yaml"
    whole.write_text("model: whole\nplane: xy\nsubmodels: {left: {use: leg.yaml}}\n")
    assert max(disagreement(whole, 3).values()) < 1e-12
    ones = [system(model(x)) for x in (LEG, whole)]
    for place in places(ones[0], 4):
        one, other = (terms(x, place)["vdot"] for x in ones)
        np.testing.assert_allclose(one, other, rtol=1e-12)


TOLD = """
model: told
gravity: [0, 0, -9.81 m/s^2]
parameters: {l: 0.5 m}
bodies: {A: {mass: 1 kg, inertia: 0.1}, B: {mass: 1 kg, com: [0.2, 0, 0.1], inertia: 0.1}}
joints:
  ja: {type: free, parent: ground, child: A, position: [x, y, z]}
  jb: {type: revolute, parent: A, child: B, at: [l, 0, 0], axis: [0, 1, 2], coordinate: b}
events: {level: rel.z - 0.1 m}
outputs: {whole: "NAME(B, [l, 0.1, 0], A)", x: "NAME(B, [l, 0.1, 0], A).x", rel: "position(B) - position(A)"}
"""


@pytest.mark.parametrize("name, unit", [("position", "m"), ("velocity", "m/s")])
def test_an_output_may_be_a_vector(name: str, unit: str) -> None:
    """All components, in the axes of the frame; events know them by name."""
    found = system(model(TOLD.replace("NAME", name)))
    (_, whole, of_whole), (_, x, _), (_, rel, _) = found.outputs
    assert (whole.numel(), of_whole, rel.numel()) == (3, unit, 3)
    mistakes = disagreement(TOLD.replace("NAME", name), 5)
    assert max(mistakes.values()) < 1e-12
    for place in places(found, 3):
        arguments = (found.t, found.q, found.v, found.u, found.p)
        at = ca.Function("y", arguments, [whole, x])
        values = at(place.t, place.q, place.v, place.u, place.p)
        assert float(values[0][0]) == float(values[1])
