"""Models of any size, as text: rows of four-bars (IFToMM A02) and pendulum chains."""

from __future__ import annotations

from pathlib import Path


def four_bars(n: int, place: Path) -> Path:
    """IFToMM benchmark A02: n four-bars in a row, n + 1 cranks and n rods of one metre and one
    kilogram."""
    rod = "{mass: 1 kg, com: [0.5 m, 0], inertia: 1/12}"
    bodies = [f"  crank{i}: {rod}" for i in range(n + 1)] + [
        f"  rod{i}: {rod}" for i in range(1, n + 1)
    ]
    joints, closures = (
        ["  A0: {type: revolute, parent: ground, child: crank0, at: [0, 0], coordinate: q0}"],
        [],
    )
    for i in range(1, n + 1):
        joints.append(
            f"  B{i}: {{type: revolute, parent: crank{i - 1}, child: rod{i}, at: [1 m, 0], coordinate: s{i}}}"
        )
        joints.append(
            f"  A{i}: {{type: revolute, parent: ground, child: crank{i}, at: [{i} m, 0], coordinate: q{i}}}"
        )
        closures.append(
            f"  C{i}: {{type: revolute, between: [rod{i}, crank{i}], at: [[1 m, 0], [1 m, 0]]}}"
        )
    guess = ", ".join(f"s{i}: -90 deg, q{i}: 90 deg" for i in range(1, n + 1))
    lines = [
        f"model: four_bars{n}",
        "plane: xy",
        "gravity: [0, -9.81 m/s^2]",
        "bodies:",
        *bodies,
        "joints:",
        *joints,
        "closures:",
    ]
    lines += [
        *closures,
        "quasi_velocities:",
        "  crank: [der(q0)]",
        f"initial: {{q0: 90 deg, der(q0): -1 rad/s, guess: {{{guess}}}}}",
    ]
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text("\n".join(lines) + "\n")
    return place
