"""System → Equations: one formulation, one choice of quasi-velocities."""

from __future__ import annotations

from dataclasses import replace

from derive.choices.named import declared
from derive.choices.ranking import Ranking
from derive.choices.resolution import ranked_partitions
from derive.choices.survey import Survey, survey_of
from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.formulations.charts import BETWEEN, charted, covered
from derive.formulations.configuration import configuration, is_plain
from derive.formulations.fitness import check_determined
from derive.formulations.formulation import Formulation
from derive.formulations.manifold import manifold
from derive.formulations.methods import FORMULATIONS
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.model.memory import without_collections
from derive.model.records import Choice
from derive.numerics import refuses_numerically


@refuses_numerically("the equations of motion")
@without_collections()
def equations(
    system: System,
    choice: str | None = None,
    formulation: str = "quasi_velocities",
    charts: bool = False,
    moving: bool = False,
) -> Equations:
    """The functions of the generated module for a choice (the first declared one when not named)
    and a formulation.

        q̇ = N v,   v = S w + R c,   (Sᵀ M S) ẇ = Sᵀ (Q − h − M σ)        x = (q, w)
        q̇ = N v,   M v̇ + h = Q + Aᵀ λ,   A v̇ = β                         x = (q, v)

    The first for formulations that choose quasi-velocities, the second for the others. All
    quantities are SI; the components of v are in the axes of the moving body for planar, ball and
    free joints.

    Several choices, `a+b`, are charts of one module; with `charts` a choice that is not named gets
    further ones where no choice is safe. With `moving` directions that a choice is based on are
    data, as generated modules have them. Raises ModelError for a name that is unknown or
    named twice, AssumptionError where nothing determines some acceleration, where the formulation
    does not fit the system, and where the choice does not fit the constraints.
    """
    asked, survey = named(formulation), survey_of(system, moving)
    wanted = [declared(system, name) for name in _names(choice)]
    check_determined(survey)
    reason = asked.misfit(survey)
    if reason:
        raise AssumptionError(
            f"{system.model.name}: formulation {asked.name} does not fit: {reason}"
        )
    result = [_of_choice(asked, survey, one) for one in (wanted if asked.chooses else wanted[:1])]
    if len(result) > 1:
        return charted(result, survey)
    if charts and choice is None:
        return covered(
            result[0], survey, lambda name: _of_choice(asked, survey, declared(system, name))
        )
    return result[0]


def _names(choice: str | None) -> list[str | None]:
    return [None] if choice is None else [name.strip() for name in choice.split(BETWEEN)]


def _of_choice(asked: Formulation, survey: Survey, choice: Choice) -> Equations:
    result, system = asked.build(survey, choice), survey.system
    moves = configuration(system) if is_plain(system) else ()
    further = (*manifold(result, survey), *moves)
    return replace(result, requests=(*result.requests, *further))


def named(formulation: str) -> Formulation:
    """The formulation of that name. Raises ModelError with the nearest one."""
    known = {f.name: f for f in FORMULATIONS}
    if formulation not in known:
        raise ModelError(
            f"unknown formulation '{formulation}'",
            did_you_mean(formulation, known) or listed(known),
        )
    return known[formulation]


def source(formulation: str) -> str:
    """Who devised it."""
    return named(formulation).source


@refuses_numerically("the formulations that fit")
def misfits(system: System) -> dict[str, str]:
    """Why each formulation does not fit the system, "" for those that do.

    Judged at sampled admissible states, by the ranks of M and [M; A] and by the form of the system
    (a tree, a mass matrix that is written out): see `fitness`.
    """
    survey = survey_of(system)
    return {formulation.name: formulation.misfit(survey) for formulation in FORMULATIONS}


@refuses_numerically("the choices of quasi-velocities")
def choices(system: System) -> tuple[Ranking, ...]:
    """What `auto` compared, best first, with the declared choices among them."""
    return tuple(x.ranking for x in ranked_partitions(survey_of(system)))
