"""make loops: closed loops and rolling against Exudyn, by the positions of all bodies after a while.

    python benchmarks/loops.py [MODEL …]

Exudyn integrates bodies in maximal coordinates (Euler parameters, generalised alpha, second order) with its own joints; two step
sizes are extrapolated. Loads other than gravity are left out on both sides. What it has no joint for is said.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import exudyn as exu  # pyright: ignore[reportMissingImports]
import numpy as np
from exudyn.utilities import RigidBodyInertia  # pyright: ignore[reportMissingImports]

from derive.formulations import equations
from derive.mechanics import system
from derive.mechanics.initial import initial_state
from derive.model import Model, load
from derive.model.records import GROUND, Placement, Rolling
from hamel.motion import Stepping, integrated
from hamel.pipeline import temporary_module
from hamel.verify.reference import Reference, reference, state_of
from hamel.verify.states import State, inertia_tensor, placed

MODELS = Path(__file__).resolve().parent.parent / "models"
NAMES = (
    "four_bar",
    "slider_crank",
    "double_pendulum",
    "planar_3r",
    "rolling_disk",
    "gear_train",
    "spatial_four_bar",
    "stress/bricard",
)
KINDS = {"revolute", "prismatic", "ball", "universal", "free", "fixed", "planar"}
TIME, STEPS = 0.3, 3_000
TOLERANCE = 1e-8  # of positions, relative to the largest


def main() -> None:
    failed = False
    for name in sys.argv[1:] or NAMES:
        found = compared(replace(load(MODELS / f"{name}.yaml"), loads=()))
        failed |= isinstance(found, float) and not found <= TOLERANCE
        print(f"{name:20} {found if isinstance(found, str) else f'{found:.1e}'}", flush=True)
    sys.exit(1 if failed else 0)


def compared(model: Model) -> float | str:
    """The largest difference of body origins relative to the largest coordinate, or why there is none."""
    ref = reference(model)
    mechanics = system(model)
    start = initial_state(mechanics)
    missing = _missing(model)
    if missing:
        return f"not compared: Exudyn has no counterpart of {missing}"
    ours = _ours(mechanics, ref, start)
    first = state_of(ref, 0.0, start.q, start.v)
    coarse, fine = (_theirs(model, first, steps) for steps in (STEPS // 2, STEPS))
    theirs = fine + (fine - coarse) / 3  # second order
    return float(np.max(np.abs(ours - theirs)) / np.max(np.abs(ours)))


def _missing(model: Model) -> str:
    kinds = {joint.type for joint in (*model.joints, *model.closures)} - KINDS
    others = {type(x).__name__.lower() for x in model.constraints if not isinstance(x, Rolling)}
    tubes = {x.shape for x in model.constraints if isinstance(x, Rolling) and x.shape != "disk"}
    return ", ".join(sorted(kinds | others | tubes | ({"analytic energies"} if model.kinetic is not None else set())))


def _ours(mechanics: Any, ref: Reference, start: Any) -> np.ndarray:
    derived = equations(mechanics)
    u, p = np.zeros(mechanics.u.numel()), np.array(mechanics.parameters)
    with temporary_module(derived) as module:
        x = module.state(0.0, np.concatenate([start.q, start.v]), u, p)
        by = Stepping("dop853", None, None, 1e-12, 1e-14)
        end = integrated(module, derived, np.array([0.0, TIME]), x, u, p, by, None)
        q = np.array([values[-1] for values in end.q.values()])
        v = np.array([values[-1] for values in end.v.values()])
    there = state_of(ref, TIME, q, v)
    return np.array([there.frames[body.name].origin for body in ref.model.bodies])


def _theirs(model: Model, s: State, steps: int) -> np.ndarray:
    mbs = exu.SystemContainer().AddSystem()
    bodies = {GROUND: mbs.CreateGround()} | {body.name: _body(mbs, model, body, s) for body in model.bodies}
    for joint in model.joints:
        _joint(mbs, joint, (joint.parent, joint.child), (joint.at_parent, joint.at_child), bodies, s)
    for closure in model.closures:
        _joint(mbs, closure, closure.bodies, closure.placements, bodies, s)
    for constraint in model.constraints:
        _roll(mbs, constraint, bodies, s)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, TIME
    settings.timeIntegration.newton.relativeTolerance = 1e-12
    settings.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    settings.linearSolver.solverType = exu.LinearSolverType.EigenDense  # planar loops have three redundant rows in space
    settings.linearSolver.ignoreSingularJacobian = True
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode = 0
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    position = exu.OutputVariableType.Position
    return np.array([mbs.GetObjectOutputBody(bodies[body.name], position, [0, 0, 0]) for body in model.bodies])


def _body(mbs: Any, model: Model, body: Any, s: State) -> Any:
    frame = s.frames[body.name]
    mass, com = s.value(body.mass), s.vector(body.com)
    tensor = inertia_tensor(s, body) + (1e-9 * np.eye(3) if not np.any(inertia_tensor(s, body)) else 0.0)
    if model.plane:
        tensor = tensor + np.diag([1.0, 1.0, 0.0]) * max(
            tensor[2, 2], 1e-3
        )  # what it is about axes that do not turn is all the same
    return mbs.CreateRigidBody(
        referencePosition=frame.origin,
        referenceRotationMatrix=frame.rotation,
        initialVelocity=frame.velocity,
        initialAngularVelocity=frame.omega,
        inertia=RigidBodyInertia(mass=mass, com=com, inertiaTensor=tensor, inertiaTensorAtCOM=True),
        gravity=[0.0, 0.0, 0.0] if model.gravity is None else list(s.vector(model.gravity)),
    )


def _joint(mbs: Any, joint: Any, names: Sequence[str], places: Sequence[Placement], bodies: dict[str, Any], s: State) -> None:
    """A joint or a closure, where its frames are at the beginning."""
    frames = [s.frames[name] for name in names]
    (at, turn), (_, child_turn) = (placed(s, place) for place in places)
    common = {"itemNumbers": [bodies[name] for name in names], "position": frames[0].origin + frames[0].point(at)}
    first = frames[0].rotation @ turn @ s.vector(joint.axis)
    if joint.type == "ball":
        mbs.CreateSphericalJoint(**common)
    elif joint.type == "fixed":
        mbs.CreateGenericJoint(**common)
    elif joint.type == "universal":
        second = frames[1].rotation @ child_turn @ s.vector(joint.axis2)
        axes = np.column_stack(
            [first, second, np.cross(first, second)]
        )  # the one turn that is locked keeps x and y at right angles
        mbs.CreateGenericJoint(**common, rotationMatrixAxes=axes, constrainedAxes=[1, 1, 1, 0, 0, 1])
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


if __name__ == "__main__":
    main()
