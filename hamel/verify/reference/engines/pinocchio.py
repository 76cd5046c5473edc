"""Pinocchio: trees of revolute, prismatic, ball and free joints, by its composite bodies,
Newton–Euler and articulated bodies."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from derive.model.records import GROUND, Joint, Model, Placement
from hamel.verify.reference.engines.records import Forces
from hamel.verify.reference.states import State, inertia_tensor, placed
from hamel.verify.reference.vectors import Array

pin: Any = import_module("pinocchio")  # the library, which has the name of this file
KINDS = {"revolute", "prismatic", "fixed", "ball", "free"}


def missing(model: Model) -> str:
    """What of the model it has no counterpart of; "" where it fits."""
    kinds = {joint.type for joint in model.joints} - KINDS
    turned = {
        "Euler angles" for joint in model.joints if joint.orientation not in ("", "quaternion")
    }
    others = {"loops" for _ in model.closures} | {"constraints" for _ in model.constraints}
    analytic = (
        {"analytic energies"} if model.kinetic is not None or model.potential is not None else set()
    )
    return ", ".join(sorted(kinds | turned | others | analytic))


def tree(model: Model, s: State, rotors: Array | None = None) -> Any:
    """The model at the parameters of a state; `rotors`: inertia added along each velocity, in the
    order of the model."""
    robot, places = pin.Model(), {GROUND: (0, pin.SE3.Identity())}
    bodies = {body.name: body for body in model.bodies}
    robot.gravity.linear = np.zeros(3) if model.gravity is None else s.vector(model.gravity)
    for joint in model.joints:
        parent, behind = places[joint.parent]
        place, inside = behind * _place(joint.at_parent, s), _place(joint.at_child, s).inverse()
        if joint.type != "fixed":
            parent, place = (
                robot.addJoint(parent, _joint(joint, s), place, joint.name),
                pin.SE3.Identity(),
            )
        body, own = bodies[joint.child], place * inside
        robot.appendBodyToJoint(
            parent,
            pin.Inertia(s.value(body.mass), s.vector(body.com), inertia_tensor(s, body)),
            own,
        )
        places[joint.child] = parent, own
    if rotors is not None:
        robot.armature = rotors[columns(model)]
    return robot


def columns(model: Model) -> Array:
    """Where Pinocchio's velocities stand among ours."""
    owners = [velocity.owner for velocity in model.velocities]
    return np.array(
        [i for joint in model.joints for i, owner in enumerate(owners) if owner == joint.name],
        dtype=int,
    )


def forces(model: Model, s: State, rotors: Array, Q: Array) -> Forces:
    """M, h and the v̇ that the forces Q give."""
    robot, order = tree(model, s, rotors), columns(model)
    data, q, v = robot.createData(), _coordinates(model, s), s.v[order]
    upper = np.triu(pin.crba(robot, data, q))
    M, h, vdot = np.zeros((len(v), len(v))), np.zeros(len(v)), np.zeros(len(v))
    M[np.ix_(order, order)] = upper + np.triu(upper, 1).T
    h[order] = pin.nonLinearEffects(robot, data, q, v)
    vdot[order] = pin.aba(robot, data, q, v, Q[order])
    return Forces(M, h, vdot)


def _coordinates(model: Model, s: State) -> Array:
    """Ours in its order, quaternions as (x, y, z, w)."""
    coordinates = []
    for joint in model.joints:
        q = [
            s.q[i]
            for i, coordinate in enumerate(model.coordinates)
            if coordinate.owner == joint.name
        ]
        coordinates += [*q[:-4], *q[-3:], q[-4]] if joint.type in ("ball", "free") else q
    return np.array(coordinates)


def _joint(joint: Joint, s: State) -> Any:
    if joint.type == "free":
        return pin.JointModelFreeFlyer()
    if joint.type == "ball":
        return pin.JointModelSpherical()
    axis, letter = s.vector(joint.axis), {"revolute": "R", "prismatic": "P"}[joint.type]
    for own, unit in zip("XYZ", np.eye(3)):
        if np.array_equal(axis, unit):
            return getattr(pin, f"JointModel{letter}{own}")()
    return getattr(
        pin, "JointModelRevoluteUnaligned" if letter == "R" else "JointModelPrismaticUnaligned"
    )(axis)


def _place(placement: Placement, s: State) -> Any:
    position, rotation = placed(s, placement)
    return pin.SE3(rotation, position)
