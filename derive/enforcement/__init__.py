"""Enforcements: how a simulation stays on the constraints. To add one: a file with a Enforcement,
and its line here."""

from __future__ import annotations

from dataclasses import replace

from derive.diagnostics import AssumptionError
from derive.enforcement.baumgarte import BAUMGARTE
from derive.enforcement.charts import PARTITIONING, SELECTIVE, TANGENT
from derive.enforcement.feedback import FEEDBACK
from derive.enforcement.invariants import INVARIANTS, INVARIANTS_EUCLIDEAN
from derive.enforcement.none import NONE
from derive.enforcement.projection import PROJECTION
from derive.enforcement.rate import usual_rate
from derive.enforcement.records import Enforcement, Options
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.mechanics.records import System

ENFORCEMENTS: tuple[Enforcement, ...] = (
    PROJECTION,
    NONE,
    BAUMGARTE,
    FEEDBACK,
    INVARIANTS,
    INVARIANTS_EUCLIDEAN,
    PARTITIONING,
    SELECTIVE,
    TANGENT,
)


def kept_equations(
    system: System, choice: str | None, formulation: str, enforcement: Enforcement, options: Options
) -> Equations:
    """The equations that a simulation with this enforcement integrates: the system may get another
    β (Baumgarte), the result another q̇ (feedback) or further functions (invariants). Every chart
    gets the same. Raises AssumptionError where the enforcement does not fit them."""
    result = equations(enforcement.system(system, options), choice, formulation, moving=True)
    reason = enforcement.refusal(result, options)
    if reason:
        raise AssumptionError(
            f"{system.model.name}, {formulation}: enforcement '{enforcement.name}' does not "
            f"fit: {reason}"
        )
    charts = tuple(enforcement.equations(chart, options) for chart in result.charts)
    return replace(enforcement.equations(result, options), charts=charts)


__all__ = ["ENFORCEMENTS", "Enforcement", "Options", "kept_equations", "usual_rate"]
