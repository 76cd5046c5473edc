"""Hand-made Equations that have one of everything: guards, an iteration, odd functions, constants,
time, parameters."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import casadi as ca

from derive.choices.records import Guard
from derive.formulations.records import Argument, Equations, Function, Iteration, Result
from derive.mechanics.records import Named

LABELS = ("q1", "q2", "der(q1)", "der(q2)")
UNITS = ("rad", "rad", "rad/s", "rad/s")


def toy(
    name: str = "toy", description: str = "Two links on a hinge.", about: str = "state derivative"
) -> Equations:
    t, x, u, p = ca.SX.sym("t"), ca.SX.sym("x", 4), ca.SX.sym("u", 1), ca.SX.sym("p", 3)
    M, h, energy = _mechanics(x, p)
    determinant = M[0, 0] * M[1, 1] - M[0, 1] * M[1, 0]
    right = ca.vertcat(u[0], 0) - h
    rates = (
        ca.vertcat(
            M[1, 1] * right[0] - M[0, 1] * right[1], -M[1, 0] * right[0] + M[0, 0] * right[1]
        )
        / determinant
    )
    named = (Named("M", "joint-space mass matrix", M), Named("h", "Coriolis and gravity forces", h))
    guard = Guard("det M", determinant, 1e-12, part=1e-9)
    functions = (
        Function(
            "dynamics",
            about,
            Result("xdot", ca.vertcat(x[2:], rates), LABELS, UNITS),
            named,
            (guard,),
        ),
        Function(
            "mass", "mass matrix", Result("M", M, ("M11", "M12", "M21", "M22"), ("kg*m^2",) * 4)
        ),
        Function("energy", "total energy", Result("E", energy, ("E",), ("J",))),
        _project(x),
        Function(
            "odd", "functions seldom met", Result("y", _odd(t, x), tuple("abcdefgh"), ("",) * 8)
        ),
        Function(
            "constant", "two numbers", Result("k", ca.vertcat(1.0, 2 / 3), ("a", "b"), ("", ""))
        ),
    )
    arguments = (
        Argument("t", t, ("t",), ("s",)),
        Argument("x", x, LABELS, UNITS),
        Argument("u", u, ("tau",), ("N*m",)),
        Argument("p", p, ("l1", "l2", "m"), ("m", "m", "kg")),
    )
    system: Any = SimpleNamespace(
        model=SimpleNamespace(
            name=name, description=description, fixed=(), bodies=(), joints=(), frames=()
        ),
        constants=(),
        quaternions=(),
        links=(),
        phi=ca.SX(0, 1),
    )
    return Equations(
        system,
        "quasi-velocities",
        "crank",
        "it is the only one",
        arguments,
        functions,
        named,
        ("a pivot",),
        ("w1", "w2"),
        (0.5, 0.7, 1.3),
    )


def _mechanics(x: ca.SX, p: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    (q1, q2, w1, w2), (l1, l2, m) = (x[i] for i in range(4)), (p[i] for i in range(3))
    cross = m * (l2**2 + l1 * l2 * ca.cos(q2))
    M = ca.vertcat(
        ca.horzcat(m * (l1**2 + l2**2 + 2 * l1 * l2 * ca.cos(q2)), cross),
        ca.horzcat(cross, m * l2**2),
    )
    bend = m * l1 * l2 * ca.sin(q2)
    weight = 9.81 * m * l2 * ca.sin(q1 + q2)
    h = ca.vertcat(
        -bend * (2 * w1 * w2 + w2**2) + 9.81 * m * l1 * ca.sin(q1) + weight, bend * w1**2 + weight
    )
    energy = 0.5 * ca.mtimes([x[2:].T, M, x[2:]]) - 9.81 * m * (
        l1 * ca.cos(q1) + l2 * ca.cos(q1 + q2)
    )
    return M, h, energy


def _project(x: ca.SX) -> Function:
    """Newton's method for sin(q2) = q1/2."""
    gap = ca.sin(x[1]) - x[0] / 2
    step = ca.vertcat(x[0], x[1] - gap / ca.cos(x[1]), x[2], x[3])
    guard = Guard("cos q2", ca.cos(x[1]), 1e-9)
    return Function(
        "project",
        "consistent state",
        Result("x", step, LABELS, UNITS),
        (),
        (guard,),
        Iteration(1e-13, 20),
        ca.fabs(gap),
    )


def _odd(t: ca.SX, x: ca.SX) -> ca.SX:
    a, b, c = x[0], x[1], x[2]
    return ca.vertcat(
        ca.if_else(a > 0.1, b, t), ca.fmin(a, b), ca.atan2(a, b), ca.sign(c), ca.erf(a), ca.fabs(a) ** 2.5, ca.exp(-b),
        ca.if_else(ca.logic_and(a < b, ca.logic_not(c >= 0)), -a, ca.tanh(c) - ca.asinh(-c)),
    )  # fmt: skip


def circle() -> Equations:
    """A point driven round the unit circle at rate p, with a wall at t = 9 that it cannot pass;
    power u · b."""
    t, x, u, p = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 1)
    labels, units = ("a", "b"), ("m", "m")
    closing = ca.sumsqr(x) - 1
    wall = 9 - t
    step = x - closing / (2 * ca.sumsqr(x)) * x
    rate = ca.vertcat(-p * x[1] + 1e-30 * ca.sqrt(wall), p * x[0])
    functions = (
        Function(
            "dynamics",
            "state derivative",
            Result("xdot", rate, labels, units),
            (),
            (Guard("wall", wall, 1e-9),),
        ),
        Function("constraints", "violation", Result("violation", closing, ("phi",), ("m^2",))),
        Function(
            "project",
            "on the circle",
            Result("x", step, labels, units),
            (),
            (),
            Iteration(1e-14, 9),
            ca.fabs(closing),
        ),
        Function("power", "power", Result("power", u * x[1], ("power",), ("W",))),
    )
    arguments = (
        Argument("t", t, ("t",), ("s",)),
        Argument("x", x, labels, units),
        Argument("u", u, ("force",), ("N",)),
        Argument("p", p, ("rate",), ("rad/s",)),
    )
    system: Any = SimpleNamespace(
        model=SimpleNamespace(
            name="circle", description="Round and round.", fixed=(), bodies=(), joints=(), frames=()
        ),
        constants=(),
        quaternions=(),
        links=(),
        phi=closing,
    )
    return Equations(
        system,
        "quasi-velocities",
        "both",
        "it is simple",
        arguments,
        functions,
        (),
        (),
        ("b",),
        (2.0,),
    )


def turning(value: ca.SX, x: ca.SX) -> Equations:
    """One function of one argument, called dynamics so that it has a batch too."""
    labels = tuple(f"y{i}" for i in range(value.numel()))
    function = Function(
        "dynamics", "sine and cosine", Result("y", value, labels, ("",) * len(labels))
    )
    names = tuple(f"x{i}" for i in range(x.numel()))
    arguments = tuple(
        Argument(
            name,
            x if name == "x" else ca.SX(0, 1),
            names if name == "x" else (),
            ("rad",) * len(names) if name == "x" else (),
        )
        for name in "xup"
    )
    system: Any = SimpleNamespace(
        model=SimpleNamespace(
            name="turn", description="", fixed=(), bodies=(), joints=(), frames=()
        ),
        constants=(),
        quaternions=(),
        links=(),
        phi=ca.SX(0, 1),
    )
    time = Argument("t", ca.SX.sym("t"), ("t",), ("s",))
    return replace(
        toy(), system=system, arguments=(time, *arguments), functions=(function,), parameters=()
    )
