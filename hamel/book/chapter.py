"""One chapter, as far as it depends on its model alone: texts, figures, exercises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from derive.diagnostics import AssumptionError, HamelError
from derive.robots import File
from derive.textbook import ROADS
from derive.textbook.derivation import derivation
from derive.textbook.writing.html import parts_of
from derive.textbook.writing.pages import rendered
from hamel.book.course import Course, course_of, errors_of
from hamel.book.exercises import Exercise, exercises, start_values
from hamel.book.topics import length_of, things_of, topic_of
from hamel.build.stages import equations_of
from hamel.draw.mechanism import picture, svg

ROAD = ROADS[0].name


@dataclass(frozen=True)
class Motion:
    """What the chapter shows of a motion: plots (SVG), what was told, the table of the start and
    the exercises."""

    span: float
    plot: str
    errors: str  # SVG; empty where there is no reference
    doubt: float
    told: str
    start: tuple[tuple[str, str, str], ...]
    exercises: tuple[Exercise, ...]


@dataclass(frozen=True)
class Chapter:
    """`motion` is None where there is none, and `refusal` says why."""

    name: str
    description: str
    topic: int
    length: int
    things: tuple[str, ...]
    freedoms: int
    choice: str
    reason: str
    sections: tuple[tuple[str, str], ...]  # anchors and titles of the derivation
    derivation: str  # its sections, in HTML
    figure: str
    motion: Motion | None
    refusal: str

    @property
    def title(self) -> str:
        """The name of the model as words."""
        return self.name.replace("_", " ")


def attempt(path: File) -> Chapter | str:
    """The chapter, or in one line why there is none: what goes from one process to another."""
    try:
        return chapter(path)
    except HamelError as error:
        return str(error).splitlines()[0]


def chapter(path: File) -> Chapter:
    """The chapter of a model file. Raises HamelError where the model has no derivation."""
    equations = equations_of(path)
    model, system = equations.system.model, equations.system
    drawing, document = picture(system), derivation(equations, (ROAD,))
    motion, refusal = _motion(path)
    return Chapter(
        name=model.name,
        description=model.description,
        topic=topic_of(model),
        length=length_of(model),
        things=things_of(model),
        freedoms=equations.argument("x").symbols.numel() - system.q.numel() - len(equations.z),
        choice=equations.choice,
        reason=equations.reason,
        sections=tuple((section.anchor, section.title) for section in document.sections),
        derivation=rendered("derive.textbook.writing/sections.html.j2", **parts_of(document)),
        figure=svg(drawing, f"figure-{model.name}") if drawing else "",
        motion=motion,
        refusal=refusal,
    )


def _motion(path: File) -> tuple[Motion | None, str]:
    try:
        with course_of(path) as course:
            return _shown(course), ""
    except AssumptionError as error:
        return None, error.diagnostics[0].message
    except FloatingPointError as error:  # a function that has no value where it is asked
        return None, str(error)


def _shown(course: Course) -> Motion:
    record, errors = course.record, errors_of(course)
    assert record.figure is not None  # the record is of a motion
    told = (
        f"{record.steps} steps of {record.integrator}, enforcement {record.enforcement}; largest "
        f"|φ| {record.position_violation:.1e}, largest |A v − c| {record.velocity_violation:.1e}"
    )
    if record.stopped_by:
        told += f"; the event {record.stopped_by} ended the motion"
    if errors is None:
        told += "; tighter runs do not come to its end: what accuracy costs is not known"
    return Motion(
        span=course.span,
        plot=record.figure(),
        errors=errors.figure if errors else "",
        doubt=errors.doubt if errors else 0.0,
        told=told,
        start=start_values(course),
        exercises=exercises(course),
    )


def objectives(one: Chapter, new: Sequence[str], known: Mapping[str, str]) -> list[str]:
    """What a reader can do after the chapter: `new` things are met for the first time, `known` ones
    (by name the chapter) were met before."""
    count = f"{one.freedoms} degree{'s' if one.freedoms != 1 else ''} of freedom"
    goals = [
        f"Derive the equations of motion over the quasi-velocities “{one.choice}”, {count}, and "
        "say why no multiplier is left in them.",
    ]
    if new:
        goals.insert(0, f"Describe what is met here for the first time: {', '.join(new)}.")
    if known:
        goals.append(f"Use what earlier chapters brought: {', '.join(known)}.")
    if one.motion:
        goals.append("Check the equations against numbers that a generated module computes.")
    if one.motion and one.motion.errors:
        goals.append("Say what a digit of accuracy costs, and which integrator gives it cheapest.")
    return goals
