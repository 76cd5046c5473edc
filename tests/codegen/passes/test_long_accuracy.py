"""Rounding of long chains in loops: at most four times that of the articulated-body recursion
written straight down in double precision, told by the same recursion in 50 digits.

Of codegen.targets: rolled.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mpmath
import numpy as np
import pytest

from codegen import compiler, loader
from codegen.passes import program
from hamel.build.module import published
from hamel.build.stages import equations_of
from tests.trees import chain

pytestmark = pytest.mark.optimised

MOST = 4.0
GRAVITY = "9.81"
needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


class Recursion:
    """Featherstone's recursion in spatial vectors of the links' own frames, over any numbers:
    `number` makes one of the text of the file."""

    def __init__(self, text: str, number: Any, sine: Any, cosine: Any) -> None:
        self.number, self.sine, self.cosine = number, sine, cosine
        robot = ElementTree.fromstring(text)
        self.bodies = [self.body(link.find("inertial")) for link in robot.findall("link")[1:]]
        self.joints = [self.joint(joint) for joint in robot.findall("joint")]

    def numbers(self, text: str) -> np.ndarray:
        return np.array([self.number(x) for x in text.split()])

    def cross(self, x: np.ndarray) -> np.ndarray:
        zero = self.number("0")
        return np.array([[zero, -x[2], x[1]], [x[2], zero, -x[0]], [-x[1], x[0], zero]])

    def turn(self, axis: np.ndarray, angle: Any) -> np.ndarray:
        """By Rodrigues' formula, about an axis of length one."""
        across = self.cross(axis)
        eye = self.numbers("1 0 0 0 1 0 0 0 1").reshape(3, 3)
        one = self.number("1")
        rest = one - self.cosine(angle)
        return eye + across * self.sine(angle) + across.dot(across) * rest

    def body(self, inertial: Any) -> np.ndarray:
        """6 × 6 about the origin of the link."""
        mass = self.number(inertial.find("mass").get("value"))
        named = inertial.find("inertia").attrib
        rows = [["i" + "".join(sorted(a + b)) for b in "xyz"] for a in "xyz"]
        about_centre = np.array([[self.number(named[name]) for name in row] for row in rows])
        c = self.cross(self.numbers(inertial.find("origin").get("xyz")))
        eye = self.numbers("1 0 0 0 1 0 0 0 1").reshape(3, 3)
        upper = np.hstack([about_centre - c.dot(c) * mass, c * mass])
        return np.vstack([upper, np.hstack([c.T * mass, eye * mass])])

    def joint(self, element: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, Any]:
        """Axis of length one, where it is, the placement, and the damping."""
        axis = self.numbers(element.find("axis").get("xyz"))
        roll, pitch, yaw = self.numbers(element.find("origin").get("rpy"))
        x, y, z = self.numbers("1 0 0 0 1 0 0 0 1").reshape(3, 3)
        placed = self.turn(z, yaw).dot(self.turn(y, pitch)).dot(self.turn(x, roll))
        damped = element.find("dynamics")
        damping = self.number("0" if damped is None else damped.get("damping"))
        at = self.numbers(element.find("origin").get("xyz"))
        return axis, at, placed, damping

    def motion(self, R: np.ndarray, at: np.ndarray) -> np.ndarray:
        """6 × 6: twists of the parent in the axes and at the origin of the link."""
        zero = self.numbers("0 " * 9).reshape(3, 3)
        upper = np.hstack([R.T, zero])
        return np.vstack([upper, np.hstack([-R.T.dot(self.cross(at)), R.T])])

    def moving(self, twist: np.ndarray) -> np.ndarray:
        """Of motion vectors; minus its transpose of forces."""
        w, v = self.cross(twist[:3]), self.cross(twist[3:])
        zero = self.numbers("0 " * 9).reshape(3, 3)
        return np.vstack([np.hstack([w, zero]), np.hstack([v, w])])

    def accelerations(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """v̇ of a chain under its weight and damping."""
        X, S, c, twist = [], [], [], self.numbers("0 0 0 0 0 0")
        inertia, bias = [], []
        for (axis, at, placed, _), body, angle, rate in zip(self.joints, self.bodies, q, v):
            X.append(self.motion(placed.dot(self.turn(axis, angle)), at))
            S.append(np.concatenate([axis, self.numbers("0 0 0")]))
            twist = X[-1].dot(twist) + S[-1] * rate
            c.append(self.moving(twist).dot(S[-1] * rate))
            inertia.append(body.copy())
            bias.append(-self.moving(twist).T.dot(body.dot(twist)))
        U, d, u = [None] * len(q), [None] * len(q), [None] * len(q)
        for i in reversed(range(len(q))):
            U[i] = inertia[i].dot(S[i])
            d[i] = S[i].dot(U[i])
            u[i] = -self.joints[i][3] * v[i] - S[i].dot(bias[i])
            if i:
                left = inertia[i] - np.outer(U[i], U[i]) / d[i]
                wrench = bias[i] + left.dot(c[i]) + U[i] * (u[i] / d[i])
                inertia[i - 1] = inertia[i - 1] + X[i].T.dot(left).dot(X[i])
                bias[i - 1] = bias[i - 1] + X[i].T.dot(wrench)
        a = self.numbers(f"0 0 0 0 0 {GRAVITY}")
        result = []
        for i in range(len(q)):
            a = X[i].dot(a) + c[i]
            result.append((u[i] - U[i].dot(a)) / d[i])
            a = a + S[i] * result[-1]
        return np.array(result)


@needs_compiler
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("links", [20, pytest.param(1000, marks=pytest.mark.slow)])
def test_loops_round_as_little_as_the_recursion_written_down(links: int, tmp_path: Path) -> None:
    text = chain(links).replace("1.5707963267948966", "1.2")  # no angle is snapped
    path = tmp_path / "chain.urdf"
    path.write_text(text)
    made = program(equations_of(path), ("dynamics",))
    assert made.kernel("dynamics").rolled is not None
    module = loader.load(published(made, tmp_path / "chain").folder)
    rng = np.random.default_rng(5)
    q, v = rng.uniform(-3, 3, links), rng.uniform(-0.3, 0.3, links)
    ours = module.dynamics(0.0, np.concatenate([q, v]), np.zeros(module.nu))[links:]
    plain = Recursion(text, float, np.sin, np.cos).accelerations(q, v)
    with mpmath.workdps(50):
        many = Recursion(text, mpmath.mpf, mpmath.sin, mpmath.cos)
        truth = many.accelerations(*(np.array([mpmath.mpf(float(x)) for x in y]) for y in (q, v)))
        errors = [
            float(max(abs(mpmath.mpf(float(x)) - y) for x, y in zip(found, truth)))
            for found in (ours, plain)
        ]
        size = float(max(abs(x) for x in truth))
    assert errors[0] <= MOST * errors[1]
    assert errors[0] <= 1e-8 * size
