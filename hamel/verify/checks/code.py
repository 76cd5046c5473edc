"""Does the generated module compute what the graph says, in every language it speaks?"""

from __future__ import annotations

import importlib
import shutil
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np

from codegen import compiler
from codegen.loader import load
from hamel.charts import in_chart
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import sizes, worst
from hamel.verify.checks.evidence import Evidence, Row, margins
from hamel.verify.checks.roundoff import EPSILON
from hamel.verify.reference.vectors import Array

Call = Callable[..., Array]
PLAIN = ("-std=c99", "-O0", "-ffp-contract=off", "-fPIC")
# relative tolerance of generated code in double; as many units of rounding in another precision
EXACT = 1e-13
NEARLY = 1.001  # a guard may refuse up to so many times its tolerance, for it is rounded too
# multiples of the running error bound of one order of operations within which every other order
# stays
MANY = 8.0


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


def plain_code(e: Evidence) -> float | None:
    """Every function of the same C without optimisation and without contraction: a compiler's
    liberties change roundoff only."""
    command = compiler.find_compiler()
    source = Path(getattr(e.module, "__file__", None) or "").parent
    if e.module is None or command is None or not (source / "manifest.json").is_file():
        return None
    with tempfile.TemporaryDirectory(prefix="hamel-", ignore_cleanup_errors=True) as folder:
        place = Path(folder) / source.name
        shutil.copytree(
            source,
            place,
            ignore=shutil.ignore_patterns("*.so", "*.dylib", "*.dll", "*.pyd", "__pycache__"),
        )
        _compiled_plainly(place, command)
        with warnings.catch_warnings():  # the extension module is not there
            warnings.simplefilter("ignore", RuntimeWarning)
            plain = load(place)
        return _against_graph(e, importlib.import_module(f"{plain.__name__}._library"))


def _compiled_plainly(place: Path, command: list[str]) -> None:
    prefix = next(file.name.removesuffix("_cpu.c") for file in place.glob("*_cpu.c"))
    files = [f"{stem}.c" for stem in compiler.sources(place, prefix)]
    library = f"lib{prefix}{compiler.SUFFIX}"
    compiler.run(place, [*command, *PLAIN, *compiler.shared(), *files, "-lm", "-o", library])


def batches(e: Evidence) -> float | None:
    """All states in one call of `dynamics`."""
    dynamics = in_chart(e.module, "dynamics", e.chart)
    if dynamics is None:
        return None
    rows = [
        np.array(column) for column in zip(*((s.t, x, s.u, s.p) for s, x in zip(e.samples, e.x)))
    ]
    return _error(e, "dynamics", dynamics(*rows))


def refused(e: Evidence) -> tuple[str, int] | None:
    """A function of the module that refuses a state at which the graph has a value, and the number
    of that state."""
    for name, (wanted, _) in e.expected.items():
        call = in_chart(e.module, name, e.chart)
        rows = [e.complete(row) for row in e.rows_of(name)] if call is not None else []
        for place, (row, like) in enumerate(zip(rows, wanted)):
            if call is not None and np.isnan(_flat_result(call, like, row)).any():
                return name, place
    return None


def _against_graph(e: Evidence, module: ModuleType) -> float:
    calls = {name: in_chart(module, name, e.chart) for name in e.expected}
    return worst([_function(e, name, call) for name, call in calls.items() if call is not None])


def _function(e: Evidence, name: str, call: Call) -> float:
    rows = [e.complete(row) for row in e.rows_of(name)]
    return _error(
        e,
        name,
        np.array(
            [_flat_result(call, wanted, row) for row, wanted in zip(rows, e.expected[name][0])]
        ),
    )


def _flat_result(call: Call, like: Array, row: Row) -> Array:
    """One result as a flat row; not a number where the module refuses the state."""
    try:
        return np.ravel(call(*row))
    except FloatingPointError:
        return np.full(like.shape, np.nan)


def _error(e: Evidence, name: str, got: Array) -> float:
    """Against the size of the result or, where it cancels, against what roundoff can do to it.

    States that the guards refuse, rightly, are left out; there must be few of them.
    """
    wanted, roundoff = e.expected[name]
    if got.shape != wanted.shape:
        return float("inf")
    regular = ~_rightly_refused(e, name, got)
    if 2 * regular.sum() < len(regular):
        return float("inf")
    unit = e.units.of(e.graph.equations.function(name))
    got, wanted, roundoff = (y[regular] / unit for y in (got, wanted, roundoff))
    roundoff = _of_zeros_too(wanted, roundoff)
    return worst((got - wanted) / np.maximum(sizes(wanted, floor=0.0), MANY * roundoff / EXACT))


def _of_zeros_too(wanted: Array, roundoff: Array) -> Array:
    """Where the graph has an exact zero a loop over columns may compute it: as a sum that cancels,
    with what roundoff does to the others."""
    largest = roundoff.max(axis=1, keepdims=True)
    zero = ~(wanted.any(axis=0) | (roundoff > EPSILON * largest).any(axis=0))
    return np.where(zero, largest, roundoff) if zero.any() else roundoff


def _rightly_refused(e: Evidence, name: str, got: Array) -> Array:
    """Which states have no result and come too close to a guard."""
    missing = np.asarray(np.isnan(got).all(axis=1))
    return (
        missing & (margins(e.graph, name, e.rows_of(name), e.real) < NEARLY)
        if missing.any()
        else missing
    )


CHECKS = (
    Check("module = graph", EXACT, "every function of the loaded module", compiled, True),
    Check("ctypes = graph", EXACT, "every function through the ctypes fallback", ctypes_code, True),
    Check("NumPy = graph", EXACT, "every function of the NumPy text", numpy_code, True),
    Check(
        "-O0 = graph",
        EXACT,
        "every function of the same C without optimisation and contraction",
        plain_code,
        True,
    ),
    Check("batch = one by one", EXACT, "the batch call of the module", batches, True),
)
