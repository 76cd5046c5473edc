"""Whole mechanisms for the comparison of simulations: their equations from Lagrange's, written here
and not by hamel."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from peers import augmented
from peers.augmented import Lagrangian


@dataclass(frozen=True)
class Mechanism:
    """y' = f(t, y) for y = (q, q̇): the augmented system, inputs and parameters folded in; `names`:
    its coordinates."""

    name: str
    names: tuple[str, ...]
    rates: ca.Function


def four_bar() -> Mechanism:
    return _of(augmented.four_bar(), ("q1", "q2", "q3"), np.zeros(1))


def snake3() -> Mechanism:
    return _of(augmented.snake3(), ("x", "y", "th", "phi1", "phi2"), np.array([0.01, -0.02]))


def andrews() -> Mechanism:
    """IVP Test Set: its mass matrix, spring and loops."""
    m = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
    I = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
    xa, ya, xb, yb, xc, yc, c0, l0, mom = (
        -0.06934,
        -0.00227,
        -0.03635,
        0.03273,
        0.014,
        0.072,
        4530.0,
        0.07785,
        0.033,
    )
    d, da, e, ea, rr, ra, ss, sa, sb, sc, sd = (
        0.028,
        0.0115,
        0.02,
        0.01421,
        0.007,
        0.00092,
        0.035,
        0.01874,
        0.01043,
        0.018,
        0.02,
    )
    ta, tb, u, ua, ub, zf, zt, fa = 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421
    q, qd = ca.SX.sym("q", 7), ca.SX.sym("qd", 7)
    b, T, g, P, D, O, E = ca.vertsplit(q)
    sin, cos = ca.sin, ca.cos
    M = ca.SX(7, 7)
    M[0, 0] = m[0] * ra**2 + m[1] * (rr**2 - 2 * da * rr * cos(T) + da**2) + I[0] + I[1]
    M[1, 0] = M[0, 1] = m[1] * (da**2 - da * rr * cos(T)) + I[1]
    M[1, 1] = m[1] * da**2 + I[1]
    M[2, 2] = m[2] * (sa**2 + sb**2) + I[2]
    M[3, 3] = m[3] * (e - ea) ** 2 + I[3]
    M[4, 3] = M[3, 4] = m[3] * ((e - ea) ** 2 + zt * (e - ea) * sin(P)) + I[3]
    M[4, 4] = (
        m[3] * (zt**2 + 2 * zt * (e - ea) * sin(P) + (e - ea) ** 2)
        + m[4] * (ta**2 + tb**2)
        + I[3]
        + I[4]
    )
    M[5, 5] = m[5] * (zf - fa) ** 2 + I[5]
    M[6, 5] = M[5, 6] = m[5] * ((zf - fa) ** 2 - u * (zf - fa) * sin(O)) + I[5]
    M[6, 6] = (
        m[5] * ((zf - fa) ** 2 - 2 * u * (zf - fa) * sin(O) + u**2)
        + m[6] * (ua**2 + ub**2)
        + I[5]
        + I[6]
    )
    spring = ca.sqrt(
        (sd * cos(g) + sc * sin(g) + xb - xc) ** 2 + (sd * sin(g) - sc * cos(g) + yb - yc) ** 2
    )
    x, y = rr * cos(b) - d * cos(b + T), rr * sin(b) - d * sin(b + T)
    closing = ca.vertcat(
        *(x - ss * sin(g) - xb, y + ss * cos(g) - yb),
        *(x - e * sin(P + D) - zt * cos(D) - xa, y + e * cos(P + D) - zt * sin(D) - ya),
        *(x - zf * cos(O + E) - u * sin(E) - xa, y - zf * sin(O + E) + u * cos(E) - ya),
    )
    energy = ca.dot(qd, ca.mtimes(M, qd)) / 2
    Q = ca.vertcat(mom, ca.SX.zeros(6))
    A = ca.jacobian(closing, q)
    names = ("beta", "Theta", "gamma", "Phi", "delta", "Omega", "epsilon")
    of = Lagrangian(
        "andrews", q, qd, ca.SX(0, 1), energy, c0 / 2 * (spring - l0) ** 2, Q, A, tuple(range(13))
    )
    return _of(of, names, np.zeros(0))


def car_axis() -> Mechanism:
    """IVP Test Set: the road moves one constraint with time, so that it is written here and not by
    `Lagrangian`."""
    mass, L, L0, r, w, g = 10 * 0.01**2 / 2, 1.0, 0.5, 0.1, 10.0, 1.0
    t, q, qd = ca.SX.sym("t"), ca.SX.sym("q", 4), ca.SX.sym("qd", 4)
    xl, yl, xr, yr = ca.vertsplit(q)
    yb = r * ca.sin(w * t)
    xb = ca.sqrt(L**2 - yb**2)
    V = (
        (ca.sqrt(xl**2 + yl**2) - L0) ** 2 / 2
        + (ca.sqrt((xr - xb) ** 2 + (yr - yb) ** 2) - L0) ** 2 / 2
        + mass * g * (yl + yr)
    )
    phi = ca.vertcat(xl * xb + yl * yb, (xl - xr) ** 2 + (yl - yr) ** 2 - L**2)
    A = ca.jacobian(phi, q)
    rate = ca.mtimes(A, qd) + ca.jacobian(phi, t)
    gamma = -ca.jtimes(rate, q, qd) - ca.jacobian(rate, t)
    K = ca.vertcat(ca.horzcat(mass * ca.SX.eye(4), A.T), ca.horzcat(A, ca.SX(2, 2)))
    solved = augmented.solution(K, ca.vertcat(-ca.gradient(V, q), gamma), range(6))[:4]
    y = ca.vertcat(q, qd)
    return Mechanism(
        "car_axis",
        ("xl", "yl", "xr", "yr"),
        ca.Function("rates", [t, y], [ca.cse(ca.vertcat(qd, *solved))]),
    )


def _of(of: Lagrangian, names: tuple[str, ...], u: np.ndarray) -> Mechanism:
    M, f, gamma = of.parts()
    K = ca.vertcat(ca.horzcat(M, of.A.T), ca.horzcat(of.A, ca.SX(of.A.size1(), of.A.size1())))
    solved = augmented.solution(K, ca.vertcat(f, gamma), of.order)[: of.q.numel()]
    found = (
        ca.substitute(ca.vertcat(of.qd, *solved), of.u, ca.SX(u))
        if of.u.numel()
        else ca.vertcat(of.qd, *solved)
    )
    return Mechanism(
        of.name,
        names,
        ca.Function("rates", [ca.SX.sym("t"), ca.vertcat(of.q, of.qd)], [ca.cse(found)]),
    )
