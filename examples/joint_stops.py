"""A pendulum between stops of its joint: each motion ends where the joint does, and the next begins
there with a part of the speed.

Run it in the repository: python examples/joint_stops.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from types import ModuleType

import numpy as np

import hamel

PENDULUM = """model: stopped_pendulum
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {rod: {mass: 1 kg, com: [0, -0.5 m], inertia: 0.1 kg*m^2}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
initial: {q: 60 deg}
events:
  bottom: q
  left: {formula: q + 45 deg, direction: falling, stop: true}
  right: {formula: q - 80 deg, direction: rising, stop: true}
"""
REBOUND = 0.7


def built(folder: Path) -> ModuleType:
    path = folder / "stopped_pendulum.yaml"
    path.write_text(PENDULUM, "utf-8")
    return hamel.load(hamel.build(path, out=folder / "module").folder)


def bounces(module: ModuleType, x: np.ndarray, time: float) -> list[tuple[float, float]]:
    """(time, speed before) of every stop, until the pendulum reaches none before `time`."""
    t, found = 0.0, []
    while t < time:
        motion = module.simulate((t, time), x, rtol=1e-10, atol=1e-12)
        t, x = float(motion.t[-1]), motion.x[-1].copy()
        if motion.status != module.Status.EVENT:
            break
        found.append((t, float(x[1])))
        x[1] *= -REBOUND
    return found


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        module = built(Path(folder))
        for t, speed in bounces(module, np.array([np.pi / 3, 0.0]), 10.0):
            print(f"stop at {t:.9f} s with {speed:+.6f} rad/s")


if __name__ == "__main__":
    main()
