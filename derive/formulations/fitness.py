"""Why a formulation does not fit a system, in words: each function gives the reason, or "" where
there is none.

Ranks are judged at the sampled states. A symmetric semidefinite M determines v̇ if and only if rank
[M; A] = nv (Udwadia & Phohomsiri 2006), which is the same as SᵀM S being positive definite for
every S whose columns span ker A.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from derive.choices.pivots import sampled
from derive.choices.survey import Survey
from derive.diagnostics import AssumptionError, listed
from derive.formulations.dependence import dependent_joints
from derive.formulations.limits import MASSLESS, NULL, TAKES_PART
from derive.joints.rotations import is_zero
from derive.mechanics.elimination.solve import scalars
from derive.mechanics.records import System

Misfit = Callable[[Survey], str]
INERTIA = (
    "inertia of that body, or joints that do not turn it: of the type point in a plane, and three "
    "of the type prismatic in space"
)
BODY_MASS = "a mass of that body"
MASS = "a mass or an inertia in the kinetic energy, or a constraint"


def first_of(*reasons: Misfit) -> Misfit:
    """The first reason that is one."""
    return lambda survey: next(
        (text for text in (reason(survey) for reason in reasons) if text), ""
    )


def unwritten(survey: Survey) -> str:
    """The mass matrix of a long chain is not written out."""
    if survey.system.written:
        return ""
    return (
        "the mass matrix of so long a chain is not written out: use quasi_velocities or recursive"
    )


def singular(survey: Survey) -> str:
    """M has no inverse, but with the constraints v̇ is determined: a body without inertia along
    some direction. "" where M is positive definite at most sampled states."""
    if survey.system.definite:
        return ""
    columns = _null_velocities(survey, masses(survey))
    return (
        f"the mass matrix is singular at {_places(survey.system, columns)}: use "
        "udwadia_phohomsiri or quasi_velocities"
        if columns
        else ""
    )


def undetermined(survey: Survey) -> str:
    """rank [M; A] < nv: neither inertia nor a constraint determines some acceleration. Then no
    formulation has an answer, as SᵀM S is singular for every choice."""
    columns = _undetermined(survey)
    return _undetermined_in_words(survey.system, columns) if columns else ""


def check_determined(survey: Survey) -> None:
    """Raises AssumptionError at the first body or coordinate whose acceleration nothing
    determines."""
    columns = _undetermined(survey)
    if not columns:
        return
    _check_independent(survey)
    model = survey.system.model
    velocity = model.velocities[columns[0]]
    joint = next((joint for joint in model.joints if joint.name == velocity.owner), None)
    advice = MASS if joint is None else INERTIA if velocity.unit == "rad/s" else BODY_MASS
    message = _undetermined_in_words(survey.system, columns)
    span = velocity.span if joint is None else model.body(joint.child).span
    raise AssumptionError(model.diagnostic(span, message, advice))


def _check_independent(survey: Survey) -> None:
    """Raises AssumptionError where it is the axes of joints that determine too little."""
    (M,) = _with_rows(survey, [sampled(survey, survey.system.M)[0]])
    for motion in _null_space(M).T:
        joints, still = dependent_joints(survey, motion)
        if joints:
            names = listed([joint.name for joint in joints])
            raise AssumptionError(
                survey.system.model.diagnostic(
                    joints[-1].span,
                    f"the axes of the joints {names} depend on each other: moved together they "
                    f"leave the body {still} still, so nothing determines how fast they move",
                    "axes in other directions or places, or one joint less",
                )
            )


def _undetermined(survey: Survey) -> list[int]:
    if survey.system.definite:
        return []
    return _null_velocities(survey, _with_rows(survey, masses(survey)))


def _with_rows(survey: Survey, M: list[np.ndarray]) -> list[np.ndarray]:
    """[M; A] at the sampled states."""
    if not survey.system.rows:
        return M
    return [np.vstack([m, A]) for m, A in zip(M, survey.rows)]


def _undetermined_in_words(system: System, columns: list[int]) -> str:
    return (
        f"rank [M; A] is less than {system.v.numel()}: nothing determines the "
        f"acceleration of {_places(system, columns)}"
    )


def constrained(survey: Survey) -> str:
    """The recursion M = U D Uᵀ is over a tree: a closed loop or any other row would couple
    branches."""
    rows = survey.system.rows
    if not rows:
        return ""
    names = listed(list(dict.fromkeys(row.name.split(".")[0] for row in rows)))
    return f"it is for trees without constraints, but here is {names}: use quasi_velocities"


def not_of_links(survey: Survey) -> str:
    """The recursion needs all inertia in bodies, or in rotors of single velocities."""
    system = survey.system
    carried = {j for link in system.links for j in link.columns}
    loose = [system.model.velocities[j].name for j in range(system.v.numel()) if j not in carried]
    if loose:
        return f"no joint carries {listed(loose)}: use quasi_velocities"
    beside = any(
        i != j and not is_zero(x)
        for i, row in enumerate(scalars(system.M_extra))
        for j, x in enumerate(row)
    )
    return (
        "the kinetic energy couples joints beside their bodies: use quasi_velocities"
        if beside
        else ""
    )


def masses(survey: Survey) -> list[np.ndarray]:
    """M at the sampled states, scaled to a unit diagonal, D^−½ M D^−½ with D = diag M: so that kg
    beside kg m² does not look like a small pivot."""
    return [_scaled(M) for M in sampled(survey, survey.system.M)]


def _scaled(M: np.ndarray) -> np.ndarray:
    size = np.sqrt(np.abs(np.diag(M)))
    size = np.where(size > MASSLESS * np.max(size, initial=0.0), size, 1.0)
    return M / np.outer(size, size)


def _null_velocities(survey: Survey, matrices: list[np.ndarray]) -> list[int]:
    """Those with a part in null directions that most sampled states have; none where most have
    none."""
    spaces = [_null_space(x) for x in matrices]
    if not spaces or np.median([space.shape[1] for space in spaces]) == 0:
        return []
    weights = np.max([np.linalg.norm(space, axis=1) for space in spaces if space.shape[1]], axis=0)
    return [j for j, x in enumerate(weights) if x > TAKES_PART * np.max(weights)]


def _null_space(matrix: np.ndarray) -> np.ndarray:
    _, values, rows = np.linalg.svd(matrix)
    rank = int(np.sum(values > NULL * np.max(values, initial=0.0)))
    return rows[rank:].T


def _places(system: System, columns: list[int]) -> str:
    """Bodies by name, with their velocities; coordinates of the analytic form by theirs."""
    model = system.model
    child = {joint.name: joint.child for joint in model.joints}
    bodies: dict[str, list[str]] = {}
    for j in columns:
        velocity = model.velocities[j]
        bodies.setdefault(child.get(velocity.owner, ""), []).append(velocity.name)
    return " and ".join(_place(body, names) for body, names in bodies.items())


def _place(body: str, names: list[str]) -> str:
    if body:
        return f"body {body} ({', '.join(names)})"
    coordinates = [name.removeprefix("der(").removesuffix(")") for name in names]
    return f"coordinate{'s' if len(names) > 1 else ''} {', '.join(coordinates)}"
