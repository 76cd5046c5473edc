"""NaN, ±Inf, denormals and huge numbers in any argument: the graph's own result or a refusal, and
never another number."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from types import ModuleType
from typing import Any

import numpy as np

from derive.formulations.records import Function
from hamel.charts import in_chart
from hamel.verify.checks.check import Check
from hamel.verify.checks.evidence import Evidence, Row
from hamel.verify.reference.vectors import Array

STRANGE = {"nan": np.nan, "inf": np.inf, "-inf": -np.inf, "denormal": 5e-324, "huge": 1e300}
FINITE = (
    "denormal",
    "huge",
    # where squares or quotients overflow, the order of operations decides: the result is not
    # compared
)
# of the largest result and of its unit: what is below, and what it is a sum of, may be rounding
NOTHING = 1e-3
CLOSE = 1e-9
RIGHT, REFUSED = "right", "refused"


def wrong_answers(e: Evidence) -> float | None:
    """How many there are at the first state, in the loaded module and in its NumPy text."""
    return (
        None
        if e.module is None
        else float(sum(1 for backend in backends(e.module) for _ in complaints(e, backend)))
    )


def backends(module: ModuleType) -> Iterator[ModuleType]:
    """The module as it was loaded, then its NumPy text where it has any: both are to refuse
    alike."""
    yield module
    with suppress(ImportError):
        yield importlib.import_module(f"{module.__name__}._numpy")


def complaints(e: Evidence, backend: ModuleType) -> Iterator[str]:
    """What is wrong, in words."""
    return (said for said in answers(e, backend) if said not in (RIGHT, REFUSED))


def answers(e: Evidence, backend: ModuleType) -> Iterator[str]:
    """Of every call: right, refused, or what is wrong."""
    with np.errstate(all="ignore"):
        for function in e.graph.equations.functions:
            call = in_chart(backend, function.name, e.chart)
            if call is not None:
                yield from _of_function(e, function, call, e.rows_of(function.name)[0])


def _of_function(
    e: Evidence, function: Function, call: Callable[..., Array], place: Row
) -> Iterator[str]:
    unit = e.units.of(function)
    for about, strange in spoiled(place):
        try:
            ours, wanted = (
                np.ravel(call(*e.complete(strange))),
                _expected(e, function.name, place, strange, unit),
            )
        except FloatingPointError:
            yield REFUSED
            continue
        compared = function.iteration is None and not about.endswith(FINITE)
        if not np.isfinite(ours).all():
            yield f"{function.name}, {about}: {ours} came out"
        elif compared and not _close(ours / unit, wanted / unit, CLOSE * e.real.coarseness):
            yield f"{function.name}, {about}: {ours} is not {wanted}"
        else:
            yield RIGHT


def _expected(e: Evidence, name: str, place: Row, strange: tuple, unit: Array | float) -> Array:
    """The graph's result; where that is none, though it does not depend on the argument (m in m/m),
    what it is elsewhere."""
    wanted = np.ravel(e.graph(name, *strange))
    if np.isfinite(wanted).all():
        return wanted
    another: tuple[Any, ...] = tuple(
        np.where(np.isfinite(new), new, 2.0 * np.asarray(old) + 1.0)
        for old, new in zip(place, strange)
    )
    here, there = np.ravel(e.graph(name, *place)), np.ravel(e.graph(name, *another))
    # a result that is zero to rounding is compared with the largest one, and with its unit
    largest = np.maximum(unit, np.abs(here).max(initial=0.0))
    size = np.maximum(np.abs(here), largest * NOTHING)
    indifferent = ~np.isfinite(wanted) & (np.abs(there - here) <= CLOSE * size)
    return np.where(indifferent, here, wanted)


def _close(got: Array, wanted: Array, error: float) -> bool:
    return bool(
        np.isfinite(wanted).all()
        and np.allclose(got, wanted, rtol=error, atol=error * np.abs(wanted).max(initial=1.0))
    )


def spoiled(place: Row) -> Iterator[tuple[str, tuple]]:
    """The arguments with one entry after the other made strange."""
    for about, value in STRANGE.items():
        for k, argument in enumerate(place):
            for i in range(np.size(argument)):
                changed = np.array(argument, dtype=float)
                changed.reshape(-1)[i] = value
                yield (
                    f"argument {k}[{i}] {about}",
                    (*place[:k], changed if changed.ndim else float(changed), *place[k + 1 :]),
                )


CHECKS = (
    Check(
        "no number from none",
        0.0,
        "NaN, ±Inf, denormals, 1e300 in each argument: the graph's result or a refusal",
        wrong_answers,
    ),
)
