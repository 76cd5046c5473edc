"""Charts: which of several choices of quasi-velocities is best at a state, and the way from one to
another, in C and Python."""

from __future__ import annotations

from typing import Any

from codegen import text
from codegen.passes.names import Names, identifier
from codegen.program import Program
from codegen.targets.records import Target
from derive.formulations.limits import BETTER, LOW


def files(program: Program) -> dict[str, str]:
    """NAME_charts.h, NAME_charts.c and _charts.py."""
    if not program.charts:
        return {}
    free = Names(())
    data: dict[str, Any] = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "nq": program.coordinates,
        "nz": len(program.states),
        "charts": [(chart, free(identifier(chart.choice))) for chart in program.charts],
        "most": max(1, *(len(chart.largest) for chart in program.charts)),
        "low": LOW,
        "better": BETTER,
    }
    return {
        f"{program.name}_charts.h": text.render("charts.h.j2", **data),
        f"{program.name}_charts.c": text.render("charts.c.j2", **data),
        "_charts.py": text.render("charts.py.j2", **data),
    }


CHARTS = Target("charts", "choices that take over from each other", files)
