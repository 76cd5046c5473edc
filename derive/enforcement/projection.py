"""After every step the nearest consistent state in the metric of M: q on φ = 0, then v on A v = c
with A at the new q."""

from derive.enforcement.records import Enforcement, Options
from derive.formulations.records import Equations


def _refusal(equations: Equations, options: Options) -> str:
    if equations.has("project"):
        return ""
    return (
        "there is nothing to project on: no position constraints, and A v = c holds in these "
        "quasi-velocities"
    )


PROJECTION = Enforcement(
    name="projection",
    about="after every step the nearest consistent state in the metric of M, positions first, "
    "then velocities",
    source="E. Eich: Convergence results for a coordinate projection method, SIAM J. Numer. "
    "Anal. 30, 1993",
    level="steps",
    refusal=_refusal,
    needs=lambda found: ("project",),
)
