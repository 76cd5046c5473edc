"""Rounding: generated code errs at most four times as much as the derivation's own graph does in
plain double precision.

The truth is the same graph in 50 digits. Ill-conditioned states (close to a singular position,
fast, far away) are among them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import mpmath
import numpy as np
import pytest

from codegen import compiler, loader
from codegen.passes import program
from derive.expressions.instructions import listing, run
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model import load
from derive.states import system
from hamel.build.module import published
from tests.scenes import MODELS

MOST = 4.0
pytestmark = [
    pytest.mark.optimised,
    pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler"),
]

EXACT: dict[int, Callable[..., Any]] = {
    ca.OP_ADD: lambda a, b: a + b, ca.OP_SUB: lambda a, b: a - b, ca.OP_MUL: lambda a, b: a * b, ca.OP_DIV: lambda a, b: a / b,
    ca.OP_NEG: lambda a: -a, ca.OP_SQ: lambda a: a * a, ca.OP_TWICE: lambda a: 2 * a, ca.OP_INV: lambda a: 1 / a,
    ca.OP_SIN: mpmath.sin, ca.OP_COS: mpmath.cos, ca.OP_SQRT: mpmath.sqrt, ca.OP_FABS: abs, ca.OP_SIGN: mpmath.sign, ca.OP_ASSIGN: lambda a: a,
    ca.OP_CONSTPOW: lambda a, b: a**b, ca.OP_POW: lambda a, b: a**b,
}  # fmt: skip


def exact(function: ca.Function, arguments: Sequence[Sequence[float]]) -> list[Any]:
    """The only result of the function, its instructions run in mpmath's precision."""
    (result,) = run(
        listing(function),
        entry=lambda argument, nonzero: mpmath.mpf(float(arguments[argument][nonzero])),
        number=mpmath.mpf,
        operation=lambda read, operands: EXACT[read.code](*operands),
    )
    return result


def samples(found: Equations, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """States of all sizes; every third is near a multiple of a quarter turn, where pivots and
    masses degenerate."""
    random = np.random.default_rng(11)
    nx, nu = (next(a for a in found.arguments if a.name == name).symbols.numel() for name in "xu")
    rows = []
    for i in range(count):
        x = random.uniform(-3, 3, nx) * (1.0, 1e-3, 30.0)[i % 3]
        if i % 3 == 1:
            x[: found.system.q.numel()] += (
                np.pi / 2 * random.integers(-3, 4, found.system.q.numel())
            )
        rows.append((x, random.uniform(-5, 5, nu)))
    return rows


def compare(name: str, count: int, folder: Path) -> None:
    found = equations(system(load(MODELS / f"{name}.yaml")))
    value = next(f for f in found.functions if f.name == "dynamics").result.value
    function = ca.Function(
        "f", [argument.symbols for argument in found.arguments], [ca.densify(value)]
    )
    module = loader.load(published(program(found, ["dynamics"]), folder / name).folder)
    p = np.array(found.parameters)
    ours, plain = [], []
    with mpmath.workdps(50):
        for x, u in samples(found, count):
            try:
                made = module.dynamics(0.3, x, u, p)
            except FloatingPointError:
                continue
            true = exact(function, ([0.3], x, u, p))
            size = max(abs(entry) for entry in true)
            straight = function(0.3, x, u, p).full().ravel()
            ours.append(
                float(max(abs(mpmath.mpf(float(a)) - b) for a, b in zip(made, true)) / size)
            )
            plain.append(
                float(max(abs(mpmath.mpf(float(a)) - b) for a, b in zip(straight, true)) / size)
            )
    assert len(ours) > 0.6 * count
    for share in (50, 90, 99, 100):  # typical states and the worst
        assert np.percentile(ours, share) <= MOST * max(np.percentile(plain, share), 1e-16), (
            name,
            share,
        )


@pytest.mark.parametrize("name", ["snake3", "four_bar", "stanford_arm", "rolling_disk"])
def test_rounding_stays_small(name: str, tmp_path: Path) -> None:
    compare(name, 90, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["snake3", "four_bar", "stanford_arm", "rolling_disk", "slider_crank", "planar_3r"]
)
def test_rounding_stays_small_at_ten_thousand_states(name: str, tmp_path: Path) -> None:
    compare(name, 10_000, tmp_path)
