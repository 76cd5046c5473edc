"""The result of a verification as it is kept beside the module: `verification.json`, and its
summary for the manifest.

Errors are told as the power of ten by which they stay below the tolerance, three at most: roundoff
differs between machines, and the bytes of a generated folder do not.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from derive.formulations.records import Equations
from hamel.verify.checks import CHECKS
from hamel.verify.records import CheckResult, Verification

DECADES = 3
ROUNDING = frozenset(check.name for check in CHECKS if check.rounding)
# a tolerance below is a multiple of roundoff: it is met or not, and by how much is the machine's
# affair
ROUNDOFF = 1e-12


def stored(found: Verification, equations: Equations, states: Mapping[str, Any]) -> str:
    """The text of verification.json; `states` are those of `shipped`, on one line for each
    function."""
    margins = [_margin(check) for check in found.checks]
    summary = {
        "states": found.states,
        "seed": found.seed,
        "checks": len(found.checks),
        "passed": sum(check.passed for check in found.checks),
        "margin": min((margin for margin in margins if margin is not None), default=DECADES),
        "rank": found.rank,
        "region": {name: [_two_digits(low), _two_digits(high)] for name, low, high in found.region},
        "pivots": list(equations.pivots),
        "guards": _guards(equations),
        "assumptions": list(equations.assumptions),
    }
    checks = [
        {"name": check.name, "tolerance": check.tolerance, "margin": margin, "about": check.about}
        for check, margin in zip(found.checks, margins)
    ]
    about = (
        "margin: the worst error is below tolerance / 10^margin (3 stands for 3 or more); "
        "region: of the sampled states; functions: rows of arguments and the values expected there"
    )
    said = {"about": about, "summary": summary, "checks": checks}
    text = json.dumps(said, indent=1, ensure_ascii=False).removesuffix("\n}")
    lines = [f"  {json.dumps(name)}: {json.dumps(rows)}" for name, rows in states.items()]
    return text + ',\n "functions": {\n' + ",\n".join(lines) + "\n }\n}\n"


def _margin(check: CheckResult) -> int | None:
    """Whole powers of ten between the error and its tolerance."""
    if check.tolerance < ROUNDOFF or check.name in ROUNDING:
        return None
    if check.value <= check.tolerance * 10.0**-DECADES:
        return DECADES
    return math.floor(math.log10(max(check.tolerance / check.value, 1e-300)))


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")


def _guards(equations: Equations) -> dict[str, Any]:
    """Function → its guards: below |tolerance| it returns the status `singular`."""
    return {
        f.name: {guard.name: _two_digits(guard.tolerance) for guard in f.guards}
        for f in equations.functions
        if f.guards
    }
