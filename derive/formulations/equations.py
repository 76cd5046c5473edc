"""System → Equations: one formulation, one choice of quasi-velocities."""

from __future__ import annotations

from dataclasses import replace

from derive.diagnostics import AssumptionError, did_you_mean, listed
from derive.formulations.charts import BETWEEN, charted
from derive.formulations.choices import Ranking, ranked_partitions, workshop
from derive.formulations.configuration import configuration, is_plain
from derive.formulations.derivatives import derivatives
from derive.formulations.formulation import Formulation
from derive.formulations.manifold import manifold
from derive.formulations.methods import FORMULATIONS
from derive.formulations.named_choices import declared
from derive.formulations.records import Equations
from derive.mechanics.records import System


def equations(system: System, choice: str | None = None, formulation: str = "quasi_velocities") -> Equations:
    """The functions of the generated module for a choice (the first declared one when not named) and a formulation.

    Several choices, `a+b`, are charts of one module. Raises AssumptionError for an unknown name, where the formulation does not
    fit the system, and where the choice does not fit the constraints.
    """
    names = (choice or "").split(BETWEEN)
    if len(names) > 1:
        found = [equations(system, name.strip(), formulation) for name in names]
        return found[0] if found[0].base_velocities else charted(found)
    asked, wanted, shop = named(formulation), declared(system, choice), workshop(system)
    reason = asked.misfit(shop)
    if reason:
        raise AssumptionError(f"{system.model.name}: formulation {asked.name} does not fit: {reason}")
    found = asked.build(shop, wanted)
    moves = configuration(system) if is_plain(system) else ()
    further = (*derivatives(found.arguments, found.functions), *manifold(found, shop.kept, shop.closing), *moves)
    return replace(found, requests=(*found.requests, *further))


def named(formulation: str) -> Formulation:
    """The formulation of that name. Raises AssumptionError with the nearest one."""
    known = {f.name: f for f in FORMULATIONS}
    if formulation not in known:
        raise AssumptionError(f"unknown formulation '{formulation}'", did_you_mean(formulation, known) or listed(known))
    return known[formulation]


def source(formulation: str) -> str:
    """Who devised it."""
    return named(formulation).source


def misfits(system: System) -> dict[str, str]:
    """Why each formulation does not fit the system, "" for those that do."""
    shop = workshop(system)
    return {formulation.name: formulation.misfit(shop) for formulation in FORMULATIONS}


def choices(system: System) -> tuple[Ranking, ...]:
    """What `auto` compared, best first, with the declared choices among them."""
    return tuple(x.ranking for x in ranked_partitions(workshop(system)))
