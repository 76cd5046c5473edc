"""Does the generated module compute what the graph says, in every language it speaks?"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from types import ModuleType

import numpy as np

from hamel.verify.checks.rung import Rung
from hamel.verify.compare import sizes, worst
from hamel.verify.evidence import Evidence, Sample
from hamel.verify.vectors import Array

Call = Callable[..., Array]
EXACT = 1e-13  # relative tolerance of generated code
MANY = 8.0  # multiples of the running error bound of one order of operations within which every other order stays


def compiled(e: Evidence) -> float | None:
    """Every function of the module as it is loaded."""
    return None if e.module is None else _against_graph(e, e.module)


def ctypes_code(e: Evidence) -> float | None:
    """Every function of the module through its ctypes fallback."""
    return _backend(e, "_library")


def numpy_code(e: Evidence) -> float | None:
    """Every function of the module's NumPy text."""
    return _backend(e, "_numpy")


def _backend(e: Evidence, name: str) -> float | None:
    if e.module is None:
        return None
    try:
        backend = importlib.import_module(f"{e.module.__name__}.{name}")
    except (ImportError, OSError):
        return None  # what was not generated or compiled cannot be wrong
    return _against_graph(e, backend)


def batches(e: Evidence) -> float | None:
    """All states in one call of `dynamics`."""
    if e.module is None or not hasattr(e.module, "dynamics"):
        return None
    rows = [np.array(column) for column in zip(*((s.t, x, s.u, s.p) for s, x in zip(e.samples, e.x)))]
    return _error(e, "dynamics", e.module.dynamics(*rows))


def _against_graph(e: Evidence, module: ModuleType) -> float:
    return worst([_function(e, name, getattr(module, name)) for name in e.expected if hasattr(module, name)])


def _function(e: Evidence, name: str, call: Call) -> float:
    rows = zip(e.samples, e.arguments_of(name))
    return _error(e, name, np.array([_called(call, wanted, s, x) for (s, x), wanted in zip(rows, e.expected[name][0])]))


def _called(call: Call, like: Array, s: Sample, x: Array) -> Array:
    """One result as a flat row; not a number where the module refuses the state."""
    try:
        return np.ravel(call(s.t, x, s.u, s.p))
    except FloatingPointError:
        return np.full(like.shape, np.nan)


def _error(e: Evidence, name: str, got: Array) -> float:
    """Against the size of the result or, where it cancels, against what roundoff can do to it."""
    wanted, roundoff = e.expected[name]
    if got.shape != wanted.shape:
        return float("inf")
    return worst((got - wanted) / np.maximum(sizes(wanted, floor=0.0), MANY * roundoff / EXACT))


RUNGS = (
    Rung("module = graph", EXACT, "every function of the loaded module", compiled),
    Rung("ctypes = graph", EXACT, "every function through the ctypes fallback", ctypes_code),
    Rung("NumPy = graph", EXACT, "every function of the NumPy text", numpy_code),
    Rung("batch = one by one", EXACT, "the batch call of the module", batches),
)
