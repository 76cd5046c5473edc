"""Planar mechanisms in Exudyn: its own bodies, joints and rolling discs, the trapezoidal rule of
index 2 in equal steps.

A wheel that does not slip sideways is a rolling disc of which only the row along its axis is on.
The road of the car axis moves by user functions in Python, which is what Exudyn has for prescribed
motions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from derive.model.constraint_records import NoSlip
from derive.model.records import GROUND, Model
from hamel.verify.reference.outcome import reference, state_of
from hamel.verify.reference.states import State, inertia_tensor, placed
from peers.simulations import Simulation, timed

STEPS = tuple(1000 * 2**k for k in range(13))
DISC = 0.05  # radius of a wheel, which does not matter: its centre slides freely along it


def simulations(
    model: Model, initial: Any, u: Mapping[str, float], span: float
) -> Iterator[Simulation]:
    """Nothing where Exudyn is not installed."""
    try:
        import exudyn as exu  # pyright: ignore[reportMissingImports]
    except ImportError:
        return
    first = state_of(reference(model), 0.0, initial.q, initial.v) if model.bodies else None

    def run(setting: float, repeats: int) -> tuple[float, np.ndarray] | None:
        if first is None:
            return timed(
                lambda: _end_of_car_axis(exu, model, initial, round(setting), span), repeats
            )
        return timed(lambda: _end(exu, model, first, initial.q, u, round(setting), span), repeats)

    yield Simulation("Exudyn", "trapezoidal rule of index 2", run, STEPS)


def _end(
    exu: Any, model: Model, s: State, q: np.ndarray, u: Mapping[str, float], steps: int, span: float
) -> np.ndarray:
    """(q, q̇) of the joints, revolute but for a base that is free in the plane, at the end."""
    mbs = exu.SystemContainer().AddSystem()
    ground = mbs.AddObject({"objectType": "Ground", "referencePosition": [0.0, 0.0, 0.0]})
    bodies, nodes = {GROUND: ground}, {}
    for body in model.bodies:
        nodes[body.name], bodies[body.name] = _body(mbs, model, body, s)

    def marker(body: str, at: np.ndarray) -> Any:
        """At a point of a body's own frame, which is at its centre of mass in Exudyn."""
        com = (
            np.zeros(3)
            if body == GROUND
            else s.vector(next(b.com for b in model.bodies if b.name == body))
        )
        return mbs.AddMarker(
            {
                "markerType": "BodyPosition",
                "bodyNumber": bodies[body],
                "localPosition": list(at - com),
            }
        )

    for pair, places in (
        *(
            ((joint.parent, joint.child), (joint.at_parent, joint.at_child))
            for joint in model.joints
            if joint.type == "revolute"
        ),
        *((closure.bodies, closure.placements) for closure in model.closures),
    ):
        points = [marker(body, placed(s, place)[0]) for body, place in zip(pair, places)]
        mbs.AddObject({"objectType": "JointRevolute2D", "markerNumbers": points})
    _wheels(mbs, model, bodies)
    _loads(mbs, model, s, u, nodes, bodies, marker)
    _solve(exu, mbs, steps, span)
    kinds = (exu.OutputVariableType.Coordinates, exu.OutputVariableType.Coordinates_t)
    moved, rates = (
        {name: np.array(mbs.GetNodeOutput(node, kind)) for name, node in nodes.items()}
        for kind in kinds
    )
    moved[GROUND] = rates[GROUND] = np.zeros(3)
    return np.concatenate([q + _joints(model, moved), _joints(model, rates)])


def _joints(model: Model, of: Mapping[str, np.ndarray]) -> np.ndarray:
    """What the joints have of x, y and turn of the bodies."""
    parts = [of[joint.child] - of[joint.parent] for joint in model.joints]
    return np.concatenate(
        [part if joint.type == "planar" else part[2:] for joint, part in zip(model.joints, parts)]
    )


def _solve(exu: Any, mbs: Any, steps: int, span: float) -> None:
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, span
    settings.timeIntegration.newton.relativeTolerance = 1e-10
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.solutionSettings.writeSolutionToFile = False
    settings.timeIntegration.verboseMode = 0
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)


def _wheels(mbs: Any, model: Model, bodies: Mapping[str, Any]) -> None:
    for wheel in model.constraints:
        assert isinstance(wheel, NoSlip)
        ends = [
            mbs.AddMarker({"markerType": "BodyRigid", "bodyNumber": bodies[name]})
            for name in (GROUND, wheel.body)
        ]
        disc = {
            "discRadius": DISC,
            "discAxis": [0.0, 1.0, 0.0],
            "planeNormal": [0.0, 0.0, 1.0],
            "constrainedAxes": [1, 0, 0],
        }
        mbs.AddObject({"objectType": "JointRollingDisc", "markerNumbers": ends, **disc})


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
            "mass": s.value(body.mass),
            "inertia": inertia_tensor(s, body)[2, 2],
            "nodeNumber": node,
        }
    )
    if model.gravity is not None:
        mass = mbs.AddMarker({"markerType": "BodyMass", "bodyNumber": made})
        mbs.AddLoad(
            {
                "loadType": "MassProportional",
                "markerNumber": mass,
                "loadVector": list(s.vector(model.gravity)),
            }
        )
    return node, made


def _loads(
    mbs: Any,
    model: Model,
    s: State,
    u: Mapping[str, float],
    nodes: dict[str, Any],
    bodies: dict[str, Any],
    marker: Any,
) -> None:
    for load in model.inputs:
        joint = next(joint for joint in model.joints if load.velocity in joint.velocities)
        for body, torque in ((joint.parent, -u[load.name]), (joint.child, u[load.name])):
            if body != GROUND and torque:
                at = mbs.AddMarker({"markerType": "BodyRigid", "bodyNumber": bodies[body]})
                mbs.AddLoad(
                    {
                        "loadType": "TorqueVector",
                        "markerNumber": at,
                        "loadVector": [0.0, 0.0, torque],
                    }
                )
    value = {p.name: p.value for p in model.parameters}
    if model.name == "four_bar":  # the bearing of the rocker
        turn = mbs.AddMarker(
            {"markerType": "NodeCoordinate", "nodeNumber": nodes["rocker"], "coordinate": 2}
        )
        still = mbs.AddNode({"nodeType": "PointGround", "referenceCoordinates": [0.0, 0.0, 0.0]})
        fixed = mbs.AddMarker(
            {"markerType": "NodeCoordinate", "nodeNumber": still, "coordinate": 0}
        )
        mbs.AddObject(
            {
                "objectType": "ConnectorCoordinateSpringDamper",
                "markerNumbers": [fixed, turn],
                "damping": 0.01,
            }
        )
        return
    if model.name != "andrews":
        return
    motor = mbs.AddMarker({"markerType": "BodyRigid", "bodyNumber": bodies["K1"]})
    mbs.AddLoad(
        {"loadType": "TorqueVector", "markerNumber": motor, "loadVector": [0.0, 0.0, value["mom"]]}
    )
    ends = [
        marker("K3", np.array([value["sd"], -value["sc"], 0.0])),
        marker(GROUND, np.array([value["xc"], value["yc"], 0.0])),
    ]
    spring = {
        "objectType": "ConnectorSpringDamper",
        "markerNumbers": ends,
        "stiffness": value["c0"],
    }
    mbs.AddObject({**spring, "referenceLength": value["l0"]})


def _end_of_car_axis(exu: Any, model: Model, initial: Any, steps: int, span: float) -> np.ndarray:
    """Two masses, the springs under them and the axis between; the road and the guide, a rod that
    turns with it, are driven."""
    of = {p.name: p.value for p in model.parameters}
    mass, L, r, w = of["M"] * of["eps"] ** 2 / 2, of["L"], of["r"], of["w"]
    mbs = exu.SystemContainer().AddSystem()
    ground = mbs.AddObject({"objectType": "Ground", "referencePosition": [0.0, 0.0, 0.0]})

    def high(t: float) -> tuple[float, float]:
        return r * np.sin(w * t), r * w * np.cos(w * t)

    def far(t: float) -> tuple[float, float]:
        y, rate = high(t)
        x = np.sqrt(L**2 - y**2)
        return x - L, -y * rate / x

    def turn(t: float) -> tuple[float, float]:
        return np.arcsin(high(t)[0] / L), high(t)[1] / (far(t)[0] + L)

    def body(place: list[float], rates: list[float], mass: float) -> tuple[Any, Any]:
        """With an inertia that nothing turns."""
        node = mbs.AddNode(
            {"nodeType": "RigidBody2D", "referenceCoordinates": place, "initialVelocities": rates}
        )
        made = mbs.AddObject(
            {"objectType": "RigidBody2D", "mass": mass, "inertia": mass, "nodeNumber": node}
        )
        return node, mbs.AddMarker({"markerType": "BodyRigid", "bodyNumber": made})

    still = mbs.AddNode({"nodeType": "PointGround", "referenceCoordinates": [0.0, 0.0, 0.0]})
    fixed = mbs.AddMarker({"markerType": "NodeCoordinate", "nodeNumber": still, "coordinate": 0})

    def driven(node: Any, motions: Sequence[Callable[[float], tuple[float, float]]]) -> None:
        for i, motion in enumerate(motions):
            at = mbs.AddMarker(
                {"markerType": "NodeCoordinate", "nodeNumber": node, "coordinate": i}
            )
            given = {
                "offsetUserFunction": lambda mbs, t, number, offset, of=motion: float(of(t)[0])
            }
            given |= {
                "offsetUserFunction_t": lambda mbs, t, number, offset, of=motion: float(of(t)[1])
            }
            mbs.AddObject(
                {"objectType": "ConnectorCoordinate", "markerNumbers": [fixed, at], **given}
            )

    (xl, yl, xr, yr), (xld, yld, xrd, yrd) = initial.q, initial.v
    left, at_left = body([xl, yl, 0.0], [xld, yld, 0.0], mass)
    right, at_right = body([xr, yr, 0.0], [xrd, yrd, 0.0], mass)
    road, at_road = body([L, 0.0, 0.0], [0.0, r * w, 0.0], 1.0)
    rod, at_rod = body([0.0, 0.0, 0.0], [0.0, 0.0, r * w / L], 1.0)
    driven(road, (far, high, lambda t: (0.0, 0.0)))
    driven(rod, (lambda t: (0.0, 0.0), lambda t: (0.0, 0.0), turn))
    flat = mbs.AddMarker({"markerType": "BodyPosition", "bodyNumber": ground})
    for ends in ([flat, at_left], [at_road, at_right]):
        spring = {
            "objectType": "ConnectorSpringDamper",
            "stiffness": of["k"],
            "referenceLength": of["L0"],
        }
        mbs.AddObject({**spring, "markerNumbers": ends})
    mbs.AddObject(
        {"objectType": "ConnectorDistance", "markerNumbers": [at_left, at_right], "distance": L}
    )
    along = {
        "axisMarker0": [0.0, 1.0, 0.0],
        "normalMarker1": [1.0, 0.0, 0.0],
        "constrainRotation": False,
    }
    mbs.AddObject({"objectType": "JointPrismatic2D", "markerNumbers": [at_left, at_rod], **along})
    for at in (at_left, at_right):
        mbs.AddLoad(
            {
                "loadType": "ForceVector",
                "markerNumber": at,
                "loadVector": [0.0, -mass * of["g"], 0.0],
            }
        )
    _solve(exu, mbs, steps, span)
    kinds = (exu.OutputVariableType.Position, exu.OutputVariableType.Velocity)
    return np.concatenate(
        [mbs.GetNodeOutput(node, kind)[:2] for kind in kinds for node in (left, right)]
    )
