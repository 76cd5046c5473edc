"""Planar loops in Exudyn: rigid bodies in the plane, its own revolute joints, the trapezoidal rule of index 2 in equal steps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from derive.model.records import GROUND, Model
from hamel.verify.reference import reference, state_of
from hamel.verify.states import State, inertia_tensor, placed
from peers.simulations import Simulation, timed

STEPS = tuple(1000 * 2**k for k in range(13))
# Loads of these models, each in Exudyn's own elements.
FITS = ("four_bar", "andrews")


def simulations(name: str, mechanics: Any, initial: Any, span: float) -> Iterator[Simulation]:
    """Nothing for models that its elements do not have: wheels that are edges, guides that move with time."""
    try:
        import exudyn as exu  # pyright: ignore[reportMissingImports]
    except ImportError:
        return
    if name in FITS:
        model = mechanics.model
        first = state_of(reference(model), 0.0, initial.q, initial.v)

        def run(setting: float, repeats: int) -> tuple[float, np.ndarray] | None:
            return timed(lambda: _end(exu, model, first, initial.q, round(setting), span), repeats)

        yield Simulation("Exudyn", "trapezoidal rule of index 2", run, STEPS)


def _end(exu: Any, model: Model, s: State, q: np.ndarray, steps: int, span: float) -> np.ndarray:
    """(q, q̇) of the joints, all revolute, at the end."""
    mbs = exu.SystemContainer().AddSystem()
    ground = mbs.AddObject({"objectType": "Ground", "referencePosition": [0.0, 0.0, 0.0]})
    bodies, nodes = {GROUND: ground}, {}
    for body in model.bodies:
        nodes[body.name], bodies[body.name] = _body(mbs, model, body, s)

    def marker(body: str, at: np.ndarray) -> Any:
        """At a point of a body's own frame, which is at its centre of mass in Exudyn."""
        com = np.zeros(3) if body == GROUND else s.vector(next(b.com for b in model.bodies if b.name == body))
        return mbs.AddMarker({"markerType": "BodyPosition", "bodyNumber": bodies[body], "localPosition": list(at - com)})

    for pair, places in (
        *(((joint.parent, joint.child), (joint.at_parent, joint.at_child)) for joint in model.joints),
        *((closure.bodies, closure.placements) for closure in model.closures),
    ):
        points = [marker(body, placed(s, place)[0]) for body, place in zip(pair, places)]
        mbs.AddObject({"objectType": "JointRevolute2D", "markerNumbers": points})
    _loads(mbs, model, s, nodes, bodies, marker)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, span
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.solutionSettings.writeSolutionToFile = False
    settings.timeIntegration.verboseMode = 0
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    kinds = (exu.OutputVariableType.Coordinates, exu.OutputVariableType.Coordinates_t)
    turns, rates = ({name: mbs.GetNodeOutput(node, kind)[2] for name, node in nodes.items()} for kind in kinds)
    turns[GROUND] = rates[GROUND] = 0.0
    return np.array(
        [q0 + turns[j.child] - turns[j.parent] for q0, j in zip(q, model.joints)]
        + [rates[j.child] - rates[j.parent] for j in model.joints]
    )


def _body(mbs: Any, model: Model, body: Any, s: State) -> tuple[Any, Any]:
    frame, com = s.frames[body.name], s.vector(body.com)
    angle = float(np.arctan2(frame.rotation[1, 0], frame.rotation[0, 0]))
    centre = frame.origin + frame.rotation @ com
    velocity = frame.velocity + np.cross(frame.omega, frame.rotation @ com)
    node = mbs.AddNode(
        {
            "nodeType": "RigidBody2D",
            "referenceCoordinates": [*centre[:2], angle],
            "initialVelocities": [*velocity[:2], frame.omega[2]],
        }
    )
    made = mbs.AddObject(
        {
            "objectType": "RigidBody2D",
            "physicsMass": s.value(body.mass),
            "physicsInertia": inertia_tensor(s, body)[2, 2],
            "nodeNumber": node,
        }
    )
    if model.gravity is not None:
        mass = mbs.AddMarker({"markerType": "BodyMass", "bodyNumber": made})
        mbs.AddLoad({"loadType": "MassProportional", "markerNumber": mass, "loadVector": list(s.vector(model.gravity))})
    return node, made


def _loads(mbs: Any, model: Model, s: State, nodes: dict[str, Any], bodies: dict[str, Any], marker: Any) -> None:
    value = {p.name: p.value for p in model.parameters}
    if model.name == "four_bar":  # the bearing of the rocker
        turn = mbs.AddMarker({"markerType": "NodeCoordinate", "nodeNumber": nodes["rocker"], "coordinate": 2})
        still = mbs.AddNode({"nodeType": "PointGround", "referenceCoordinates": [0.0, 0.0, 0.0]})
        fixed = mbs.AddMarker({"markerType": "NodeCoordinate", "nodeNumber": still, "coordinate": 0})
        mbs.AddObject({"objectType": "ConnectorCoordinateSpringDamper", "markerNumbers": [fixed, turn], "damping": 0.01})
        return
    motor = mbs.AddMarker({"markerType": "BodyRigid", "bodyNumber": bodies["K1"]})
    mbs.AddLoad({"loadType": "TorqueVector", "markerNumber": motor, "loadVector": [0.0, 0.0, value["mom"]]})
    ends = [
        marker("K3", np.array([value["sd"], -value["sc"], 0.0])),
        marker(GROUND, np.array([value["xc"], value["yc"], 0.0])),
    ]
    spring = {"objectType": "ConnectorSpringDamper", "markerNumbers": ends, "stiffness": value["c0"]}
    mbs.AddObject({**spring, "referenceLength": value["l0"]})
