"""Does the generated module compute what the graph says, in every language it speaks?"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np

from hamel.verify.checks.rung import Rung
from hamel.verify.compare import deviation, worst
from hamel.verify.evidence import Evidence
from hamel.verify.vectors import Array

Call = Callable[..., Array]


def compiled(e: Evidence) -> float | None:
    """Every function of the module as it is loaded."""
    return None if e.module is None else _against_graph(e, e.module)


def numpy_code(e: Evidence) -> float | None:
    """Every function of the module's NumPy text."""
    fallback = getattr(e.module, "numpy_functions", None)
    return None if fallback is None else _against_graph(e, fallback)


def batches(e: Evidence) -> float | None:
    """All states in one call against one call per state: exactly the same numbers are not promised, equal ones are."""
    if e.module is None or not hasattr(e.module, "dynamics"):
        return None
    rows = [np.array(column) for column in zip(*((s.t, x, s.u, s.p) for s, x in zip(e.samples, e.x)))]
    together = e.module.dynamics(*rows)
    return deviation(list(together), _results(e, e.module.dynamics), e.conditions)


def _against_graph(e: Evidence, module: ModuleType) -> float:
    names = [function.name for function in e.graph.equations.functions if hasattr(module, function.name)]
    return worst([_function(e, name, getattr(module, name)) for name in names])


def _function(e: Evidence, name: str, call: Call) -> float:
    arguments = list(zip(e.samples, e.arguments_of(name)))
    wanted = [e.graph.iterated(name, s.t, x, s.u, s.p) for s, x in arguments]
    got = [np.asarray(call(s.t, x, s.u, s.p)) for s, x in arguments]
    return deviation(got, wanted, e.conditions)


def _results(e: Evidence, call: Call) -> list[Array]:
    return [np.asarray(call(s.t, x, s.u, s.p)) for s, x in zip(e.samples, e.x)]


RUNGS = (
    Rung("module = graph", 1e-13, "every function of the loaded module, per condition number", compiled),
    Rung("NumPy = graph", 1e-13, "every function of the NumPy text, per condition number", numpy_code),
    Rung("batch = one by one", 1e-13, "the batch call of the module, per condition number", batches),
)
