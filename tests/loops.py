"""Mechanisms whose loops are many, repeat each other, or can be laid flat."""


def four_bars(n: int) -> str:
    """n four-bars in a row (IFToMM benchmark A02): n + 1 rods stand on the ground at (i, 0), n
    couplers join their tips."""
    link = "{mass: m, com: [l/2, 0], inertia: m*l^2/12}"
    bodies = [f"  r{i}: {link}" for i in range(n + 1)] + [f"  c{i}: {link}" for i in range(n)]
    joints = [
        f"  A{i}: {{type: revolute, parent: ground, child: r{i}, at: [{i}*l, 0], coordinate: a{i}}}"
        for i in range(n + 1)
    ]
    joints += [
        f"  B{i}: {{type: revolute, parent: r{i}, child: c{i}, at: [l, 0], coordinate: b{i}}}"
        for i in range(n)
    ]
    closures = [
        f"  C{i}: {{type: revolute, between: [c{i}, r{i + 1}], at: [[l, 0], [l, 0]]}}"
        for i in range(n)
    ]
    guesses = [f"a{i + 1}: 90 deg, b{i}: -90 deg" for i in range(n)]
    lines = [
        "model: four_bars",
        "plane: xy",
        "gravity: [0, -9.81 m/s^2]",
        "parameters: {l: 1 m, m: 1 kg}",
    ]
    lines += ["bodies:", *bodies, "joints:", *joints, "closures:", *closures]
    lines += ["quasi_velocities: {crank: [der(a0)]}"]
    lines += [f"initial: {{a0: 90 deg, der(a0): -1 rad/s, guess: {{{', '.join(guesses)}}}}}"]
    return "\n".join(lines) + "\n"


def flat(a: float, b: float, start: str) -> str:
    """A planar four-bar with ground a, crank a, rod b, rocker b: all its links can lie along one
    line."""
    return f"""
model: change_point
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {{a: {a} m, b: {b} m, m: 1 kg}}
bodies:
  crank: {{mass: m, com: [a/2, 0], inertia: m*a^2/12}}
  rod: {{mass: m, com: [b/2, 0], inertia: m*b^2/12}}
  rocker: {{mass: m, com: [b/2, 0], inertia: m*b^2/12}}
joints:
  A: {{type: revolute, parent: ground, child: crank, coordinate: q1}}
  B: {{type: revolute, parent: crank, child: rod, at: [a, 0], coordinate: q2}}
  D: {{type: revolute, parent: ground, child: rocker, at: [a, 0], coordinate: q3}}
closures:
  C: {{type: revolute, between: [rod, rocker], at: [[b, 0], [b, 0]]}}
quasi_velocities: {{crank: [der(q1)], even: orthonormal, best: auto}}
initial: {{{start}}}
"""


KITE = flat(0.3, 0.5, "q1: 70 deg, guess: {q2: -20 deg, q3: 80 deg}")
RHOMBUS = flat(0.3, 0.3, "q1: 70 deg, guess: {q2: -70 deg, q3: 70 deg}")

IN_SPACE = """
model: in_space
gravity: [0, -9.81 m/s^2, 0]
parameters: {a: 0.2 m, b: 0.5 m, c: 0.4 m, d: 0.55 m, m: 1 kg}
bodies:
  crank: {mass: m, com: [a/2, 0, 0], inertia: [0.001, 0.004, 0.004]}
  rod: {mass: m, com: [b/2, 0, 0], inertia: [0.001, 0.02, 0.02]}
  rocker: {mass: m, com: [c/2, 0, 0], inertia: [0.001, 0.013, 0.013]}
joints:
  A: {type: revolute, parent: ground, child: crank, axis: z, coordinate: q1}
  B: {type: revolute, parent: crank, child: rod, at: [a, 0, 0], axis: z, coordinate: q2}
  D: {type: revolute, parent: ground, child: rocker, at: [d, 0, 0], axis: z, coordinate: q3}
closures:
  C: {type: revolute, between: [rod, rocker], at: [[b, 0, 0], [c, 0, 0]], axis: z}
quasi_velocities: {crank: [der(q1)], even: orthonormal}
initial: {q1: 60 deg, guess: {q2: -30 deg, q3: 100 deg}}
"""
TWICE = IN_SPACE.replace(
    "quasi_velocities",
    "  E: {type: ball, between: [rod, rocker], at: [[b, 0, 0.1 m], [c, 0, 0.1 m]]}\nquasi_velocities",
).replace("in_space", "twice")


def ladder(n: int, speed: str = "p") -> str:
    """Two chains in a plane, pinned to the ground side by side, whose links are joined at their
    tips by n rungs with mass. Each loop shares the links of the one before it."""
    bodies, joints, closures, guesses = list[str](), list[str](), list[str](), list[str]()
    for i in range(1, n + 1):
        on_a, on_b, at = (f"a{i - 1}", f"b{i - 1}", "l") if i > 1 else ("ground", "ground", "0")
        beside = "l" if i > 1 else "0.8*l"
        bodies += [
            f"  a{i}: {{mass: 1 kg, com: [l/2, 0.02 m], inertia: 0.02 kg*m^2}}",
            f"  b{i}: {{mass: 1.2 kg, com: [l/2, 0], inertia: 0.025 kg*m^2}}",
            f"  r{i}: {{mass: 0.6 kg, com: [d/2, 0], inertia: 0.01 kg*m^2}}",
        ]
        joints += [
            f"  A{i}: {{type: revolute, parent: {on_a}, child: a{i}, at: [{at}, 0], coordinate: p{i}}}",
            f"  B{i}: {{type: revolute, parent: {on_b}, child: b{i}, at: [{beside}, 0], "
            f"coordinate: s{i}}}",
            f"  R{i}: {{type: revolute, parent: a{i}, child: r{i}, at: [l, 0], coordinate: e{i}}}",
        ]
        closures.append(f"  C{i}: {{type: revolute, between: [r{i}, b{i}], at: [[d, 0], [l, 0]]}}")
        guesses += [f"s{i}: {_bend(i)} deg, e{i}: {-sum(map(_bend, range(1, i + 1)))} deg"]
    return _in_plane("ladder", n, [bodies, joints, closures], guesses, speed)


def _bend(i: int) -> int:
    return -80 if i == 1 else 3 * (-1) ** i


def _in_plane(
    name: str, n: int, parts: list[list[str]], guesses: list[str], speed: str = "p"
) -> str:
    bodies, joints, closures = parts
    lines = [f"model: {name}", "plane: xy", "gravity: [0, -9.81 m/s^2]"]
    lines += ["parameters: {l: 0.5 m, d: 0.4 m}"]
    lines += ["bodies:", *bodies, "joints:", *joints, "closures:", *closures]
    speeds = ", ".join(f"der({speed}{i})" for i in range(1, n + 1))
    lines += [f"quasi_velocities: {{left: [{speeds}]}}"]
    given = ", ".join(f"p{i}: {_bend(i)} deg" for i in range(1, n + 1))
    lines += [f"initial: {{{given}, guess: {{{', '.join(guesses)}}}}}"]
    return "\n".join(lines) + "\n"


def ladder_of_rods(n: int) -> str:
    """The same with massless rods for rungs, a spring across and a damper in a joint."""
    bodies, joints = list[str](), list[str]()
    for i in range(1, n + 1):
        on_a, on_b, at = (f"a{i - 1}", f"b{i - 1}", "l") if i > 1 else ("ground", "ground", "0")
        beside = "l" if i > 1 else "d"
        bodies += [
            f"  a{i}: {{mass: 1 kg, com: [l/2, 0.02 m], inertia: 0.02 kg*m^2}}",
            f"  b{i}: {{mass: 1.2 kg, com: [l/2, 0], inertia: 0.025 kg*m^2}}",
        ]
        joints += [
            f"  A{i}: {{type: revolute, parent: {on_a}, child: a{i}, at: [{at}, 0], coordinate: p{i}}}",
            f"  B{i}: {{type: revolute, parent: {on_b}, child: b{i}, at: [{beside}, 0], "
            f"coordinate: s{i}}}",
        ]
    rods = [
        f"  C{i}: {{type: distance, between: [a{i}, b{i}], at: [[l, 0], [l, 0]], length: 0.42 m}}"
        for i in range(1, n + 1)
    ]
    loads = [
        "loads:",
        "  k: {type: spring, between: [a1, b2], at: [[0.1, 0.05], [0.2, 0]], stiffness: 40 N/m}",
        "  c: {type: damper, joint: A2, coefficient: 0.1 N*m*s/rad}",
    ]
    guesses = [f"s{i}: {_bend(i)} deg" for i in range(1, n + 1)]
    text = _in_plane("ladder_of_rods", n, [bodies, joints, rods], guesses)
    return text.replace("closures:", "constraints:") + "\n".join(loads) + "\n"


def ladder_afloat(n: int) -> str:
    """In space, on a free body: links that turn about x and y by turns, beside others on universal
    joints, and rungs between them. Some joints have rotors."""
    bodies = ["  hull: {mass: 5 kg, com: [0.1, 0.05, 0], inertia: [0.4, 0.5, 0.6]}"]
    joints, closures, guesses = ["  H: {type: free, parent: ground, child: hull}"], [], []
    for i in range(1, n + 1):
        on_a, on_b, at = (f"a{i - 1}", f"b{i - 1}", "-0.5 m") if i > 1 else ("hull", "hull", "0")
        bodies += [
            f"  a{i}: {{mass: 1 kg, com: [0.02, 0, -0.2], inertia: [0.02, 0.03, 0.015]}}",
            f"  b{i}: {{mass: 1.2 kg, com: [0, 0.01, -0.25], inertia: [0.02, 0.03, 0.025]}}",
            f"  r{i}: {{mass: 0.5 kg, com: [0.2, 0, 0.01], inertia: [0.002, 0.01, 0.01]}}",
        ]
        joints += [
            f"  A{i}: {{type: revolute, parent: {on_a}, child: a{i}, axis: {'xy'[i % 2]}, "
            f"at: [0, 0, {at}], coordinate: p{i}, armature: {0.01 * (i % 2)} kg*m^2}}",
            f"  B{i}: {{type: universal, parent: {on_b}, child: b{i}, axis: x, axis2: y, "
            f"at: [{'0' if i > 1 else '0.4 m'}, 0, {at}], coordinates: [s{i}, t{i}]}}",
            f"  R{i}: {{type: universal, parent: a{i}, child: r{i}, axis: y, axis2: z, "
            f"at: [0, 0, -0.5 m], coordinates: [e{i}, f{i}]}}",
        ]
        closures.append(
            f"  C{i}: {{type: ball, between: [r{i}, b{i}], at: [[0.42, 0, 0], [0, 0, -0.5 m]]}}"
        )
        side = (-1) ** i
        guesses += [f"s{i}: {2 * side} deg, t{i}: 0, e{i}: 0, f{i}: {5 * side} deg"]
    free = ["H.vx", "H.vy", "H.vz", "H.wx", "H.wy", "H.wz"]
    speeds = [x for i in range(1, n + 1) for x in (f"der(p{i})", f"der(s{i})")]
    lines = ["model: ladder_afloat", "gravity: [0, 0, -9.81 m/s^2]"]
    lines += ["bodies:", *bodies, "joints:", *joints, "closures:", *closures]
    lines += [f"quasi_velocities: {{left: [{', '.join(free + speeds)}]}}"]
    given = ", ".join(f"p{i}: {10 * (-1) ** i} deg" for i in range(1, n + 1))
    lines += [f"initial: {{{given}, guess: {{{', '.join(guesses)}}}}}"]
    return "\n".join(lines) + "\n"
