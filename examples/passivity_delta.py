"""Passivity-based control of a delta robot: three arms carry a platform, and nobody writes down its
closed-loop equations.

In the quasi-velocities w = rates of the driven arms the robot is M_w ẇ + C_w w + g_w = B_w u. With
s = w − w_r the law B_w u = M_w ẇ_r + C_w w_r + g_w − K s leaves M_w ṡ + C_w s + K s = 0, and as
Ṁ_w − 2 C_w is antisymmetric, ½ sᵀ M_w s falls at the rate sᵀ K s: no inertia is inverted and no
acceleration measured (J.-J. Slotine, W. Li, Int. J. Robotics Research 6, 1987). Run it in the
repository: python examples/passivity_delta.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import hamel

Array = np.ndarray[Any, np.dtype[np.float64]]
# the arms stand at 0, 120 and 240 degrees; half of each forearm's mass is at its elbow
DELTA = """model: delta
description: Three arms on a base, and forearms that keep the platform upright.
gravity: [0, 0, -9.81 m/s^2]
parameters: {r: 0.12 m, la: 0.2 m, lf: 0.45 m, rp: 0.05 m}
bodies:
  arm1: {mass: 0.6 kg, com: [0.1, 0, 0], inertia: [0.0002, 0.0035, 0.0035]}
  arm2: {mass: 0.6 kg, com: [0.1, 0, 0], inertia: [0.0002, 0.0035, 0.0035]}
  arm3: {mass: 0.6 kg, com: [0.1, 0, 0], inertia: [0.0002, 0.0035, 0.0035]}
  along_x: {mass: 0}
  along_y: {mass: 0}
  platform: {mass: 0.5 kg}
joints:
  A1: {type: revolute, parent: ground, child: arm1, axis: y, coordinate: a1,
       at: [r, 0, 0]}
  A2: {type: revolute, parent: ground, child: arm2, axis: y, coordinate: a2,
       at: [-r/2, sqrt(3)/2*r, 0], rpy: [0, 0, 120 deg]}
  A3: {type: revolute, parent: ground, child: arm3, axis: y, coordinate: a3,
       at: [-r/2, -sqrt(3)/2*r, 0], rpy: [0, 0, 240 deg]}
  X: {type: prismatic, parent: ground, child: along_x, axis: x, coordinate: x}
  Y: {type: prismatic, parent: along_x, child: along_y, axis: y, coordinate: y}
  Z: {type: prismatic, parent: along_y, child: platform, axis: z, coordinate: z}
constraints:
  forearm1: {type: distance, between: [arm1, platform], at: [[la, 0, 0], [rp, 0, 0]], length: lf}
  forearm2: {type: distance, between: [arm2, platform], length: lf,
             at: [[la, 0, 0], [-rp/2, sqrt(3)/2*rp, 0]]}
  forearm3: {type: distance, between: [arm3, platform], length: lf,
             at: [[la, 0, 0], [-rp/2, -sqrt(3)/2*rp, 0]]}
inputs: {tau1: {joint: A1}, tau2: {joint: A2}, tau3: {joint: A3}}
frames: {tool: {body: platform, position: [0, 0, -0.03]}}
quasi_velocities: {arms: [der(a1), der(a2), der(a3)]}
initial: {a1: 0.3, a2: 0.3, a3: 0.3, guess: {z: -0.4 m}}
"""
FUNCTIONS = ["default", "mass_w", "coriolis_w", "gravity_w", "input_map", "pose_tool"]
GAIN, RATE, STEP = 0.5, 5.0, 1e-3  # K in N m s, Λ in 1/s, s


def built(folder: Path) -> ModuleType:
    path = folder / "delta.yaml"
    path.write_text(DELTA, "utf-8")
    built = hamel.build(path, out=folder / "module", choice="arms", functions=FUNCTIONS)
    return hamel.load(built.folder)


def start(module: ModuleType) -> Array:
    """At rest with the arms at 0.3 rad: the loops are closed from a guess of the platform."""
    return module.project(0.0, np.array([0.3, 0.3, 0.3, 0.0, 0.0, -0.4, 0.0, 0.0, 0.0]))


def wanted(t: float) -> tuple[Array, Array, Array]:
    """Angles of the arms with their first and second derivatives."""
    phases = np.array([0.0, 2.0, 4.0])
    wave = 3.0 * t + phases
    angles = 0.3 + 0.2 * np.sin(wave)
    return angles, 0.6 * np.cos(wave), -1.8 * np.sin(wave)


def reference(t: float, x: Array) -> tuple[Array, Array]:
    """w_r = w_d + Λ (a_d − a) and its rate; the arms are the first coordinates."""
    a, speed, acceleration = wanted(t)
    w = x[-3:]
    return speed + RATE * (a - x[:3]), acceleration + RATE * (speed - w)


def inputs(module: ModuleType, t: float, x: Array) -> Array:
    """u of M_w ẇ_r + C_w w_r + g_w − K s."""
    w_r, rate = reference(t, x)
    s = x[-3:] - w_r
    force = module.mass_w(t, x) @ rate + module.coriolis_w(t, x) @ w_r + module.gravity_w(t, x)
    return np.linalg.solve(module.input_map(t, x), force - GAIN * s)


def storage(module: ModuleType, t: float, x: Array) -> tuple[float, float]:
    """½ sᵀ M_w s, and sᵀ K s, the rate at which it has to fall."""
    s = x[-3:] - reference(t, x)[0]
    return 0.5 * float(s @ module.mass_w(t, x) @ s), GAIN * float(s @ s)


def rate(module: ModuleType, t: float, x: Array) -> Array:
    return module.dynamics(t, x, inputs(module, t, x))


def motion(module: ModuleType, time: float) -> tuple[Array, Array]:
    """Times and states under control, by the classical Runge–Kutta method and `project`."""
    x = start(module)
    states = [x]
    for k in range(round(time / STEP)):
        t = k * STEP
        a = rate(module, t, x)
        b = rate(module, t + STEP / 2, x + STEP / 2 * a)
        c = rate(module, t + STEP / 2, x + STEP / 2 * b)
        d = rate(module, t + STEP, x + STEP * c)
        x = module.project(t + STEP, x + STEP / 6 * (a + 2 * b + 2 * c + d))
        states.append(x)
    return np.array([STEP * k for k in range(len(states))]), np.array(states)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        module = built(Path(folder))
        times, states = motion(module, 2.0)
        for t, x in zip(times[::250], states[::250]):
            error = np.abs(x[:3] - wanted(t)[0]).max()
            tool = module.pose_tool(t, x)[:, 3]
            where = ", ".join(f"{entry:+.3f}" for entry in tool)
            print(
                f"{t:.2f} s  arms off by {error:.1e} rad, storage {storage(module, t, x)[0]:.1e} "
                f"J, tool at ({where}) m"
            )


if __name__ == "__main__":
    main()
