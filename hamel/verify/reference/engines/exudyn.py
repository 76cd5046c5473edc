"""Exudyn: bodies in maximal coordinates with its own joints, integrated by the implicit trapezoidal
rule in two step sizes.

Loads other than gravity are left out. In a plane, what inertia is about axes that do not turn is
all the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import exudyn as exu  # pyright: ignore[reportMissingImports]
import numpy as np
from exudyn.utilities import RigidBodyInertia  # pyright: ignore[reportMissingImports]

from derive.model.constraint_records import Rolling
from derive.model.records import GROUND, Body, Closure, Joint, Model, Placement
from hamel.verify.reference.states import State, inertia_tensor, placed
from hamel.verify.reference.vectors import Array

KINDS = {"revolute", "prismatic", "ball", "universal", "free", "fixed", "planar"}


def missing(model: Model) -> str:
    """What of the model it has no counterpart of; "" where it fits."""
    kinds = {joint.type for joint in (*model.joints, *model.closures)} - KINDS
    others = {type(x).__name__.lower() for x in model.constraints if not isinstance(x, Rolling)}
    others |= {
        f"rolling on {x.carrier}"
        for x in model.constraints
        if isinstance(x, Rolling) and x.carrier != GROUND
    }
    tubes = {x.shape for x in model.constraints if isinstance(x, Rolling) and x.shape != "disk"}
    analytic = (
        {"analytic energies"} if model.kinetic is not None or model.potential is not None else set()
    )
    return ", ".join(sorted(kinds | others | tubes | analytic))


def ends(model: Model, s: State, time: float, steps: int, arm: float) -> Array | None:
    """Where `points` of the bodies are after the time, by two step sizes of second order
    extrapolated; None where it gives up."""
    said = exu.config.printToConsole
    exu.config.printToConsole = False  # what it prints is no part of what a program reads
    try:
        coarse, fine = (_ends(model, s, time, many, arm) for many in (steps // 2, steps))
    except exu.SolverError:
        return None
    finally:
        exu.config.printToConsole = said
    return fine + (fine - coarse) / 3.0


def points(model: Model, s: State, arm: float) -> Array:
    """Of every body its origin and, so that turns show, the points `arm` along its three axes (nb ×
    4 × 3)."""
    frames = [s.frames[body.name] for body in model.bodies]
    return np.array([[frame.origin + frame.point(at) for at in _local(arm)] for frame in frames])


def _local(arm: float) -> Array:
    return np.vstack([np.zeros(3), arm * np.eye(3)])


def _ends(model: Model, s: State, time: float, steps: int, arm: float) -> Array:
    mbs = exu.SystemContainer().AddSystem()
    bodies = {GROUND: mbs.CreateGround()} | {
        body.name: _body(mbs, model, body, s) for body in model.bodies
    }
    for joint in model.joints:
        _joint(
            mbs, joint, (joint.parent, joint.child), (joint.at_parent, joint.at_child), bodies, s
        )
    for closure in model.closures:
        _joint(mbs, closure, closure.bodies, closure.placements, bodies, s)
    for constraint in (x for x in model.constraints if isinstance(x, Rolling)):
        _roll(mbs, constraint, bodies, s)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, time
    settings.timeIntegration.newton.relativeTolerance = 1e-12
    settings.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    settings.linearSolver.solverType = (
        exu.LinearSolverType.EigenDense
    )  # planar loops have three redundant rows in space
    settings.linearSolver.ignoreSingularJacobian = True
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode = 0
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    position = exu.OutputVariableType.Position
    return np.array(
        [
            [mbs.GetObjectOutputBody(bodies[x.name], position, at) for at in _local(arm)]
            for x in model.bodies
        ]
    )


def _body(mbs: Any, model: Model, body: Body, s: State) -> Any:
    frame = s.frames[body.name]
    mass, com = s.value(body.mass), s.vector(body.com)
    tensor = inertia_tensor(s, body) + (
        1e-9 * np.eye(3) if not np.any(inertia_tensor(s, body)) else 0.0
    )
    if model.plane:
        tensor = tensor + np.diag([1.0, 1.0, 0.0]) * max(tensor[2, 2], 1e-3)
    return mbs.CreateRigidBody(
        referencePosition=frame.origin,
        referenceRotationMatrix=frame.rotation,
        initialVelocity=frame.velocity,
        initialAngularVelocity=frame.omega,
        inertia=RigidBodyInertia(mass=mass, com=com, inertiaTensor=tensor, inertiaTensorAtCOM=True),
        gravity=[0.0, 0.0, 0.0] if model.gravity is None else list(s.vector(model.gravity)),
    )


def _joint(
    mbs: Any,
    joint: Joint | Closure,
    names: Sequence[str],
    places: Sequence[Placement],
    bodies: dict[str, Any],
    s: State,
) -> None:
    """A joint or a closure, where its frames are at the beginning."""
    frames = [s.frames[name] for name in names]
    (at, turn), (_, child_turn) = (placed(s, place) for place in places)
    common = {
        "itemNumbers": [bodies[name] for name in names],
        "position": frames[0].origin + frames[0].point(at),
    }
    first = frames[0].rotation @ turn @ s.vector(joint.axis)
    if joint.type == "ball":
        mbs.CreateSphericalJoint(**common)
    elif joint.type == "fixed":
        mbs.CreateGenericJoint(**common)
    elif joint.type == "universal":
        second = frames[1].rotation @ child_turn @ s.vector(joint.axis2 or joint.axis)
        axes = np.column_stack(
            [first, second, np.cross(first, second)]
        )  # the one turn that is locked keeps x and y at right angles
        mbs.CreateGenericJoint(
            **common, rotationMatrixAxes=axes, constrainedAxes=[1, 1, 1, 0, 0, 1]
        )
    elif joint.type == "revolute":
        mbs.CreateRevoluteJoint(**common, axis=list(first))
    elif joint.type == "prismatic":
        mbs.CreatePrismaticJoint(**common, axis=list(first))


def _roll(mbs: Any, constraint: Rolling, bodies: dict[str, Any], s: State) -> None:
    mbs.CreateRollingDisc(
        bodyNumbers=[bodies[GROUND], bodies[constraint.body]],
        axisPosition=s.vector(constraint.centre),
        axisVector=s.vector(constraint.axis),
        discRadius=s.value(constraint.radius),
        planePosition=s.vector(constraint.origin),
        planeNormal=s.vector(constraint.normal),
    )
