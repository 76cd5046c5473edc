"""Inertia at the reference configuration, which ratios of critical damping refer to.

The mass matrix there comes of composite bodies (Featherstone, Rigid Body Dynamics Algorithms, 2008,
§6.2) in the ground frame: M_ij = Sᵢᵀ I_c Sⱼ, with twists S about the ground's origin, I_c of all
that the further out of the two joints carries, and armatures on the diagonal.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from derive.robots.markup import Element
from derive.robots.mjcf.bodies import Inverse, Scene, ball_spring, by_time, on_rates
from derive.robots.mjcf.tendons import Line
from derive.robots.numbers import scalar
from derive.robots.robot import GROUND, ONE_RATE, Joint, Reading

Array = NDArray[np.float64]
MOST_RATES = 3_000  # of which a mass matrix is inverted


def felt_inertia(
    reading: Reading, place: Element, along: Sequence[tuple[Joint, float]], scene: Scene
) -> float:
    """What a force along Σ cᵢ qᵢ of hinges and slides has to accelerate, 1/(c M⁻¹ cᵀ) in kg or
    kg m²; 0 where it moves nothing, all c being zero, and after reporting that M has no inverse."""
    inverse = _inverse(reading, place, scene)
    if not inverse.starts:
        return 0.0
    c = np.zeros(len(inverse.matrix))
    for joint, factor in along:
        c[inverse.starts[joint.name]] += factor
    return _carried(c, inverse)


def felt_by_line(reading: Reading, place: Element, line: Line, gear: float, scene: Scene) -> float:
    """The same of a force along gear times the length of a spatial tendon: c = gear ∂ℓ/∂q."""
    inverse = _inverse(reading, place, scene)
    if not inverse.starts:
        return 0.0
    above = {joint.child: joint for joint in scene.robot.joints}
    twists = _twists(scene)
    c = np.zeros(len(inverse.matrix))
    for body, point, push in line.pushes(scene):
        joint = above.get(body)
        while joint is not None:
            S, start = twists[joint.name], inverse.starts[joint.name]
            speeds = np.cross(S[:, :3], point) + S[:, 3:]
            c[start : start + len(S)] += gear * (speeds @ np.array(push))
            joint = above.get(joint.parent)
    return _carried(c, inverse)


def _carried(c: Array, inverse: Inverse) -> float:
    mobility = float(c @ inverse.matrix @ c)
    return 1.0 / mobility if mobility > 0.0 else 0.0


def springs_by_time(reading: Reading, scene: Scene) -> None:
    """Stiffness and damping of every hinge, slide and ball joint with a `springdamper` T, ζ: they
    are m/(T ζ)² and 2 m/T, whatever else the joint says, with m the inverse of the mean of its
    (M⁻¹)ᵢᵢ."""
    for joint in scene.robot.joints:
        given = by_time(reading, joint.place)
        if not given:
            continue
        if joint.type in (*ONE_RATE, "ball"):
            _spring(reading, joint, given, scene)
        else:
            problem, attribute = f"a spring in a {joint.type} joint", "springdamper"
            expected = "springs in hinges, slides and ball joints"
            reading.report(joint.place, problem, expected, "", attribute)


def _spring(reading: Reading, joint: Joint, given: tuple[float, float], scene: Scene) -> None:
    (time, ratio), off = given, scene.settings.off
    inertia = _felt_in(reading, joint, scene)
    stiffness = inertia / (time * ratio) ** 2 * ("spring" not in off)
    damping = 2.0 * inertia / time * ("damper" not in off)
    note = "spring and damper by the time constant and damping ratio of the file"
    joint.notes.append(note)
    if joint.type == "ball":
        if stiffness:
            ball_spring(reading, joint, stiffness, scene)
        on_rates(reading, joint, "damper", damping, joint.rates(), scene)
        return
    rest = scalar(reading, joint.place, "springref")
    rest = scene.settings.angle(rest) if joint.type == "revolute" else rest
    joint.spring = (stiffness, rest) if stiffness else None
    joint.damper += damping  # beside that of actuators


def _felt_in(reading: Reading, joint: Joint, scene: Scene) -> float:
    """What a force in a joint has to accelerate, its rates on an average."""
    inverse = _inverse(reading, joint.place, scene)
    if not inverse.starts:
        return 0.0
    start = inverse.starts[joint.name]
    mobility = float(np.mean(np.diag(inverse.matrix)[start : start + len(joint.rates())]))
    return 1.0 / mobility if mobility > 0.0 else 0.0


def _inverse(reading: Reading, place: Element, scene: Scene) -> Inverse:
    """M⁻¹, found once for each file; without entries after reporting that there is none."""
    if scene.inverse is None:
        try:
            scene.inverse = _inverse_mass(reading, scene)
        except np.linalg.LinAlgError:
            problem = "damping by a ratio where the mass matrix is singular"
            reading.report(place, problem, "joints that accelerate something")
            scene.inverse = Inverse(np.zeros((0, 0)), {})
    return scene.inverse


def _inverse_mass(reading: Reading, scene: Scene) -> Inverse:
    twists, composites = _twists(scene), _composites(scene)
    ends = np.cumsum([len(S) for S in twists.values()]).tolist()
    starts = {name: end - len(twists[name]) for name, end in zip(twists, ends)}
    size = ends[-1]
    if size > MOST_RATES:
        problem = f"damping by a ratio in a model of {size} velocities"
        scene.robot.root.refuse(problem, f"at most {MOST_RATES}, or damping in numbers")
    M = np.zeros((size, size))
    above = {joint.child: joint for joint in scene.robot.joints}
    for joint in scene.robot.joints:
        own = slice(starts[joint.name], starts[joint.name] + len(twists[joint.name]))
        force = twists[joint.name] @ composites[joint.child]
        carrier: Joint | None = joint
        while carrier is not None:
            S = twists[carrier.name]
            there = slice(starts[carrier.name], starts[carrier.name] + len(S))
            M[own, there] = force @ S.T
            M[there, own] = M[own, there].T
            carrier = above.get(carrier.parent)
        M[own, own] += np.diag(_armatures(reading, joint, len(twists[joint.name])))
    return Inverse(np.asarray(np.linalg.inv(M), dtype=np.float64), starts)


def _armatures(reading: Reading, joint: Joint, rates: int) -> list[float]:
    """What the file says, where the joint of the model has it as a load; to the translation of a
    free joint it is a body."""
    armature = joint.armature or scalar(reading, joint.place, "armature")
    return [0.0 if joint.type == "free" and k < 3 else armature for k in range(rates)]


def _twists(scene: Scene) -> dict[str, Array]:
    """Per joint its rates' twists (angular, linear) about the ground's origin, one a row."""
    carried = {joint.parent: joint.child for joint in scene.robot.joints}
    result: dict[str, Array] = {}
    for joint in scene.robot.joints:
        body = joint.child
        while body not in scene.poses:  # between several joints of one body
            body = carried[body]
        pose = scene.poses[body]
        turn = np.array(pose.turn)
        point = np.array(pose.at) + turn @ np.array(joint.at_child)
        result[joint.name] = _of_type(joint, turn, point)
    return result


def _of_type(joint: Joint, turn: Array, point: Array) -> Array:
    if joint.type == "fixed":
        return np.zeros((0, 6))
    if joint.type == "prismatic":
        return np.concatenate([np.zeros(3), turn @ np.array(joint.axis)])[None]
    axes = np.array([turn @ np.array(joint.axis)]) if joint.axis else turn.T
    turning = np.hstack([axes, -np.cross(axes, point)])
    if joint.type != "free":
        return turning
    return np.vstack([np.hstack([np.zeros((3, 3)), np.eye(3)]), turning])


def _composites(scene: Scene) -> dict[str, Array]:
    """Of each body with all that it carries: spatial inertia about the ground's origin, 6 × 6."""
    result = {body.name: np.zeros((6, 6)) for body in scene.robot.bodies}
    for body in scene.robot.bodies:
        if body.mass and body.name in scene.poses:
            pose = scene.poses[body.name]
            R, com = np.array(pose.turn), np.array(body.com)
            tensor = R @ _full(body.inertia) @ R.T if body.inertia else np.zeros((3, 3))
            result[body.name] += _spatial(body.mass, np.array(pose.at) + R @ com, tensor)
    parents = {joint.child: joint.parent for joint in scene.robot.joints}
    for name in reversed(_outwards(scene)):
        if parents[name] != GROUND:
            result[parents[name]] = result[parents[name]] + result[name]
    return result


def _outwards(scene: Scene) -> list[str]:
    """Bodies, each behind the one that carries it."""
    below: dict[str, list[str]] = {}
    for joint in scene.robot.joints:
        below.setdefault(joint.parent, []).append(joint.child)
    order, waiting = list[str](), [GROUND]
    while waiting:
        name = waiting.pop()
        order += [name] if name != GROUND else []
        waiting += below.get(name, [])
    return order


def _full(tensor: Sequence[float]) -> Array:
    xx, yy, zz, xy, xz, yz = tensor
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _spatial(mass: float, com: Array, tensor: Array) -> Array:
    """[J, m c×; −m c×, m 1] with J about the origin."""
    x, y, z = com
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    inertia = tensor - mass * skew @ skew
    return np.block([[inertia, mass * skew], [-mass * skew, mass * np.eye(3)]])
