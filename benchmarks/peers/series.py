"""heyoka: Taylor series compiled by LLVM, on its own Lagrangian equations of a pendulum chain, and on
our program of any model."""

from __future__ import annotations

import importlib.metadata
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from codegen.program import Expression, Program
from peers.contest import Unavailable
from peers.simulations import Simulation

try:
    import heyoka
except ImportError:  # left out where it cannot be had
    heyoka = None

PEER = "heyoka, one motion"
FIRST, LAST = -13, -29  # half decades of its tolerance
System = Sequence[tuple[Any, Any]]


def version() -> str:
    if heyoka is None:
        raise Unavailable("heyoka is not installed: pip install heyoka")
    return importlib.metadata.version("heyoka")


def of_program(program: Program, u: np.ndarray) -> System:
    """Our straight-line equations, operation by operation."""
    kernel = program.kernel("dynamics")
    states = [heyoka.make_vars(f"x{i}", f"y{i}")[0] for i in range(len(kernel.x.names))]
    local: dict[str, Any] = {}
    for load in kernel.loads:
        given = {"t": [heyoka.time], "x": states, "u": list(map(float, u))}[load.argument]
        local[load.name] = given[load.index] + heyoka.expression(0.0)
    for section in kernel.sections:
        for statement in section.statements:
            local[statement.name] = _value(statement.value, local)
    return [(x, _value(rate, local)) for x, rate in zip(states, kernel.outputs)]


def _value(value: Expression, local: Mapping[str, Any]) -> Any:
    if not isinstance(value, tuple):
        return local[value] if isinstance(value, str) else heyoka.expression(value)
    operation, *inside = value
    a, *others = (_value(operand, local) for operand in inside)
    b = others[0] if others else None
    plain = {"add": "__add__", "sub": "__sub__", "mul": "__mul__", "div": "__truediv__"}
    if operation in plain:
        return getattr(a, plain[operation])(b)
    if operation != "neg" and not hasattr(heyoka, str(operation)):
        raise Unavailable(f"heyoka has no {operation}")
    return -a if operation == "neg" else getattr(heyoka, str(operation))(a)


def of_chain(n: int) -> System:
    """Its Lagrangian equations of n rods of 1 m and 1 kg, 0.08 kg m² about their middles, in angles
    from the horizontal: L with cosines of differences, as in textbooks."""
    q = [heyoka.make_vars(f"q{i}", f"r{i}")[0] for i in range(n)]
    v = [heyoka.make_vars(f"v{i}", f"w{i}")[0] for i in range(n)]
    lagrangian: Any = 0.0
    for i in range(n):
        lagrangian += -9.81 * (n - i - 0.5) * heyoka.sin(q[i])
        lagrangian += 0.5 * (n - i - 1 + 0.25 + 0.08) * v[i] * v[i]
        for j in range(i + 1, n):
            lagrangian += (n - j - 0.5) * heyoka.cos(q[i] - q[j]) * v[i] * v[j]
    return heyoka.lagrangian(lagrangian, q, v)


def simulation(variant: str, system: System, x: np.ndarray, span: float, read: Any) -> Simulation:
    """`read`: its state at the end → what is compared. Compiled once for each tolerance."""
    start, made = list(map(float, x)), {}

    def run(setting: float, repeats: int) -> tuple[float, np.ndarray]:
        if setting not in made:
            made[setting] = heyoka.taylor_adaptive(system, start, tol=10.0**setting)
        motion, least = made[setting], np.inf
        for _ in range(repeats):
            motion.time = 0.0
            motion.state[:] = start
            begin = time.perf_counter()
            motion.propagate_until(span)
            least = min(least, time.perf_counter() - begin)
        return 1e3 * least, read(motion.state.copy())

    return Simulation(PEER, variant, run, tuple(k / 2 for k in range(FIRST, LAST, -1)))
