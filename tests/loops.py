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
