"""States and expected values that are shipped beside the module, and the comparison of the shipped
code with them, on any machine and without the model.

Both are rounded to fewer digits than a double has: the last ones differ between machines, and the
bytes of a generated folder do not. The values are those of the equations at the rounded arguments.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from codegen.loader import part
from codegen.reals import FLOAT64, Real
from codegen.seal import VERIFICATION
from derive.diagnostics import VerificationError
from derive.formulations.records import Equations
from hamel.verify.checks.evidence import Evidence, Row, likely_roundoff
from hamel.verify.long import is_long, rounding, shipped_rows
from hamel.verify.records import CheckResult
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence

STATES = 3
MOST = 20_000  # numbers, over all functions
FOR_TARGETS = 1_000_000  # of those that targets are compared at, which nothing keeps
ARGUMENT = 8  # digits of arguments
VALUE = 11  # digits of values
MANY = 8.0  # times the roundoff that is likely: every other order of operations stays within
TOLERANCE = 1e-10  # relative to the largest entry: ten times what rounding the values does
COARSE = 1e-4  # of a module in float32, whose arguments are rounded once more
BACKENDS = {"extension": "extension", "_library": "ctypes", "_numpy": "NumPy"}


def tolerance_of(double: bool) -> float:
    """Relative to the size of a result, in either precision."""
    return TOLERANCE if double else COARSE


def shipped(
    equations: Equations,
    emitted: Collection[str],
    seed: int,
    states: int = STATES,
    most: int = MOST,
    module: ModuleType | None = None,
    real: Real = FLOAT64,
) -> dict[str, Any]:
    """Emitted function → {"t", "x", "u", "p", "expected", "size"}, a row for
    each state, of every chart.

    `size` is the largest entry of the result or, where it cancels, of what roundoff leaves there in
    a module of the precision `real`.

    Of a model so large that there would be more than `most` numbers, functions have one state each,
    and are left out from where not even that is room for.
    Values of a long tree, whose equations are not written out, are those that the reference finds
    balanced in its `module`.
    """
    if module is not None and is_long(equations, module):
        return _of_long(equations, module, seed, states, most, real)
    seen = evidence(reference(equations.system.model), equations, None, states, seed)
    results = {
        name + suffix: _rows(chart, name, real)
        for suffix, chart in _charts(seen)
        for name in chart.graph.functions
        if name + suffix in emitted
    }
    return _fitting(results, most)


def _of_long(
    equations: Equations, module: ModuleType, seed: int, states: int, most: int, real: Real
) -> dict[str, Any]:
    results: dict[str, Any] = {}
    names, states = _with_room(equations, module, states, most)
    for name, kept in shipped_rows(equations, module, seed, states, names):
        if kept:
            places, values = zip(*kept)
            call = getattr(module, name)
            errors = [MANY * rounding(call, place, real.epsilon) for place in places]
            results[name] = _columns(places, values, _larger(values, np.array(errors), real))
    return _fitting(results, most)


def _with_room(
    equations: Equations, module: ModuleType, states: int, most: int
) -> tuple[list[str], int]:
    """The functions, and at how many states, that will not be too many numbers: nothing is looked
    at for nothing."""
    arguments = sum(len(argument.labels) for argument in equations.arguments)
    there = [f for f in equations.functions if hasattr(module, f.name)]
    sizes = {f.name: arguments + f.result.size for f in there}
    if states * sum(sizes.values()) <= most:
        return list(sizes), states
    room, names = most, list[str]()
    for name, size in sizes.items():
        if size <= room:
            names.append(name)
            room -= size
    return names, 1


def _fitting(results: Mapping[str, dict[str, Any]], most: int) -> dict[str, Any]:
    """All rows, or where they are too many numbers the first of each function while there is
    room."""
    there = {name: rows for name, rows in results.items() if rows}
    if sum(map(_size, there.values())) <= most:
        return there
    room, kept = most, {}
    for name, rows in there.items():
        first = {key: column[:1] for key, column in rows.items()}
        if _size(first) <= room:
            kept[name] = first
            room -= _size(first)
    return kept


def _charts(seen: Evidence) -> Iterator[tuple[str, Evidence]]:
    yield "", seen
    for number, chart in enumerate(seen.graph.equations.charts, 1):
        there = evidence(seen.reference, chart, None, len(seen.samples), 0)
        yield f"_chart{number}", there


def _rows(seen: Evidence, name: str, real: Real) -> dict[str, Any]:
    """Arguments and values of one function; nothing where a value is not finite."""
    places = [_argument(row) for row in seen.rows_of(name)]
    values = [np.ravel(seen.graph.iterated(name, *place)) for place in places]
    sizes = _sizes(seen.graph.equations, name, places, values, real)
    return _columns(places, values, sizes)


def stored(
    places: Sequence[Row], value: Callable[[float, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
) -> dict[str, Any]:
    """Rows of a function that no model has by itself, with values that `value` gives."""
    rounded = [_argument(row) for row in places]
    values = [np.ravel(value(*row)) for row in rounded]
    return _columns(rounded, values, [_largest(each) for each in values])


def _sizes(
    equations: Equations, name: str, places: Sequence[Row], values: Sequence[np.ndarray], real: Real
) -> list[float]:
    """In terms of which errors are told: the largest entry, or what counts as roundoff."""
    errors = MANY * real.coarseness * likely_roundoff(equations, name, places, real)
    return _larger(values, errors, real)


def _larger(values: Sequence[np.ndarray], errors: np.ndarray, real: Real) -> list[float]:
    """The largest entry, or what an error so large is the tolerance of."""
    counted = errors / tolerance_of(real is FLOAT64)
    return [max(_largest(value), _largest(error)) for value, error in zip(values, counted)]


def _columns(
    places: Sequence[Row], values: Sequence[np.ndarray], sizes: Sequence[float]
) -> dict[str, Any]:
    rows = []
    for (t, x, u, p), value, size in zip(places, values, sizes):
        if np.isfinite(value).all() and math.isfinite(size):
            expected = _rounded(value, VALUE, size)
            rows.append((t, x.tolist(), u.tolist(), p.tolist(), expected, float(f"{size:.2g}")))
    return dict(zip(("t", "x", "u", "p", "expected", "size"), zip(*rows)))


def _argument(row: Row) -> Row:
    """To fewer digits, each by itself."""
    t, *others = row
    x, u, p = (
        np.array([float(f"{value:.{ARGUMENT}g}") for value in np.ravel(part)]) for part in others
    )
    return float(f"{t:.{ARGUMENT}g}"), x, u, p


def _largest(values: np.ndarray) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def _rounded(values: np.ndarray, digits: int, size: float) -> list[float]:
    """To so many digits of `size`; what is less than that is zero."""
    if size == 0.0:
        return [0.0] * len(values)
    least = 10.0 ** (math.floor(math.log10(size)) + 1 - digits)
    return [float(f"{round(value / least) * least:.{digits}g}") + 0.0 for value in values.tolist()]


def _size(rows: Mapping[str, Any]) -> int:
    return sum(np.size(column) for column in rows.values())


# ---- the shipped code


def shipped_checks(folder: Path, module: ModuleType) -> tuple[CheckResult, ...]:
    """Every backend of the module that is there, at the states in its verification.json."""
    try:
        functions = json.loads((folder / VERIFICATION).read_text(encoding="utf-8"))["functions"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise VerificationError(
            f"{folder} holds no verification states", hint="build it again with hamel"
        ) from error
    return tuple(_check(name, backend, functions) for name, backend in _backends(module))


def _backends(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """By the names that people know them by, those first that are used first."""
    if module.backend == "extension":
        yield "extension", module
    for name in ("_library", "_numpy"):
        try:
            yield BACKENDS[name], part(module, name)
        except (ImportError, OSError):
            continue  # what was not compiled cannot be wrong


def _check(name: str, backend: Any, functions: Mapping[str, Any]) -> CheckResult:
    errors = [
        _error(getattr(backend, function, None), rows) for function, rows in functions.items()
    ]
    value = max((math.inf if math.isnan(error) else error for error in errors), default=math.inf)
    tolerance = tolerance_of(_is_double(functions, backend))
    about = "every function at the states that were shipped, against the values expected there"
    return CheckResult(f"{name} = shipped values", value, tolerance, value <= tolerance, about)


def _is_double(functions: Mapping[str, Any], backend: Any) -> bool:
    call = next((getattr(backend, name, None) for name in functions), None)
    rows = next(iter(functions.values()), None)
    return call is None or rows is None or _flat_result(call, rows, 0).dtype == np.float64


def _error(call: Any, rows: Mapping[str, Any]) -> float:
    """The worst difference at any row, relative to the size of the result there."""
    if call is None:
        return math.inf
    worst = 0.0
    for k, expected in enumerate(rows["expected"]):
        value = np.ravel(_flat_result(call, rows, k))
        if value.shape != np.shape(expected):
            return math.inf
        size = max(rows["size"][k], 1e-300)
        worst = max(worst, float(np.max(np.abs(value - expected), initial=0.0)) / size)
    return worst


def _flat_result(call: Any, rows: Mapping[str, Any], k: int) -> np.ndarray:
    """One result; not a number where the code refuses the state."""
    t, x, u, p = (rows[name][k] for name in "txup")
    try:
        return np.asarray(call(t, x, u, p))
    except FloatingPointError:
        return np.array([np.nan])
