"""MuJoCo: revolute and prismatic joints, loops closed in points; these are soft there, so only
their directions are compared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco  # pyright: ignore[reportMissingImports]
import numpy as np

from derive.model.records import GROUND, Body, Joint, Model
from hamel.verify.reference.engines.records import Forces
from hamel.verify.reference.states import State, inertia_tensor, placed
from hamel.verify.reference.vectors import Array

TYPES = {"revolute": "hinge", "prismatic": "slide"}
CLOSED = {
    "revolute",
    "ball",
}  # a revolute closure is one in a plane: in space it would take two points
SLENDER = 1e-3  # kg m², about the axes that nothing in a plane turns about


def missing(model: Model) -> str:
    """What of the model it has no counterpart of; "" where it fits."""
    kinds = {joint.type for joint in model.joints} - {*TYPES, "fixed"}
    closures = {
        f"a {closure.type} closure" for closure in model.closures if closure.type not in CLOSED
    }
    closures |= {
        "a revolute closure in space"
        for c in model.closures
        if c.type == "revolute" and not model.plane
    }
    others = {"constraints" for _ in model.constraints}
    analytic = (
        {"analytic energies"} if model.kinetic is not None or model.potential is not None else set()
    )
    return ", ".join(sorted(kinds | closures | others | analytic))


def forces(model: Model, s: State, rotors: Array, Q: Array) -> Forces | None:
    """M, h and the v̇ that the forces Q give without the loops, and the loops' Jacobian; None where
    MuJoCo refuses the bodies."""
    try:
        engine = mujoco.MjModel.from_xml_string(text(model, s, rotors))
    except ValueError:  # a body without mass, an inertia that no body has
        return None
    data, order, n = mujoco.MjData(engine), _order(model, engine), engine.nv
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = s.q[order], s.v[order], Q[order]
    mujoco.mj_forward(engine, data)
    upright, M, h, vdot, rows = (
        np.zeros((n, n)),
        np.zeros((n, n)),
        np.zeros(n),
        np.zeros(n),
        np.zeros((data.nefc, n)),
    )
    mujoco.mj_fullM(engine, data, upright)
    M[np.ix_(order, order)] = upright
    h[order], vdot[order] = data.qfrc_bias, data.qacc_smooth
    if data.nefc:
        rows[:, order] = np.array(data.efc_J).reshape(data.nefc, n)
    return Forces(M, h, vdot, rows)


def _order(model: Model, made: Any) -> Array:
    """Where MuJoCo's joints stand among our velocities, which are those of the coordinates here."""
    owners = [velocity.owner for velocity in model.velocities]
    return np.array([owners.index(made.joint(i).name) for i in range(made.njnt)], dtype=int)


def text(model: Model, s: State, rotors: Array) -> str:
    """The model as MJCF at the parameters of a state."""
    gravity = np.zeros(3) if model.gravity is None else s.vector(model.gravity)
    loops = "".join(
        f'<connect site1="{closure.name}.0" site2="{closure.name}.1"/>'
        for closure in model.closures
    )
    return (
        f'<mujoco><compiler angle="radian"/><option gravity="{_numbers(gravity)}" jacobian="dense">'
        '<flag contact="disable" limit="disable"/></option>'
        f"<worldbody>{_inside(model, GROUND, s, rotors)}</worldbody>"
        f"<equality>{loops}</equality></mujoco>"
    )


def _inside(model: Model, name: str, s: State, rotors: Array) -> str:
    """The points where loops are closed, and the bodies that hang on this one."""
    return _sites(model, name, s) + "".join(
        _body(model, joint, s, rotors) for joint in model.joints if joint.parent == name
    )


def _sites(model: Model, name: str, s: State) -> str:
    ends = (
        (f"{c.name}.{k}", c.placements[k])
        for c in model.closures
        for k in (0, 1)
        if c.bodies[k] == name
    )
    return "".join(
        f'<site name="{site}" pos="{_numbers(placed(s, place)[0])}"/>' for site, place in ends
    )


def _body(model: Model, joint: Joint, s: State, rotors: Array) -> str:
    body = model.body(joint.child)
    (at, turn), (own, own_turn) = placed(s, joint.at_parent), placed(s, joint.at_child)
    rotation = turn @ own_turn.T
    axes = f'xyaxes="{_numbers([*rotation[:, 0], *rotation[:, 1]])}"'
    held = (
        ""
        if joint.type == "fixed"
        else _joint(model, joint, own, own_turn @ s.vector(joint.axis), rotors)
    )
    inside = held + _inertial(model, body, s) + _inside(model, body.name, s, rotors)
    return f'<body name="{body.name}" pos="{_numbers(at - rotation @ own)}" {axes}>{inside}</body>'


def _joint(model: Model, joint: Joint, at: Array, axis: Array, rotors: Array) -> str:
    rotor = next(x for x, velocity in zip(rotors, model.velocities) if velocity.owner == joint.name)
    place = f'pos="{_numbers(at)}" axis="{_numbers(axis)}" armature="{float(rotor)!r}"'
    return f'<joint name="{joint.name}" type="{TYPES[joint.type]}" {place}/>'


def _inertial(model: Model, body: Body, s: State) -> str:
    tensor = inertia_tensor(s, body)
    if model.plane:
        normal = {"xy": 2, "xz": 1, "yz": 0}[model.plane]
        tensor = np.diag(
            np.where(
                np.arange(3) == normal, tensor[normal, normal], max(tensor[normal, normal], SLENDER)
            )
        )
    entries = [*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]]
    return (
        f'<inertial pos="{_numbers(s.vector(body.com))}" mass="{s.value(body.mass)!r}" '
        f'fullinertia="{_numbers(entries)}"/>'
    )


def _numbers(values: Sequence[float] | Array) -> str:
    return " ".join(repr(float(x)) for x in values)
