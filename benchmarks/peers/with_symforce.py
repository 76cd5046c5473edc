"""SymForce: composite bodies and Newton–Euler in its types, LDLᵀ unrolled, its C++ code generator
and its fast-math."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from peers.casadi_c import Read
from peers.contest import BUILD, NATIVE, Contender, Unavailable, compiled
from peers.pinocchio import EIGEN

LOOP = """#include "{name}.h"
extern "C" int bench_open(const char *argument) {{ return argument == 0; }}
extern "C" void bench_loop(long n, const double *in, long in_size, double *out, long out_size)
{{
    using Vector = Eigen::Matrix<double, {outputs}, 1>;
    using In = Eigen::Map<const Vector>;
    Vector made;
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {{
        sym::ForwardDynamics<double>(In(in), In(in + {outputs}), In(in + 2 * {outputs}), &made);
        Vector::Map(out) = made;
    }}
}}
"""


def contender(tree: Path, inputs: np.ndarray, size: int, read: Read) -> list[Contender]:
    """A fixed-base tree of revolute joints about z, rows of (q, q̇, u) → q̈."""
    folder = BUILD / "models" / f"{tree.stem}-symforce"
    folder.mkdir(parents=True, exist_ok=True)
    header = _generated(tree, folder)
    loop = folder / "loop.cpp"
    loop.write_text(LOOP.format(name=header.stem, outputs=size))
    flags = [
        "-std=c++17",
        "-O3",
        *NATIVE,
        "-ffast-math",
        "-isystem",
        str(EIGEN),
        f"-I{header.parent}",
    ]
    library = compiled(f"{tree.stem}-symforce", {loop: flags})
    return [
        Contender("SymForce", library, inputs, size, read=read, variant="CRBA + LDLᵀ, fast-math")
    ]


def _generated(tree: Path, folder: Path) -> Path:
    logging.disable(
        logging.WARNING
    )  # a long one of epsilon: nothing here is divided by what may be zero
    try:
        import symforce

        symforce.set_epsilon_to_number(0.0)
        import symforce.symbolic as sf
        from symforce import codegen, typing
    except ImportError as error:
        raise Unavailable(f"SymForce: {error}") from error
    links = _links(tree)
    n = len(links)
    vector = getattr(sf, f"V{n}")

    def forward_dynamics(q: typing.Any, w: typing.Any, u: typing.Any) -> typing.Any:
        q, w, u = ([part[i] for i in range(n)] for part in (q, w, u))
        return sf.Matrix(n, 1, _accelerations(sf, links, q, w, u))

    made = codegen.Codegen.function(
        forward_dynamics,
        input_types=[vector] * 3,
        output_names=["acceleration"],
        config=codegen.CppConfig(),
        name="forward_dynamics",
    )
    found = made.generate_function(output_dir=folder, skip_directory_nesting=True)
    return next(
        Path(path) for path in found.generated_files if str(path).endswith("forward_dynamics.h")
    )


def _links(tree: Path) -> list[dict[str, Any]]:
    lines = tree.read_text().splitlines()
    gravity = [float(x) for x in lines[0].split()]
    links = []
    for line in lines[1:]:
        parent, kind, *rest = line.split()
        if kind != "RZ":
            raise Unavailable(f"SymForce: a joint of kind {kind} is not written here")
        x = np.array([float(value) for value in rest])
        links.append(
            {
                "parent": int(parent) - 1,
                "R": x[3:12].reshape(3, 3),
                "p": x[12:15],
                "m": x[15],
                "c": x[16:19],
                "I": x[19:28].reshape(3, 3),
                "g": gravity,
            }
        )
    return links


def _accelerations(
    sf: Any, links: Sequence[dict[str, Any]], q: Sequence[Any], w: Sequence[Any], u: Sequence[Any]
) -> list[Any]:
    """M q̈ = u − h: h by Newton–Euler at q̈ = 0, M by composite bodies, both in link frames."""
    n = len(links)
    z = sf.Matrix(3, 1, [0, 0, 1])
    R, p = [], [sf.Matrix(3, 1, [_number(x) for x in link["p"]]) for link in links]
    for link, angle in zip(links, q):
        c, s = sf.cos(angle), sf.sin(angle)
        fixed = sf.Matrix(3, 3, [_number(x) for x in link["R"].ravel()])
        R.append(fixed * sf.Matrix(3, 3, [c, -s, 0, s, c, 0, 0, 0, 1]))
    com = [sf.Matrix(3, 1, [_number(x) for x in link["c"]]) for link in links]
    inertia = [sf.Matrix(3, 3, [_number(x) for x in link["I"].ravel()]) for link in links]
    omega, alpha, a = [], [], []
    for i, link in enumerate(links):
        j = link["parent"]
        before = (sf.Matrix(3, 1, [0, 0, 0]),) * 2 if j < 0 else (omega[j], alpha[j])
        base = sf.Matrix(3, 1, [_number(-x) for x in link["g"]]) if j < 0 else a[j]
        T = R[i].T
        omega.append(T * before[0] + z * w[i])
        alpha.append(T * before[1] + (T * before[0]).cross(z * w[i]))
        a.append(T * (base + before[1].cross(p[i]) + before[0].cross(before[0].cross(p[i]))))
    force, moment = [], []
    for i, link in enumerate(links):
        f = (a[i] + alpha[i].cross(com[i]) + omega[i].cross(omega[i].cross(com[i]))) * _number(
            link["m"]
        )
        force.append(f)
        moment.append(
            inertia[i] * alpha[i] + omega[i].cross(inertia[i] * omega[i]) + com[i].cross(f)
        )
    h = [0] * n
    mass = [_number(link["m"]) for link in links]
    first = [com[i] * mass[i] for i in range(n)]
    second = [
        sf.Matrix(
            3,
            3,
            [
                _number(x)
                for x in (
                    l["I"] + l["m"] * (l["c"] @ l["c"] * np.eye(3) - np.outer(l["c"], l["c"]))
                ).ravel()
            ],
        )
        for l in links
    ]
    M = [[0] * n for _ in range(n)]
    for i in reversed(range(n)):
        h[i] = moment[i][2]
        # a unit of joint acceleration moves the composite: momentum rate (F, N) about the joint's
        # origin
        F, N = z.cross(first[i]), second[i] * z
        M[i][i] = N[2]
        k = i
        while links[k]["parent"] >= 0:
            F, N = R[k] * F, R[k] * N
            N = N + p[k].cross(F)
            k = links[k]["parent"]
            M[i][k] = N[2]
        j = links[i]["parent"]
        if j >= 0:
            f = R[i] * force[i]
            force[j] = force[j] + f
            moment[j] = moment[j] + R[i] * moment[i] + p[i].cross(f)
            turned, s = R[i] * second[i] * R[i].T, R[i] * first[i]
            mixed = s + s
            second[j] = (
                second[j] + turned + _steiner(sf, p[i], mixed) + _steiner(sf, p[i], p[i]) * mass[i]
            )
            first[j] = first[j] + s + p[i] * mass[i]
            mass[j] = mass[j] + mass[i]
    return _ldl(M, [u[i] - h[i] for i in range(n)])


def _steiner(sf: Any, a: Any, b: Any) -> Any:
    """½ (2 a·b E − a bᵀ − b aᵀ)."""
    return sf.Matrix(
        3,
        3,
        [
            a.dot(b) * int(r == c) - (a[r] * b[c] + b[r] * a[c]) / 2
            for r in range(3)
            for c in range(3)
        ],
    )


def _ldl(M: list[list[Any]], b: list[Any]) -> list[Any]:
    n = len(b)
    inverse, factors = [0] * n, [[0] * n for _ in range(n)]
    for k in reversed(range(n)):
        inverse[k] = 1 / M[k][k]
        for i in range(k):
            factors[k][i] = M[k][i] * inverse[k]
        for i in range(k):
            for j in range(i + 1):
                M[i][j] = M[i][j] - factors[k][i] * M[k][j]
            b[i] = b[i] - factors[k][i] * b[k]
    x = [b[k] * inverse[k] for k in range(n)]
    for k in range(n):
        for i in range(k):
            x[k] = x[k] - factors[k][i] * x[i]
    return x


def _number(x: float) -> Any:
    """Exact zeros and ones, so that nothing is kept of them."""
    return int(x) if float(x).is_integer() else float(x)
