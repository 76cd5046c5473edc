"""SymPy's KanesMethod, C by PyDy with its elimination of common subexpressions, and an LU with
partial pivoting in C.

All numbers are folded in, as in ours. Relative coordinates and their rates, dependent ones kept
among the unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sm
from sympy.physics.mechanics import (
    KanesMethod,
    Point,
    ReferenceFrame,
    RigidBody,
    dynamicsymbols,
    inertia,
)

from peers.casadi_c import Read
from peers.contest import BUILD, PLAIN, Contender, Unavailable, compiled

LOOP = """#include <math.h>
#include "kane.h"
enum {{ N = {n}, Q = {q} }};
static void solve(double A[N * N], double b[N])
{{
    for (int k = 0; k < N; k++) {{
        int pivot = k;
        for (int i = k + 1; i < N; i++)
            if (fabs(A[i * N + k]) > fabs(A[pivot * N + k])) pivot = i;
        if (pivot != k) {{
            for (int j = k; j < N; j++) {{
                const double kept = A[k * N + j];
                A[k * N + j] = A[pivot * N + j];
                A[pivot * N + j] = kept;
            }}
            const double kept = b[k];
            b[k] = b[pivot];
            b[pivot] = kept;
        }}
        const double inverse = 1.0 / A[k * N + k];
        for (int i = k + 1; i < N; i++) {{
            const double factor = A[i * N + k] * inverse;
            for (int j = k + 1; j < N; j++) A[i * N + j] -= factor * A[k * N + j];
            b[i] -= factor * b[k];
        }}
    }}
    for (int k = N - 1; k >= 0; k--) {{
        for (int j = k + 1; j < N; j++) b[k] -= A[k * N + j] * b[j];
        b[k] /= A[k * N + k];
    }}
}}
int bench_open(const char *argument) {{ return argument == 0; }}
void bench_loop(long n, const double *in, long in_size, double *out, long out_size)
{{
    double A[N * N];
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {{
        {call}
        solve(A, out);
    }}
}}
"""


@dataclass(frozen=True)
class Kane:
    """`places`: where each of the method's speeds stands among the coordinates."""

    name: str
    method: KanesMethod
    q: Sequence[Any]
    w: Sequence[Any]
    u: Sequence[Any]
    places: tuple[int, ...]


def four_bar() -> Kane:
    l1, l2, l3, l4, m1, m2, m3 = sm.sympify((0.20, 0.50, 0.40, 0.55, 1.0, 2.5, 2.0))
    q, w, (u,) = _symbols(3, 1)
    N, O = _ground()
    crank, B, c1 = _link(N, N, O, q[0], w[0], l1)
    coupler, C, c2 = _link(N, crank, B, q[1], w[1], l2)
    D = O.locatenew("D", l4 * N.x)
    D.set_vel(N, 0)
    rocker, tip, c3 = _link(N, N, D, q[2], w[2], l3)
    gap = C.pos_from(O) - tip.pos_from(O)
    closing = [gap.dot(N.x), gap.dot(N.y)]
    bodies = [
        _body(f, c, m, m * l**2 / 12)
        for f, c, m, l in ((crank, c1, m1, l1), (coupler, c2, m2, l2), (rocker, c3, m3, l3))
    ]
    loads = [(c, -9.81 * m * N.y) for c, m in ((c1, m1), (c2, m2), (c3, m3))] + [
        (crank, u * N.z),
        (rocker, -0.01 * w[2] * N.z),
    ]
    rates = {a.diff(): b for a, b in zip(q, w)}
    moving = [row.diff(dynamicsymbols._t).subs(rates) for row in closing]
    method = KanesMethod(
        N,
        [q[0]],
        [w[0]],
        _same(q, w),
        q_dependent=q[1:],
        configuration_constraints=closing,
        u_dependent=w[1:],
        velocity_constraints=moving,
    )
    method.kanes_equations(bodies, loads)
    return Kane("four_bar", method, q, w, [u], (0, 1, 2))


def snake3() -> Kane:
    l, m, J = sm.sympify((0.3, 1.0, 0.0075))
    q, w, u = _symbols(5, 2)
    N, O = _ground()
    frame = N.orientnew("A0", "axis", [q[2], N.z])
    frame.set_ang_vel(N, w[2] * N.z)
    centre = O.locatenew("C0", q[0] * N.x + q[1] * N.y)
    centre.set_vel(N, w[0] * N.x + w[1] * N.y)
    frames, centres = [frame], [centre]
    for i in (0, 1):
        hinge = centre.locatenew(f"H{i}", -l / 2 * frame.x)
        hinge.v2pt_theory(centre, N, frame)
        turned = frame.orientnew(f"A{i + 1}", "axis", [q[3 + i], N.z])
        turned.set_ang_vel(frame, w[3 + i] * N.z)
        centre = hinge.locatenew(f"C{i + 1}", -l / 2 * turned.x)
        centre.v2pt_theory(hinge, N, turned)
        frame = turned
        frames.append(frame)
        centres.append(centre)
    rows = [c.vel(N).dot(f.y) for c, f in zip(centres, frames)]
    loads = [
        item for i in (0, 1) for item in ((frames[i + 1], u[i] * N.z), (frames[i], -u[i] * N.z))
    ]
    method = KanesMethod(
        N, q, [w[2], w[3]], _same(q, w), u_dependent=[w[0], w[1], w[4]], velocity_constraints=rows
    )
    method.kanes_equations([_body(f, c, m, J) for f, c in zip(frames, centres)], loads)
    return Kane("snake3", method, q, w, u, (2, 3, 0, 1, 4))


def chain(n: int) -> Kane:
    """A planar pendulum of n equal links of one metre."""
    q, w, _ = _symbols(n, 0)
    N, joint = _ground()
    frame, bodies, loads = N, [], []
    for i in range(n):
        frame, joint, centre = _link(N, frame, joint, q[i], w[i], sm.Integer(1))
        bodies.append(_body(frame, centre, 1.0, 0.08))
        loads.append((centre, -9.81 * N.y))
    method = KanesMethod(N, q, w, _same(q, w))
    method.kanes_equations(bodies, loads)
    return Kane(f"chain{n}", method, q, w, [], tuple(range(n)))


def _symbols(coordinates: int, inputs: int) -> tuple[list[Any], list[Any], list[Any]]:
    made = [
        dynamicsymbols(" ".join(f"{name}{i}" for i in range(n)), real=True) if n else []
        for name, n in zip("qwu", (coordinates, coordinates, inputs))
    ]
    q, w, u = (list(found) if isinstance(found, (list, tuple)) else [found] for found in made)
    return q, w, u


def _ground() -> tuple[ReferenceFrame, Point]:
    N, O = ReferenceFrame("N"), Point("O")
    O.set_vel(N, 0)
    return N, O


def _link(N: Any, frame: Any, joint: Any, q: Any, w: Any, l: Any) -> tuple[Any, Any, Any]:
    """A rod turned by q against `frame`: its frame, tip and centre."""
    turned = frame.orientnew(f"A{q.func}", "axis", [q, N.z])
    turned.set_ang_vel(frame, w * N.z)
    tip, centre = (
        joint.locatenew(f"P{q.func}", l * turned.x),
        joint.locatenew(f"C{q.func}", l / 2 * turned.x),
    )
    tip.v2pt_theory(joint, N, turned)
    centre.v2pt_theory(joint, N, turned)
    return turned, tip, centre


def _body(frame: Any, centre: Any, m: Any, J: Any) -> RigidBody:
    return RigidBody(f"B{frame.name}", centre, frame, m, (inertia(frame, 0, 0, J), centre))


def _same(q: Sequence[Any], w: Sequence[Any]) -> list[Any]:
    return [a.diff() - b for a, b in zip(q, w)]


def contender(of: Kane, inputs: np.ndarray, read: Read) -> list[Contender]:
    """Rows of (q, q̇, u) → q̈."""
    try:
        from pydy.codegen.c_code import CMatrixGenerator
    except ImportError as error:
        raise Unavailable(f"PyDy: {error}") from error
    folder = BUILD / "models" / f"{of.name}-kane"
    folder.mkdir(parents=True, exist_ok=True)
    groups = [group for group in (of.q, of.w, of.u) if len(group)]
    CMatrixGenerator(groups, [of.method.mass_matrix, of.method.forcing]).write(
        "kane", path=str(folder)
    )
    n = len(of.w)
    starts = (0, len(of.q), len(of.q) + n)
    given = ", ".join(
        f"(double *)in + {start}" for start, group in zip(starts, (of.q, of.w, of.u)) if len(group)
    )
    loop = folder / "loop.c"
    loop.write_text(LOOP.format(n=n, q=len(of.q), call=f"evaluate({given}, A, out);"))
    order = list(of.places)

    def ordered(rows: np.ndarray) -> np.ndarray:
        found = np.empty_like(rows)
        found[:, order] = rows
        return read(found)

    library = compiled(f"{of.name}-kane", {loop: PLAIN, folder / "kane.c": PLAIN})
    return [Contender("SymPy Kane → PyDy C + LU", library, inputs, n, read=ordered)]
