"""Library solvers over the same equations, compiled, as reference lines. Making them ready is not
timed."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from derive.formulations.records import Equations
from hamel.build.module import module_in
from hamel.simulate.libraries import REFERENCES, Problem, Reference
from hamel.study.building import Start, plain_equations, start
from hamel.study.running import TOO_LONG, judged, timed

LIBRARY_LIMIT = 2.0  # seconds of one run after which tighter ones are not tried
LIBRARY_SHARE = 0.1  # seconds of repeated calls from which a run time is taken


def rows(
    path: str,
    values: Mapping[str, float | str],
    folder: str,
    span: float,
    unit: Mapping[str, str],
    solver: str,
    runs: Sequence[Mapping[str, Any]],
) -> Iterator[dict[str, Any]]:
    """One solver on one unit's equations, loose tolerances first. After a run that took long
    tighter ones are not tried."""
    found, module = start(path, values), module_in(folder)
    equations = plain_equations(found, unit)
    reference = next(each for each in REFERENCES if each.name == solver)
    reason, slow = reference.refusal(equations), False
    yield {"ready": solver}
    for run in runs:
        begin = time.process_time()
        made = {"status": TOO_LONG} if slow else {"status": reason} if reason else {}
        made = made or _row(reference, module, equations, found, span, run["rtol"])
        slow = slow or time.process_time() - begin > LIBRARY_LIMIT
        yield {"run": run["key"], "row": made}


def _row(
    reference: Reference,
    module: Any,
    equations: Equations,
    found: Start,
    span: float,
    rtol: float,
) -> dict[str, Any]:
    x = module.state(0.0, np.concatenate([found.initial.q, found.initial.v]), found.u, found.p)
    times = np.array([0.0, span])
    problem = Problem(
        module, equations, times, x, found.u, found.p, rtol, rtol / 100, compiled=True
    )
    try:
        ms, made = timed(reference.prepare(problem), LIBRARY_SHARE)
    except (FloatingPointError, RuntimeError) as error:
        flag = re.search(r"\b(?:CV|IDA)_[A-Z_]+", str(error))
        return {
            "status": f"stops: {flag.group()}"
            if flag
            else str(error).partition(": ")[2] or str(error)
        }
    if not np.isfinite(made.x[-1]).all():
        return {"status": "not finite"}
    return judged(module, found, span, ms, made)
