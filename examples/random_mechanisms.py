"""Error against run time of random mechanisms: which method costs least, over two hundred that
nobody chose.

Chains of two to four links with random lengths, masses, springs and dampers; every second one is
closed to a loop by a hinge on the ground, where its end happens to be. `hamel report` runs each by
every method that fits, in processes of this machine, and keeps what is finished.
"""

import math
import random
import sys
from collections import Counter
from pathlib import Path

import hamel

ERROR = 1e-6  # at which methods are compared
TOLERANCES = (1e-5, 1e-7, 1e-9)


def mechanism(seed):
    """The text of a model."""
    rng = random.Random(seed)
    links, closed = rng.randint(2, 4), seed % 2 == 1
    links = max(links, 3) if closed else links
    x = y = heading = before = 0.0
    bodies, joints, initial = [], [], []
    for k in range(links):
        length, mass, angle = rng.uniform(0.2, 0.8), rng.uniform(0.5, 3.0), rng.uniform(-2.0, 2.0)
        heading += angle
        x, y = x + length * math.cos(heading), y + length * math.sin(heading)
        inertia = mass * length**2 / 12
        bodies.append(f"  b{k}: {{mass: {mass} kg, com: [{length / 2} m, 0], inertia: {inertia}}}")
        parent = f"b{k - 1}" if k else "ground"
        spring = f", spring: {{stiffness: {rng.uniform(1, 20)}}}, damper: {rng.uniform(0, 0.1)}"
        joints.append(
            f"  j{k}: {{type: revolute, parent: {parent}, child: b{k}, at: [{before} m, 0], "
            f"coordinate: q{k}{spring}}}"
        )
        initial.append(f"q{k}: {angle} rad")
        before = length
    lines = [f"model: random_{seed}", "plane: xy", "gravity: [0, -9.81 m/s^2]"]
    lines += ["bodies:", *bodies, "joints:", *joints]
    if closed:
        lines += ["closures:", f"  end: {{type: revolute, between: [b{links - 1}, ground], "
                  f"at: [[{before} m, 0], [{x} m, {y} m]]}}"]  # fmt: skip
        held, *guesses = initial
        lines.append(f"initial: {{{held}, guess: {{{', '.join(guesses)}}}}}")
    else:
        lines.append(f"initial: {{{', '.join(initial)}}}")
    return "\n".join(lines) + "\n"


def reported(count=200, out="random_mechanisms", **restrictions):
    """The report of so many, over 2 s."""
    place = Path(out) / "models"
    place.mkdir(parents=True, exist_ok=True)
    files = []
    for seed in range(count):
        files.append(place / f"random_{seed}.yaml")
        files[-1].write_text(mechanism(seed), encoding="utf-8")
    asked = {"tolerances": TOLERANCES, "integrators": ["dop853", "verner9", "radau"]}
    return hamel.report(files, out=out, time=2.0, **{**asked, **restrictions})


def fastest(rows):
    """How often each formulation and integrator is the fastest to that error."""
    best = {}
    for row in rows:
        if row["error"] is not None and row["error"] <= ERROR:
            name = row["formulation"], row["integrator"]
            best[row["model"]] = min(best.get(row["model"], (math.inf, name)), (row["ms"], name))
    return Counter(name for _, name in best.values())


def main(count="200"):
    record = reported(int(count))
    for (formulation, integrator), times in fastest(record.rows).most_common():
        print(f"{times:4} fastest: {formulation}, {integrator}")
    print(f"{len(record.models)} mechanisms, {len(record.rows)} runs; read {record.html}")


if __name__ == "__main__":
    main(*sys.argv[1:])
