"""Library solvers over the same equations, compiled, as reference lines. Making them ready is not
timed."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from derive.formulations.records import Equations
from hamel.simulate.libraries import Problem, Reference, Refusal, library_of
from hamel.study.limits import LIBRARY_LIMIT, LIBRARY_SHARE
from hamel.study.modules import Start, plain_equations, start
from hamel.study.runs import judged, loaded, timed


def row(
    path: str,
    values: Mapping[str, float | str],
    folder: str,
    span: float,
    unit: Mapping[str, str],
    run: Mapping[str, Any],
) -> dict[str, Any]:
    """One run of a solver on one unit's equations, and whether tighter ones would take too long."""
    begin, module = start(path, values), loaded(folder)
    equations = plain_equations(begin, unit)
    reference = library_of(run["integrator"])
    assert reference is not None  # the plan named it
    reason = reference.refusal(equations)
    if reason:
        return {"status": reason, "slow": False}
    before = time.process_time()
    result = _row(reference, module, equations, begin, span, run["rtol"])
    return {**result, "slow": time.process_time() - before > LIBRARY_LIMIT}


def _row(
    reference: Reference,
    module: Any,
    equations: Equations,
    begin: Start,
    span: float,
    rtol: float,
) -> dict[str, Any]:
    x = module.state(0.0, begin.initial.whole, begin.u, begin.p)
    times = np.array([0.0, span])
    problem = Problem(
        module, equations, times, x, begin.u, begin.p, rtol, rtol / 100, compiled=True
    )
    try:
        ms, motion = timed(reference.prepare(problem), LIBRARY_SHARE)
    except Refusal as refusal:
        return {"status": refusal.cause}
    except (FloatingPointError, RuntimeError) as error:
        return {"status": str(error)}
    if not np.isfinite(motion.x[-1]).all():
        return {"status": "not finite"}
    return judged(module, begin, span, ms, motion)
