"""Chains and trees of turning and sliding links, as text of URDF files and of models."""

from __future__ import annotations

import random
from collections.abc import Sequence

AXES = ("1 0 0", "0 1 0", "0 0 1", "0.6 0 0.8")


def urdf(name: str, parents: Sequence[int], kinds: Sequence[str], seed: int = 3) -> str:
    """A robot whose link i hangs on link parents[i] (−1 the base), placed and weighted at random;
    every third joint is damped."""
    r = random.Random(seed)
    parts = [f'<robot name="{name}"><link name="base"/>']
    for i, (parent, kind) in enumerate(zip(parents, kinds)):
        com = " ".join(str(r.uniform(-0.1, 0.1)) for _ in range(3))
        tensor = " ".join(f'{k}="{r.uniform(0.01, 0.02)}"' for k in ("ixx", "iyy", "izz"))
        place = " ".join(str(r.uniform(-0.3, 0.3)) for _ in range(3))
        turned = f"{r.uniform(-1, 1)} {r.choice((0, 0.3))} {r.choice((0, 1.5707963267948966))}"
        damped = f'<dynamics damping="{0.1 + i}"/>' if i % 3 == 0 else ""
        parts.append(
            f'<link name="l{i}"><inertial><origin xyz="{com}"/><mass value="{r.uniform(0.5, 2)}"/>'
            f'<inertia {tensor} ixy="0.001" ixz="-0.0005" iyz="0.0002"/></inertial></link>'
            f'<joint name="j{i}" type="{kind}"><parent link="{f"l{parent}" if parent >= 0 else "base"}"/>'
            f'<child link="l{i}"/><origin xyz="{place}" rpy="{turned}"/><axis xyz="{r.choice(AXES)}"/>'
            f'<limit effort="1" velocity="1" lower="-1" upper="1"/>{damped}</joint>'
        )
    return "".join(parts) + "</robot>"


def chain(n: int) -> str:
    """Oblique turning links."""
    return urdf(f"chain{n}", range(-1, n - 1), ["revolute"] * n)


def tree() -> str:
    """Branches on branches, two roots, turning and sliding, further children of both kinds."""
    parents = (-1, 0, 1, 1, 3, 0, -1, 6, 6)
    kinds = ("continuous", "continuous", "prismatic") * 3
    return urdf("branched", parents, kinds)


def equal_links(n: int) -> str:
    """A planar chain of equal links with a spring and a damper in each joint and one torque; all
    values are parameters."""
    lines = [
        f"model: equal{n}", "plane: xy", "gravity: [0, -9.81 m/s^2]",
        "parameters: {mm: 1 kg, l: 1 m, kk: 3 N*m/rad, dd: 0.2 N*m*s/rad}", "bodies:",
        *(f"  b{i}: {{mass: mm, com: [0, -l/2], inertia: mm*l^2/12}}" for i in range(n)),
        "joints:",
        *(
            f"  j{i}: {{type: revolute, parent: {f'b{i - 1}' if i else 'ground'}, child: b{i}, "
            f"{'at: [0, -l], ' if i else ''}coordinate: q{i}}}"
            for i in range(n)
        ),
        "loads:",
        *(f"  s{i}: {{type: spring, joint: j{i}, stiffness: kk}}" for i in range(n)),
        *(f"  d{i}: {{type: damper, joint: j{i}, coefficient: dd}}" for i in range(n)),
        "inputs: {tau: {joint: j1}}",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def several() -> str:
    """A tree on a free base with every joint of several velocities, turned and displaced on both
    sides, with forces, inputs and an armature."""
    body = "{mass: 0.5 kg, com: [0.05, 0.01, 0.1], inertia: [0.011, 0.012, 0.0131]}"
    placed = "at: {parent: [0.3, 0.2, 0.1], child: [0.1, 0.2, 0.3]}, rpy: [0.2, 0.3, 0.4]"
    joints = (
        "{type: free, orientation: quaternion, parent: ground, child: b0, at: [0.3, 0.2, 0.1]}",
        "{type: revolute, axis: [0, 0.6, 0.8], parent: b0, child: b1, at: [0.1, 0, 0.2]}",
        f"{{type: ball, parent: b1, child: b2, {placed}}}",
        f"{{type: planar, axis: -y, parent: b1, child: b3, {placed}}}",
        "{type: universal, axis: y, axis2: x, parent: b2, child: b4, at: [0.1, 0.3, 0.02]}",
        "{type: planar, axis: x, parent: ground, child: b5, at: [0, 0.1, 0.2]}",
        "{type: prismatic, axis: y, parent: b3, child: b6, at: [0.1, 0.3, 0.2]}",
        "{type: free, orientation: quaternion, parent: b5, child: b7}",
        "{type: ball, parent: b7, child: b8, at: [0.1, 0, 0.2]}",
        "{type: point, parent: b8, child: b9, at: [0.1, 0, 0.2]}",
    )
    lines = [
        "model: several", "gravity: [0.3, -9.81 m/s^2, 0.4]", "bodies:",
        *(f"  b{i}: {body}" for i in range(10)),
        "joints:", *(f"  j{i}: {joint}" for i, joint in enumerate(joints)),
        "loads:",
        "  s: {type: spring, joint: j1, stiffness: 3}",
        "  d: {type: damper, velocity: j2.wy, coefficient: 0.4}",
        "  m: {type: armature, coordinate: j9_x, inertia: 0.3}",
        "inputs: {tau: {joint: j1}, pull: {joint: j6}}",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def rope(n: int) -> str:
    """Equal links on ball joints."""
    return f"""
model: rope{n}
gravity: [0.3, 0, -9.81 m/s^2]
repeat: {{i: 1..{n - 1}}}
bodies:
  b0: {{mass: 0.1 kg, com: [0.05, 0.01, 0], inertia: [0.001, 0.002, 0.0021]}}
  "b{{i}}": {{mass: 0.1 kg, com: [0.05, 0.02, 0], inertia: [0.001, 0.002, 0.0021]}}
joints:
  j0: {{type: ball, parent: ground, child: b0}}
  "j{{i}}": {{type: ball, parent: "b{{i-1}}", child: "b{{i}}", at: [0.1 m, 0, 0.02]}}
"""


def rod(n: int) -> str:
    """Such links with springs, dampers and friction in their joints: functions of the C library."""
    inside = "spring: {stiffness: 2}, damper: 0.01"
    rope_of = rope(n).replace("rope", "rod").replace("child: b0}", f"child: b0, {inside}}}")
    rubbing = """loads:
  "f{i}": {type: friction, velocity: "j{i}.wx", coulomb: 0.02, smoothing: 0.5}
"""
    return rope_of.replace("0.02]}\n", f"0.02], {inside}}}\n") + rubbing


def snake(n: int) -> str:
    """A planar chain on no ground."""
    return f"""
model: snake{n}
plane: xy
repeat: {{i: 1..{n - 1}}}
bodies:
  b0: {{mass: 0.5 kg, com: [0.05, 0.01], inertia: 0.001}}
  "b{{i}}": {{mass: 0.1 kg, com: [0.05, 0.02], inertia: 0.0021}}
joints:
  j0: {{type: planar, parent: ground, child: b0, at: [0.3, 0.2]}}
  "j{{i}}": {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", at: [0.1 m, 0.02]}}
inputs: {{"tau{{i}}": {{joint: "j{{i}}"}}}}
"""


def strapped(n: int) -> str:
    """An oblique chain whose neighbours are tied to each other: springs with damping and ropes
    between points, bushings, a formula of where one is seen from the other, and a rope that goes
    through a point of each."""
    points = ", ".join(f"{{body: b{i}, at: [0.05, 0, 0.02]}}" for i in range(n))
    ends = 'between: ["b{i-1}", "b{i}"], at: [[0.05, 0, 0.02], [0.05, 0.01, 0.02]]'
    return f"""
model: strapped{n}
gravity: [0.3, 0, -9.81 m/s^2]
repeat: {{i: 1..{n - 1}}}
bodies:
  b0: {{mass: 0.1 kg, com: [0.05, 0.01, 0], inertia: [0.001, 0.002, 0.0021]}}
  "b{{i}}": {{mass: 0.1 kg, com: [0.05, 0.02, 0], inertia: [0.001, 0.002, 0.0021]}}
joints:
  j0: {{type: revolute, parent: ground, child: b0, axis: y}}
  "j{{i}}":
    {{type: revolute, parent: "b{{i-1}}", child: "b{{i}}", axis: y,
     at: {{parent: {{position: [0.1, 0, 0], rpy: [30 deg, 0, 0]}}}}}}
paths: {{rope: [{points}]}}
loads:
  pull: {{type: tension, path: rope, tension: 3 N}}
  "s{{i}}": {{type: spring, {ends}, stiffness: 90, length: 0.08 m, damping: 0.1}}
  "r{{i}}": {{type: tension, {ends}, tension: 2 N}}
  "p{{i}}":
    {{type: expression, joint: "j{{i}}",
     expression: "-(3 N)*position(b{{i}}, [0.05, 0, 0], b{{i-1}}).z"}}
  "w{{i}}": {{type: bushing, {ends}, stiffness: [50, 60, 70], torsion: 1, damping: 0.02}}
"""


def gait(n: int) -> str:
    """Such a chain whose joints are driven by waves: sines of the time, and sines and cosines of
    angles that are no joint's own; and held by the angle to the neighbour."""
    wave = "(1 N*m)*sin((3 rad/s)*t - 0.4*{i}) + (0.3 N*m)*cos(2*q{i})*sin(2*q{i})"
    wave += " - (0.5 N*m/rad)*angle(b{i}, b{i-1})"
    return snake(n).replace("snake", "gait").replace("0.02]}", '0.02], coordinate: "q{i}"}') + (
        f'loads: {{"wave{{i}}": {{type: expression, joint: "j{{i}}", expression: "{wave}"}}}}\n'
    )


def afloat() -> str:
    """The tree of `several` with loads between its bodies and the ground: contacts, a drag, a
    spring, a bushing, forces and torques of inputs and of the time."""
    loads = """
  ball: {type: contact, body: b2, at: [0.1, 0, 0.2], shape: {sphere: {radius: r}}, plane: {normal: [0.6, 0, 0.8]}, stiffness: k, damping: 0.2, friction: 0.5, smoothing: 1}
  wheel: {type: contact, body: b4, shape: {wheel: {radius: r, axis: y}}, plane: {normal: z}, stiffness: k, damping: 0.2, friction: 0.5, smoothing: 1}
  tyre: {type: contact, body: b1, shape: {wheel: {radius: r, axis: y}}, plane: {normal: z}, stiffness: k, tyre: {longitudinal: {linear: 3}, lateral: {linear: 2}}, smoothing: 1}
  bowl: {type: contact, body: b7, at: [0.1, 0, 0.2], shape: {sphere: {radius: r}}, surface: "z - 0.1*(x^2 + y^2)/(1 m)", stiffness: k, damping: 0.1}
  drag: {type: force, body: b6, components: ["-(2 N*s/m)*velocity(b6, [0, 0.1, 0]).x", "(1 N)*sin((2 rad/s)*t)", 1 N], frame: ground}
  wind: {type: force, body: b8, components: ["-(2 N*s/m)*dot(velocity(b8, [0, 0.1, 0]), direction(b8, x))", 0 N, 0 N], frame: body}
  strut: {type: spring, between: [ground, b8], at: [[0, 0.1, 0.2], [0.2, 0, 0.1]], stiffness: k, length: 0.1 m, damping: 2}
  weld: {type: bushing, between: [b9, ground], at: [[0, 0.1, 0], [0.1, 0, 0]], stiffness: [5, 6, 7], torsion: [1, 2, 3], damping: 2, torsion_damping: 3}
  twist: {type: torque, body: b3, components: [gust*(1 m), 0, 0], frame: ground}
"""
    text = several().replace("model: several", "model: afloat")
    text = text.replace("loads:\n", "loads:" + loads)
    text = text.replace("bodies:\n", "parameters: {k: 30 N/m, r: 3 m}\nbodies:\n", 1)
    return text.replace("inputs: {", "inputs: {gust: {unit: N}, ")


def on_the_floor(n: int) -> str:
    """Equal links, each with a sphere that touches the floor."""
    floor = (
        '  "l{i}": {type: contact, body: "b{i}", at: [0.05, 0, 0.02], shape: {sphere: {radius: 2 m}}, '
        "plane: {normal: z}, stiffness: 100 N/m, damping: 0.1 s/m, friction: 0.5, smoothing: 0.1}\n"
    )
    return rope(n).replace(f"model: rope{n}", f"model: floor{n}") + "loads:\n" + floor
