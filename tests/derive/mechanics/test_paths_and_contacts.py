"""Ropes, muscles, contacts, rolling on moving planes and reactions in loads: the same as by hand,
and as the reference has them.

Of derive.model.mechanism: paths.
Of derive.model.loads: contact, tension.
Of derive.mechanics.geometry: paths, surfaces.
Of derive.mechanics.loads: contact, tension.
Of hamel.verify.reference: contact, paths, surfaces.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from derive.diagnostics import AssumptionError, ModelError
from derive.mechanics import loads
from derive.mechanics.constraints import rolling
from derive.mechanics.loads.contact import CONTACT
from derive.mechanics.loads.records import Applied
from derive.mechanics.loads.tension import TENSION
from derive.mechanics.records import TwistTerm
from derive.model import load_text
from derive.model.load_records import Contact, Tension
from derive.model.records import Load, Model
from derive.states.nonideal import system
from hamel.verify.reference.loads import applied
from hamel.verify.reference.outcome import reference, state_of
from tests.agreement import apart, disagreement, places

LARGE = ("forty_four_bars",)  # built elsewhere
GALLERY = [
    path
    for path in sorted((Path(__file__).parents[3] / "models/gallery").glob("*.yaml"))
    if path.stem not in LARGE
]

ROPES = """
model: ropes
plane: xz
gravity: [0, -9.81 m/s^2]
parameters: {r: 0.2 m, k: 2000 N/m, L: 9 m}
bodies:
  boom: {mass: 50 kg, inertia: 100, com: [3, 0]}
  hook: {mass: 20 kg, inertia: 0.3}
  drum: {mass: 10 kg, inertia: 0.2}
joints:
  luff: {type: revolute, parent: ground, child: boom, coordinate: lift}
  swing: {type: planar, parent: ground, child: hook, coordinates: [x, z, a]}
  d: {type: revolute, parent: boom, child: drum, at: [[2, 1.5], [0, 0]], coordinate: turn}
paths:
  rope:
    - {body: ground, at: [-1, 0]}
    - {body: drum, at: [0.1, 0], pulley: {radius: r, side: right}}
    - {body: boom, at: [6, 0], pulley: {radius: r/2, side: right}}
    - {body: hook, at: [0.1, 0.2]}
  zig:
    - {body: ground, at: [-1, 1]}
    - {body: boom, at: [1, 4], pulley: {radius: 0.3 m, side: left, turns: 1}}
    - {body: drum, at: [0, 0.4], pulley: {radius: 0.1 m, side: right}}
    - {body: boom, at: [4, 0.1]}
    - {body: ground, at: [5, 0.1]}
loads:
  pull: {type: tension, path: rope, tension: "k*(length(rope) - L) + (30 N*s/m)*der(length(rope))"}
  band: {type: tension, between: [drum, hook], at: [[0.1, 0], [0, 0]], tension: "(100 N/m)*length(band)"}
constraints:
  zz: {holonomic: length(zig) - 12 m - r*turn}
initial: {x: 7 m, z: -4 m}
outputs: {l: length(rope), s: der(length(zig))}
"""
ELBOW = """
model: elbow
gravity: [0, 0, -9.81 m/s^2]
parameters: {r: 0.03 m, k: 2000 N/m, L: 0.4 m}
bodies:
  upper: {mass: 2 kg, inertia: [0.1, 0.1, 0.05], com: [0, 0, -0.15]}
  fore: {mass: 1 kg, inertia: [0.03, 0.04, 0.01], com: [0, 0, -0.12]}
joints:
  shoulder: {type: ball, parent: ground, child: upper}
  elbow: {type: revolute, parent: upper, child: fore, at: [[0, 0, -0.3], [0, 0, 0]], axis: y, coordinate: flex}
paths:
  triceps:
    - {body: ground, at: [-0.05, 0.02, 0.05]}
    - {body: upper, at: [-0.04, 0.01, -0.1]}
    - {body: upper, at: [0, 0, -0.3], pulley: {radius: r, side: left, axis: y}}
    - {body: fore, at: [-0.032, 0.03, -0.05]}
loads:
  pull: {type: tension, path: triceps, tension: "k*(length(triceps) - L) + (30 N*s/m)*der(length(triceps))"}
  other: {type: tension, between: [upper, fore], at: [[0.03, 0, -0.05], [0.02, 0.01, -0.04]], tension: "(100 N/m)*length(other)"}
constraints: {c: {holonomic: length(triceps) - 0.42 m}}
outputs: {l: length(triceps), s: der(length(other))}
initial: {flex: 0.5 rad}
"""
SURFACES = """
model: touching
gravity: [0, 0, -9.81 m/s^2]
parameters: {r: 0.3 m, k: 2000 N/m, mu: 0.4}
bodies:
  plate: {mass: 20 kg, inertia: [1, 2, 3], com: [0.1, 0.2, 0]}
  ball: {mass: 2 kg, inertia: 0.1}
  wheel: {mass: 1 kg, inertia: [0.03, 0.04, 0.01], com: [0, 0, -0.12]}
joints:
  tilt: {type: universal, parent: ground, child: plate, axis: x, axis2: y, at: {parent: {position: [0, 0, 0.3], rpy: [0.2, 0.1, 0]}, child: {position: [0.1, 0, 0]}}}
  b: {type: free, parent: ground, child: ball, position: [bx, by, bz]}
  w: {type: free, parent: ground, child: wheel, position: [wx, wy, wz]}
loads:
  a: {type: contact, body: ball, shape: {sphere: {radius: r}}, plane: {normal: [0.6, 0, 0.8], origin: [0, 0.1, 0.2], of: plate}, stiffness: k, damping: 0.5 s/m, friction: mu, smoothing: 0.1 m/s}
  b1: {type: contact, body: ball, at: [0.1, 0, 0.1], plane: {normal: z}, stiffness: k, damping: 0.5 s/m, friction: mu, smoothing: 0.1 m/s}
  c: {type: contact, body: wheel, shape: {wheel: {radius: r, axis: y}}, plane: {normal: z, of: plate}, stiffness: k, damping: 0.5 s/m, friction: mu, smoothing: 0.1 m/s}
  d: {type: contact, body: ball, shape: {sphere: {radius: r}}, surface: "z - (0.3 1/m)*x^2 - 0.2*y*sin(x/r)", of: plate, stiffness: k, damping: 0.5 s/m, friction: mu, smoothing: 0.1 m/s}
"""
MOVING = """
model: on_moving_planes
gravity: [0, 0, -9.81 m/s^2]
parameters: {r: 0.3 m}
bodies:
  plate: {mass: 20 kg, inertia: [1, 2, 3], com: [0.1, 0.2, 0]}
  ball: {mass: 2 kg, inertia: 0.1, com: [0.01, 0.02, 0]}
  wheel: {mass: 1 kg, inertia: [0.03, 0.04, 0.01]}
  tyre: {mass: 1 kg, inertia: [0.03, 0.04, 0.01]}
joints:
  tilt: {type: universal, parent: ground, child: plate, axis: x, axis2: y, at: {parent: {position: [0, 0, 0.3], rpy: [0.2, 0.1, 0]}, child: {position: [0.1, 0, 0]}}}
  b: {type: free, parent: ground, child: ball, position: [bx, by, bz]}
  w: {type: free, parent: ground, child: wheel, position: [wx, wy, wz]}
  y: {type: free, parent: ground, child: tyre, position: [yx, yy, yz]}
constraints:
  a: {type: rolling, body: ball, at: [0.1, 0, 0], shape: {sphere: {radius: r}}, plane: {normal: [0.6, 0, 0.8], origin: [0, 0.1, 0.2], of: plate}}
  c: {type: rolling, body: wheel, shape: {wheel: {radius: r, axis: y}}, plane: {normal: z, of: plate}}
  d: {type: rolling, body: tyre, shape: {torus: {radius: r, axis: y, tube: 0.1 m}}, plane: {normal: z, of: ball}}
"""
CART = """
model: wheel_on_cart
plane: xz
gravity: [0, -9.81 m/s^2]
parameters: {r: 0.3 m, c: 0.01 m, mu: 0.2, rj: 0.02 m}
bodies:
  cart: {mass: 20 kg, inertia: 1, com: [0.1, 0.2]}
  wheel: {mass: 1 kg, inertia: 0.03}
  arm: {mass: 1 kg, inertia: 0.03, com: [0.3, 0]}
joints:
  rail: {type: prismatic, parent: ground, child: cart, axis: x, coordinate: cx}
  w: {type: planar, parent: ground, child: wheel, coordinates: [wx, wz, wa]}
  p: {type: planar, parent: ground, child: arm, coordinates: [px, pz, pa]}
closures:
  pin: {type: revolute, between: [cart, arm], at: [[0, 1], [0, 0]]}
constraints:
  c: {type: rolling, body: wheel, shape: {wheel: {radius: r}}, plane: {normal: z, of: cart}}
loads:
  resist: {type: torque, body: wheel, components: "-c*reaction.c.normal*tanh(der(wa)/(0.1 rad/s))"}
  journal: {type: torque, body: arm, components: "-mu*rj*sqrt(reaction.pin.x^2 + reaction.pin.z^2 + (0.001 N)^2)*tanh(angular_velocity(arm)/(0.1 rad/s))"}
  drag: {type: friction, joint: rail, coulomb: mu*abs(reaction.pin.z), smoothing: 0.1 m/s}
  pull: {type: force, body: cart, components: [3 N, 0]}
"""
TYRES = """
model: tyres
gravity: [0, 0, -9.81 m/s^2]
parameters: {r: 0.3 m, k: 2000 N/m}
bodies:
  plate: {mass: 20 kg, inertia: [1, 2, 3], com: [0.1, 0.2, 0]}
  car: {mass: 30 kg, inertia: [1, 2, 3]}
  wheel: {mass: 1 kg, inertia: [0.03, 0.04, 0.03]}
joints:
  tilt: {type: universal, parent: ground, child: plate, axis: x, axis2: y}
  c: {type: free, parent: ground, child: car, position: [cx, cy, cz]}
  w: {type: revolute, parent: car, child: wheel, axis: y, at: [[0.5, 0.3, -0.2], [0, 0, 0]], coordinate: spin}
loads:
  a: {type: contact, body: wheel, shape: {wheel: {radius: r, axis: y}}, plane: {normal: z, of: plate}, stiffness: k, damping: 0.1 s/m, smoothing: 0.1 m/s, tyre: {longitudinal: {pacejka: [10, 1.9, 1, 0.97]}, lateral: {linear: 5}}}
  b: {type: contact, body: wheel, shape: {wheel: {radius: r, axis: y}}, plane: {normal: z}, stiffness: k, smoothing: 0.1 m/s, tyre: {lateral: {pacejka: [8, 1.3, 0.9, -1]}}}
"""
BOWL = """
model: bowl
gravity: [0, 0, -9.81 m/s^2]
parameters: {r: 0.05 m, a: 0.4 1/m}
bodies:
  bowl: {mass: 5 kg, inertia: [0.2, 0.2, 0.3]}
  ball: {mass: 2 kg, inertia: 0.1, com: [0.005, 0, 0]}
joints:
  rock: {type: universal, parent: ground, child: bowl, axis: x, axis2: y}
  base: {type: free, parent: ground, child: ball, position: [x, y, z]}
constraints:
  contact: {type: rolling, body: ball, shape: {sphere: {radius: r}}, surface: z - a*x^2 - 0.6*a*y^2 - 0.1*x*y/(1 m), of: bowl}
initial: {x: 0.3 m, y: 0.2 m, guess: {z: 0.1 m}}
"""
MODELS = {
    "ropes": ROPES,
    "elbow": ELBOW,
    "surfaces": SURFACES,
    "moving": MOVING,
    "cart": CART,
    "tyres": TYRES,
    "bowl": BOWL,
}


@pytest.mark.parametrize("name", MODELS)
def test_agrees_with_the_reference(name: str) -> None:
    """Every term, output and event."""
    worst = disagreement(MODELS[name])
    assert max(worst.values()) < 1e-12, worst


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_the_gallery_agrees_with_the_reference(path: Path) -> None:
    worst = disagreement(path, 3)
    assert max(worst.values()) < 1e-12, worst


def test_contacts_are_pressed_at_some_of_the_states() -> None:
    """Else their agreement would say nothing."""
    model = load_text(SURFACES)
    ref = reference(model)
    spelled = [state_of(ref, x.t, x.q, x.v, x.u, x.p) for x in places(system(model), 6)]
    for load in model.loads:
        some = [applied(_only(model, load), ref.place, s).springs for s in spelled]
        assert any(np.any(x) for x in some), load.name


def _only(model: Model, load: Load) -> Model:
    return replace(model, loads=(load,), gravity=None)


@pytest.mark.parametrize(("law", "text"), [(CONTACT, SURFACES), (TENSION, ELBOW)])
def test_a_wrong_load_is_seen(law, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One per thousand of the force is enough."""
    record = Contact if law is CONTACT else Tension

    def wrong(scene, load):
        right = law.applied(scene, load)
        return Applied(right.energy, 1.001 * right.force)

    monkeypatch.setitem(loads.LAW_OF, record, wrong)
    assert disagreement(text, 4)["Q"] > 1e-7


def test_a_plane_that_stood_still_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """The carrier's own term left out of the rows."""
    right = rolling._moving_term

    def wrong(normal, link, point, way) -> TwistTerm:
        still = ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
        return right(normal, link, point, way if link != 0 else still)

    monkeypatch.setattr(rolling, "_moving_term", wrong)
    assert disagreement(CART, 3)["A"] > 1e-3


PULLED = """
model: pulled
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {a: 1 m, k: 50 N/m, c: 3 N*s/m, R: 0.2 m}
bodies:
  arm: {mass: 2 kg, com: [0.5, 0], inertia: 0.2}
  weight: {mass: 3 kg}
joints:
  A: {type: revolute, parent: ground, child: arm, coordinate: q}
  S: {type: prismatic, parent: ground, child: weight, at: [[-1.4, 0], [0, 0]], axis: y, coordinate: s}
"""
BY_WORD = """
paths:
  rope: [{body: arm, at: [a, 0]}, {body: ground, at: [-1.2, 2], pulley: {radius: R, side: left}}, {body: weight}]
loads:
  f: {type: tension, between: [arm, ground], at: [[a, 0], [3, 1]], tension: "k*length(f) + c*der(length(f))"}
constraints: {r: {holonomic: length(rope) - 4 m}}
initial: {q: 1 rad, guess: {s: -1 m}}
"""
BY_HAND = """
where:
  x: a*cos(q)
  y: a*sin(q)
  d: sqrt((3 m - x)^2 + (1 m - y)^2)
  rate: ((3 m - x)*a*sin(q)*der(q) - (1 m - y)*a*cos(q)*der(q))/d
  moment: (k*d + c*rate)*((1 m - y)*x - (3 m - x)*y)/d
  dx: -1.2 m - x
  dy: 2 m - y
  e: sqrt(dx^2 + dy^2)
  arc: 3*pi/2 - atan2(dy, dx) + asin(R/e)
loads:
  f: {type: torque, body: arm, components: moment}
constraints: {r: {holonomic: "sqrt(e^2 - R^2) + R*arc + 2 m - s - 4 m"}}
initial: {q: 1 rad, guess: {s: -1 m}}
"""


def test_equals_the_form_by_hand() -> None:
    """A pull along a line and a rope over one pulley with the geometry written out. The rope comes
    to the pulley at angle β = atan2(dy, dx) − asin(R/e), leaves it straight down."""
    assert apart(PULLED + BY_WORD, PULLED + BY_HAND) < 1e-12


ROLLS = """
model: rolls
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {r: 0.3 m, b: 0.4}
bodies:
  cart: {mass: 20 kg}
  wheel: {mass: 1 kg, inertia: 0.03}
joints:
  rail: {type: prismatic, parent: ground, child: cart, axis: x, coordinate: s}
  w: {type: planar, parent: ground, child: wheel, coordinates: [x, y, th]}
inputs: {push: {joint: rail}}
initial: {guess: {y: 0.3 m}}
"""


def test_rolling_on_a_cart_equals_the_form_by_hand() -> None:
    """ẋ − ṡ + r θ̇ = 0 and y = r."""
    word = "constraints: {c: {type: rolling, body: wheel, shape: {wheel: {radius: r}}, plane: {normal: y, of: cart}}}\n"
    hand = "constraints: {h: {holonomic: y - r}, c: {nonholonomic: der(x) - der(s) + r*der(th)}}\n"
    assert apart(ROLLS + word, ROLLS + hand) < 1e-12


SPHERE = """
model: sphere_in_sphere
gravity: [0, 0, -9.81 m/s^2]
parameters: {r: 0.2 m, R: 1 m}
bodies: {ball: {mass: 2 kg, inertia: 0.03, com: [0.01, 0, 0.02]}}
joints: {base: {type: free, parent: ground, child: ball, position: [x, y, z]}}
initial: {x: 0.2 m, y: 0.1 m, guess: {z: -0.75 m}}
"""


def test_rolling_on_a_surface_equals_the_form_by_hand() -> None:
    """A ball in a bowl that is part of a sphere: |C| = R − r, and v + ω × r C/(R − r) = 0 along x
    and y."""
    word = "constraints: {c: {type: rolling, body: ball, shape: {sphere: {radius: r}}, surface: R^2 - x^2 - y^2 - z^2}}\n"
    hand = """
where: {k: r/(R - r)}
constraints:
  n: {holonomic: R - r - sqrt(x^2 + y^2 + z^2)}
  a: {nonholonomic: der(x) + k*(angular_velocity(ball).y*z - angular_velocity(ball).z*y)}
  b: {nonholonomic: der(y) + k*(angular_velocity(ball).z*x - angular_velocity(ball).x*z)}
"""
    assert apart(SPHERE + word, SPHERE + hand) < 1e-12


def test_a_flat_surface_is_a_plane() -> None:
    flat = "constraints: {c: {type: rolling, body: ball, shape: {sphere: {radius: r}}, surface: z + R}}\n"
    plane = "constraints: {c: {type: rolling, body: ball, shape: {sphere: {radius: r}}, plane: {normal: z, origin: [0, 0, -R]}}}\n"
    assert apart(SPHERE + flat, SPHERE + plane) < 1e-12


@pytest.mark.parametrize("kind", ["point_on_surface", "rolling", "contact"])
def test_a_surface_without_a_slope_is_refused(kind: str) -> None:
    """Its place in the file is said."""
    said = {
        "point_on_surface": "constraints: {c: {type: point_on_surface, body: ball, surface: (z - x^2/(1 m))^2}}",
        "rolling": "constraints: {c: {type: rolling, body: ball, shape: {sphere: {radius: r}}, surface: (z + 1 m)^2}}",
        "contact": "loads: {c: {type: contact, body: ball, surface: x^2 + y^2 + z^2, stiffness: 9 N/m}}",
    }[kind]
    with pytest.raises(AssumptionError) as error:
        system(load_text(SPHERE + said + "\n", "m.yaml"))
    assert "the slope of the surface vanishes" in str(error.value)
    assert "m.yaml:8:" in str(error.value)


@pytest.mark.parametrize("load", ["spring", "tension"])
def test_a_line_between_points_that_always_meet_is_refused(load: str) -> None:
    """It has no direction. A spring between points that can part is none of these."""
    text = """model: m
plane: xy
bodies: {{a: {{mass: 1}}, b: {{mass: 1, inertia: 1}}}}
joints:
  A: {{type: revolute, parent: ground, child: a}}
  B: {{type: revolute, parent: a, child: b, at: [0.5, 0]}}
loads: {{s: {{type: {}, between: [a, b], at: [[0.5, 0], [{}, 0]], {}: 3}}}}
"""
    law = {"spring": "stiffness", "tension": "tension"}[load]
    with pytest.raises(ModelError, match="s: two of its points are one") as error:
        system(load_text(text.format(load, 0, law), "m.yaml"))
    assert "m.yaml:7:" in str(error.value)
    assert system(load_text(text.format(load, 0.1, law))).Q.nnz()


def test_a_reaction_in_a_load_equals_the_nonideal_constraint() -> None:
    """Rolling resistance said as a load and as the constraint's own force."""
    rows = "constraints: {{h: {{holonomic: y - r{}}}, c: {{nonholonomic: der(x) - der(s) + r*der(th)}}}}\n"
    law = "-(0.01 m)*reaction.h*tanh(der(th)/(0.1 rad/s))"
    own = rows.format(f', nonideal: {{th: "{law}"}}')
    load = rows.format("") + f'loads: {{f: {{type: torque, body: wheel, components: "{law}"}}}}\n'
    assert apart(ROLLS + load, ROLLS + own) < 1e-12


BAD = {
    "paths: {p: [{body: arm}]}\n": "a path of 1 points",
    "paths: {p: [{body: arm}, {body: leg}]}\n": "unknown body 'leg'",
    "paths: {p: [{body: arm}, {body: ground, pulley: {radius: 1 m, side: left}}]}\n": "begins or ends",
    "paths: {p: [{body: arm}, {body: ground, pulley: {radius: 1 m, side: top}}, {body: weight}]}\n": "unknown side 'top'",
    "paths: {p: [{body: arm}, {body: ground, pulley: {radius: 0 m, side: left}}, {body: weight}]}\n": "is 0 m",
    "paths: {p: [{body: arm}, {body: ground, pulley: {radius: 1 m, side: left, turns: 1.5}}, {body: weight}]}\n": "'1.5' turns",
    "loads: {f: {type: tension, path: rope, tension: 3 N}}\n": "unknown path 'rope'",
    "loads: {f: {type: tension, tension: 3 N}}\n": "does not say where it pulls",
    "loads: {f: {type: tension, between: [arm, weight], at: [[0, 0], [0, 0]], tension: 3 m}}\n": "a tension in m",
    "where: {w: length(rope)}\n": "unknown path 'rope'",
    "loads: {f: {type: contact, body: arm, stiffness: 3 N/m}}\n": "does not say what it touches",
    "loads: {f: {type: contact, body: arm, plane: {normal: y, of: arm}, stiffness: 3 N/m}}\n": "between 'arm' and itself",
    "loads: {f: {type: contact, body: arm, plane: {normal: y}, stiffness: 3 N/m, friction: 1}}\n": "without smoothing",
    "loads: {f: {type: contact, body: arm, surface: position(weight).x, stiffness: 3 N/m}}\n": "in a surface",
    "loads: {f: {type: contact, body: arm, plane: {normal: y}, of: arm, stiffness: 3 N/m}}\n": "'of' beside the plane of 'f'",
    "constraints: {f: {type: rolling, body: arm, shape: {wheel: {radius: 1 m}}}}\n": "does not say what it rolls on",
    "loads: {f: {type: contact, body: arm, plane: {normal: y}, stiffness: 3 N/m, smoothing: 1 m/s, tyre: {}}}\n": "a tyre on a point",
    "loads: {f: {type: contact, body: arm, shape: {wheel: {radius: 1 m}}, plane: {normal: y}, stiffness: 3 N/m, smoothing: 1 m/s, tyre: {lateral: {pacejka: [1, 2]}}}}\n": "2 numbers of a curve",
    "loads: {f: {type: torque, body: arm, components: (1 m)*reaction.c}}\n": "unknown name 'reaction.c'",
}


@pytest.mark.parametrize("text", BAD)
def test_bad_input_has_a_place(text: str) -> None:
    with pytest.raises(ModelError) as error:
        load_text(PULLED + text, "m.yaml")
    assert BAD[text] in str(error.value)
    assert "m.yaml:" in str(error.value)
