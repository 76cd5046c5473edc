"""Long mechanisms in other libraries: what evaluates forward dynamics of a URDF text once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from xml.etree.ElementTree import Element, fromstring

import numpy as np

STEPS = 50  # of Exudyn in one call
INERTIAS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def kane(n: int) -> None:
    """Kane's equations of a planar pendulum of n links, formed by SymPy and not simplified."""
    from sympy import symbols
    from sympy.physics.mechanics import (
        KanesMethod,
        Point,
        ReferenceFrame,
        RigidBody,
        dynamicsymbols,
        inertia,
    )

    q, w = dynamicsymbols(f"q:{n}"), dynamicsymbols(f"w:{n}")
    g, t = symbols("g"), dynamicsymbols._t
    ground, joint = ReferenceFrame("N"), Point("O")
    joint.set_vel(ground, 0)
    bodies, loads, frame = [], [], ground
    for i in range(n):
        turned = frame.orientnew(f"A{i}", "axis", [q[i], ground.z])
        turned.set_ang_vel(frame, w[i] * ground.z)
        centre, tip = joint.locatenew(f"C{i}", turned.x / 2), joint.locatenew(f"P{i}", turned.x)
        centre.v2pt_theory(joint, ground, turned)
        tip.v2pt_theory(joint, ground, turned)
        bodies.append(
            RigidBody(f"B{i}", centre, turned, 1.0, (inertia(turned, 0, 0, 0.08), centre))
        )
        loads.append((centre, -g * ground.y))
        frame, joint = turned, tip
    KanesMethod(ground, q, w, [a.diff(t) - b for a, b in zip(q, w)]).kanes_equations(bodies, loads)


def pinocchio(text: str) -> Callable[[], Any]:
    """Articulated bodies, in the convention that is faster."""
    import pinocchio as pin  # pyright: ignore[reportMissingImports]

    model = pin.buildModelFromXML(text)
    data, q, v = model.createData(), pin.neutral(model), np.full(model.nv, 0.1)
    return lambda: pin.aba(model, data, q, v, v, pin.Convention.WORLD)


def mujoco(text: str) -> Callable[[], Any]:
    """No contacts, no limits; its smooth forward dynamics."""
    import mujoco as mj  # pyright: ignore[reportMissingImports]

    model = mj.MjModel.from_xml_string(text)
    model.opt.disableflags |= int(mj.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mj.MjData(model)
    data.qvel[:] = 0.1
    return lambda: mj.mj_forward(model, data)


def exudyn(text: str) -> Callable[[], Any]:
    """A kinematic tree in relative coordinates, its mass matrix solved densely: STEPS explicit
    steps."""
    import exudyn as exu  # pyright: ignore[reportMissingImports]
    from exudyn.itemInterface import (  # pyright: ignore[reportMissingImports]
        NodeGenericODE2,
        ObjectKinematicTree,
    )

    exu.config.printToConsole = False
    links = [_link(body, joint) for body, joint in _pairs(text)]
    n, mbs = len(links), exu.SystemContainer().AddSystem()
    still = [0.0] * n
    node = mbs.AddNode(
        NodeGenericODE2(
            numberOfODE2Coordinates=n,
            referenceCoordinates=still,
            initialCoordinates=still,
            initialCoordinates_t=[0.1] * n,
        )
    )
    mbs.AddObject(
        ObjectKinematicTree(
            nodeNumber=node,
            gravity=[0.0, 0.0, -9.81],
            jointTypes=[exu.JointType.RevoluteZ] * n,
            linkParents=list(range(-1, n - 1)),
            jointTransformations=exu.Matrix3DList([link["turn"] for link in links]),
            jointOffsets=exu.Vector3DList([link["at"] for link in links]),
            linkInertiasCOM=exu.Matrix3DList([link["inertia"] for link in links]),
            linkCOMs=exu.Vector3DList([link["com"] for link in links]),
            linkMasses=[link["mass"] for link in links],
        )
    )
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solutionSettings.writeSolutionToFile = False
    settings.timeIntegration.numberOfSteps = STEPS
    settings.timeIntegration.endTime = 1e-9 * STEPS
    settings.timeIntegration.verboseMode = 0
    return lambda: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.ExplicitEuler)


def _pairs(text: str) -> list[tuple[Element, Element]]:
    """Links but the base, each with its joint."""
    robot = fromstring(text)
    return list(zip(robot.findall("link")[1:], robot.findall("joint")))


def _link(body: Element, joint: Element) -> dict[str, Any]:
    at, turn = (np.array(_given(joint, "origin", name).split(), float) for name in ("xyz", "rpy"))
    named = {name: float(_given(body, "inertial/inertia", name)) for name in INERTIAS}
    rows = [[named["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"]
    return {
        "at": at,
        "turn": _turned(turn),
        "mass": float(_given(body, "inertial/mass", "value")),
        "com": np.array(_given(body, "inertial/origin", "xyz").split(), float),
        "inertia": np.array(rows),
    }


def _given(element: Element, path: str, name: str) -> str:
    return element.find(path).attrib[name]  # pyright: ignore[reportOptionalMemberAccess]


def _turned(rpy: np.ndarray) -> np.ndarray:
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(rpy), np.cos(rpy)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x
