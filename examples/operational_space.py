"""Operational space: the hand of an arm goes round a circle, whatever the rest of the arm does.

With J, J̇ v of the hand and M, b of the arm, all generated, tau = Jᵀ Λ (a − J̇ v) + b with
Λ = (J M⁻¹ Jᵀ)⁻¹ gives the hand the acceleration a; what is left of the arm is damped where the hand
does not feel it (O. Khatib, IEEE J. Robotics Automation 3, 1987). The arm is Panda, which has a
joint more than its hand needs. Run it in the repository:
python examples/operational_space.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import hamel

MODEL = Path(__file__).resolve().parent / "panda.yaml"
HAND = "panda_hand_tcp"
START = [0.3, -0.4, 0.2, -2.1, 0.1, 1.8, 0.7, *(7 * [0.0])]  # at rest
RATE, DAMPING, STEP = 6.0, 4.0, 2e-3
Array = np.ndarray[Any, np.dtype[np.float64]]


def built(folder: Path, hand: str = HAND) -> ModuleType:
    of_hand = [f"{name}_{hand}" for name in ("pose", "jacobian", "jdot_v", "frame_velocity")]
    result = hamel.build(MODEL, out=folder / "arm", functions=["default", "input_map", *of_hand])
    return hamel.load(result.folder)


def circle(t: float, centre: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of the hand, 5 cm about the centre."""
    c, s = 0.05 * np.cos(2.0 * t), 0.05 * np.sin(2.0 * t)
    point, speed = np.array([0.0, c, s]), np.array([0.0, -2.0 * s, 2.0 * c])
    return centre + point, speed, -4.0 * point


def inputs(module: ModuleType, t: float, x: Array, centre: Array, hand: str) -> Array:
    """u for the acceleration a = a_d + 2 k (v_d − v) + k² (p_d − p) of the hand."""
    p = getattr(module, f"pose_{hand}")(t, x)[:, 3]
    J = getattr(module, f"jacobian_{hand}")(t, x)[:3]
    v = module.velocity(t, x)
    where, speed, acceleration = circle(t, centre)
    wanted = acceleration + 2.0 * RATE * (speed - J @ v) + RATE**2 * (where - p)
    M = module.mass(t, x)
    q = x[: len(x) - len(v)]
    rest = module.inverse_dynamics(t, np.concatenate([q, v, 0.0 * v]))
    products = getattr(module, f"jdot_v_{hand}")(t, x)[:3]
    inertia = np.linalg.inv(J @ np.linalg.solve(M, J.T))
    task = J.T @ inertia @ (wanted - products)
    damping = -DAMPING * M @ v
    # of the damping only what gives the hand no acceleration
    free = damping - J.T @ inertia @ J @ np.linalg.solve(M, damping)
    return np.linalg.solve(module.input_map(t, x), task + free + rest)


def errors(module: ModuleType, time: float, hand: str = HAND) -> Array:
    """|p − p_d| (m) at every step of the motion, which starts 5 cm off the circle."""
    x = np.array(START)
    centre = getattr(module, f"pose_{hand}")(0.0, x)[:, 3]
    result = []
    for k in range(round(time / STEP)):
        t = k * STEP
        p = getattr(module, f"pose_{hand}")(t, x)[:, 3]
        result.append(np.linalg.norm(p - circle(t, centre)[0]))
        x = step(module, t, x, centre, hand)
    return np.array(result)


def step(module: ModuleType, t: float, x: Array, centre: Array, hand: str) -> Array:
    """The classical Runge–Kutta method, with the controller at every stage."""

    def rate(time: float, there: Array) -> Array:
        return module.dynamics(time, there, inputs(module, time, there, centre, hand))

    a = rate(t, x)
    b = rate(t + STEP / 2, x + STEP / 2 * a)
    c = rate(t + STEP / 2, x + STEP / 2 * b)
    d = rate(t + STEP, x + STEP * c)
    return x + STEP / 6 * (a + 2 * b + 2 * c + d)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        found = errors(built(Path(folder)), 3.0)
        for k in range(0, len(found), 250):
            print(f"{k * STEP:.1f} s  {found[k]:.2e} m off the circle")


if __name__ == "__main__":
    main()
