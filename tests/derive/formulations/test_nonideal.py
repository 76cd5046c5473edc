"""Nonideal constraints: they do the work they are said to do, whatever the formulation, and
friction follows the reaction."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import FORMULATIONS, equations
from derive.model import load_text
from derive.model.rows import row_names
from derive.states import system
from derive.states.sampling import states
from hamel.verify import verification
from hamel.verify.reference.saddle import saddle, solved
from tests.evaluation import accelerations, functions
from tests.scenes import mechanics

BLOCK = """
model: block
description: Block that slides on an incline of angle a with Coulomb friction.
coordinates: {x: m, y: m}
parameters: {m: 3 kg, g: 9.81 m/s^2, a: 0.6, mu: 0.3}
kinetic: m/2*(der(x)**2 + der(y)**2)
potential: m*g*y
constraints:
  incline:
    holonomic: x*sin(a) + y*cos(a)
    nonideal: [-mu*abs(reaction.incline)*cos(a), mu*abs(reaction.incline)*sin(a)]
quasi_velocities: {along: [der(x)]}
initial: {x: 0 m, guess: {y: 0 m}, der(x): 1 m/s}
"""
FITTING = [f.name for f in FORMULATIONS if f.name != "recursive"]


@pytest.mark.parametrize("formulation", FITTING)
def test_a_block_on_an_incline(formulation) -> None:
    """ẍ = g (sin a − μ cos a) cos a downhill, and the normal force is m g cos a."""
    s = system(load_text(BLOCK))
    e = equations(s, None, formulation)
    f, (m, g, a, mu) = functions(e), s.parameters
    x = f["state"](0, [0, 0, 1, -np.tan(a)], [], s.parameters)
    found = states(s, 3)
    at = lambda name: f[name](0, x, [], s.parameters).full().ravel()  # noqa: E731
    along = g * (np.sin(a) - mu * np.cos(a))
    assert at("dynamics")[2] == pytest.approx(along * np.cos(a), rel=1e-13)
    assert at("reactions")[0] == pytest.approx(m * g * np.cos(a), rel=1e-13)
    assert accelerations(e, found).shape == (len(found.t), 2)


@pytest.mark.parametrize("formulation", FITTING)
@pytest.mark.parametrize("name", ["bead_on_wire", "bead_in_bowl"])
def test_the_constraints_do_the_work_they_are_said_to_do(name, formulation) -> None:
    """Q_c = M v̇ + h − Q° is all that the constraints exert: wᵀ Q_c = wᵀ C for every w in ker A, to
    1e-12."""
    s, ideal = mechanics(name), without_nonideal(name)
    found, e = states(s, 20, seed=4), equations(s, None, formulation)
    terms = ca.Function(
        "f", [s.t, s.q, s.v, s.u, s.p], [ca.densify(x) for x in (s.M, s.h, s.A, s.beta)]
    )
    applied = ca.Function("Q", [ideal.t, ideal.q, ideal.v, ideal.u, ideal.p], [ca.densify(ideal.Q)])
    for state, vdot in zip(
        zip(found.t, found.q, found.v, found.u, found.p), accelerations(e, found)
    ):
        (M, h, A, beta), Q = (x.full() for x in terms(*state)), applied(*state).full()
        free = solved(saddle(M, A), np.concatenate([Q - h, beta]).ravel(), redundant=False)[0]
        C = friction(name, state, -free[len(M) :])
        exerted = M @ vdot + (h - Q).ravel()
        w = np.linalg.svd(A)[2][len(A) :]
        size = 1 + np.abs(w) @ (np.abs(M @ vdot) + np.abs(h - Q).ravel())
        assert np.max(np.abs(w @ (exerted - C)) / size) < 1e-12
        assert np.max(np.abs(w @ C)) > 0


def without_nonideal(name):
    lines = mechanics(name).model.text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.strip().startswith("nonideal"))
    stop = start + (4 if lines[start].strip() == "nonideal:" else 1)
    return system(load_text("\n".join(lines[:start] + lines[stop:])))


def friction(name, state, lam):
    """C by hand."""
    _, q, v, _, p = state
    if name == "bead_in_bowl":
        return -p[3] * np.linalg.norm(v) * v
    r, k, mu, e = p[2:]
    c, s = np.cos(q[2] / k), np.sin(q[2] / k)
    normal = np.array([lam[0], lam[1], r / k * (s * lam[0] - c * lam[1])])
    return -mu * np.linalg.norm(normal) * v / np.sqrt(v @ v + e**2)


def test_a_reaction_that_is_not_unique_is_refused_with_its_place() -> None:
    text = BLOCK.replace(
        "quasi_velocities:", "  twice: {holonomic: 2*x*sin(a) + 2*y*cos(a)}\nquasi_velocities:"
    )
    with pytest.raises(AssumptionError, match=r"reaction\.incline, which is not unique") as problem:
        system(load_text(text))
    assert problem.value.diagnostics[0].line == 9


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("abs(reaction.incline)*cos", "abs(reaction.inclin)*cos", "unknown name 'reaction.inclin'"),
        (
            "holonomic: x*sin(a)",
            "holonomic: reaction.incline*x*sin(a)",
            "'reaction.incline' is a reaction and cannot stand",
        ),
    ],
)
def test_reactions_stand_in_nonideal_forces_only(old, new, message) -> None:
    with pytest.raises(ModelError, match=message):
        load_text(BLOCK.replace(old, new))


def test_friction_of_a_singular_mass_matrix() -> None:
    """λ° by pivots where M has no inverse."""
    text = BLOCK.replace("{x: m, y: m}", "{x: m, y: m, s: m}").replace(
        "quasi_velocities:", "  tie: {holonomic: s - x}\nquasi_velocities:"
    )
    s = system(load_text(text.replace("*sin(a)]", "*sin(a), 0]")))
    vdot = accelerations(equations(s), states(s, 5))
    plain = system(load_text(BLOCK))
    g, a, mu = plain.parameters[1:]
    downhill = np.abs(vdot[:, 0] - g * (np.sin(a) - mu * np.cos(a)) * np.cos(a))
    assert np.max(downhill) < 1e-12


WHEEL = """
model: wheel
description: A wheel that tows a cart and turns against a resistance in proportion to its load.
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 2 kg, J: 0.04 kg*m^2, r: 0.2 m, cart: 3 kg, mu: 0.05}
bodies: {wheel: {mass: m, inertia: J}}
joints: {base: {type: planar, parent: ground, child: wheel, coordinates: [x, y, turn]}}
coordinates: {s: m}
kinetic: cart/2*der(s)^2
constraints:
  contact: {type: rolling, body: wheel, shape: {wheel: {radius: r}}, plane: {normal: [0, 1]}}
  tow: {nonholonomic: der(s) - der(x), nonideal: {turn: -mu*r*abs(reaction.contact.normal)}}
initial: {guess: {y: 0.2 m}}
outputs: {contact: reaction(contact)}
"""


@pytest.mark.parametrize("formulation", FITTING)
def test_one_row_of_a_reaction_by_its_name(formulation) -> None:
    """(m r² + cart r² + J) θ̈ = −μ r m g; the load of the wheel is an output too."""
    s = system(load_text(WHEEL))
    e = equations(s, None, formulation)
    f, (m, J, r, cart, mu) = functions(e), s.parameters
    found = states(s, 3)
    turning = -mu * r * m * 9.81 / (m * r**2 + cart * r**2 + J)
    assert np.max(np.abs(accelerations(e, found)[:, 2] - turning)) < 1e-12
    x = f["state"](0, np.hstack([found.q[0], found.v[0]]), [], s.parameters)
    load, forward = f["outputs"](0, x, [], s.parameters).full().ravel()
    assert load == pytest.approx(m * 9.81) and abs(forward) > 0.1
    assert next(f for f in e.functions if f.name == "outputs").result.labels == (
        "contact[0]",
        "contact[1]",
    )


def test_the_reference_knows_the_rows_by_the_same_names() -> None:
    model = load_text(WHEEL)
    found = verification(model, equations(system(model)), states=5)
    assert found.passed, [c for c in found.checks if not c.passed]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("reaction.contact", r"'reaction.contact' is 2 reactions, one for each row"),
        ("reaction.contact.norm", r"unknown row 'reaction.contact.norm'"),
        ("reaction.tow.x", r"unknown name 'reaction.tow.x'"),
    ],
)
def test_a_row_that_is_not_named_is_refused_with_the_names(row, message) -> None:
    with pytest.raises(ModelError, match=message) as problem:
        load_text(WHEEL.replace("reaction.contact.normal", row))
    assert problem.value.diagnostics[0].line == 13
    if "contact" in row:
        assert (
            problem.value.diagnostics[0].expected
            == "reaction.contact.normal, reaction.contact.forward"
        )


PAIR = """
model: pair
{plane}
bodies: {{a: {{mass: 1, inertia: 1}}, b: {{mass: 1, inertia: 1}}}}
joints: {{A: {{type: {base}, parent: ground, child: a}}, B: {{type: {base}, parent: ground, child: b}}}}
closures: {{C: {{type: {kind}, between: [a, b], at: [{at}, {at}]{more}}}}}
"""
KINDS = {
    "": ["revolute", "ball", "fixed", "prismatic", "cylindrical", "planar", "universal", "screw"]
}
KINDS |= {plane: ["revolute", "fixed", "prismatic"] for plane in ("xy", "xz", "yz")}


@pytest.mark.parametrize(
    ("plane", "kind"), [(plane, kind) for plane, kinds in KINDS.items() for kind in kinds]
)
def test_rows_are_called_the_same_before_and_after_they_are_made(plane, kind) -> None:
    axes = {
        "universal": ", axis: x, axis2: y",
        "ball": "",
        "fixed": "",
        "screw": ", axis: x, pitch: 1 mm",
    }
    more = axes.get(kind, "" if plane and kind == "revolute" else f", axis: {plane[:1] or 'x'}")
    at, base = ("[0, 0]", "planar") if plane else ("[0, 0, 0]", "free")
    text = PAIR.format(
        plane=f"plane: {plane}" if plane else "", base=base, kind=kind, at=at, more=more
    )
    s = system(load_text(text))
    assert row_names(s.model) == tuple(row.name for row in s.rows)
