"""import: a URDF or MJCF robot as a model file that a person can go on editing."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from derive.choices.survey import survey_of
from derive.diagnostics import HamelError, ModelError, counted
from derive.expressions.evaluate import number
from derive.formulations.fitness import check_determined
from derive.model.records import Model
from derive.robots.reading import imported
from derive.states import system
from hamel.build.files import write_text
from hamel.records import Imported

if TYPE_CHECKING:
    from rich.console import Console


def run(path: str | PathLike[str], out: str | Path | None, floating: bool) -> Imported:
    """The model file for a URDF or MJCF robot, written to `out` or only returned as text;
    `floating`: the base moves freely.

    Raises ModelError where the result would overwrite the robot's own file, AssumptionError where
    nothing determines how a body without mass moves.
    """
    file = Path(out) if out else None
    if file and file.exists() and Path(path).exists() and file.samefile(path):
        raise ModelError(
            f"{path} would be overwritten by its own model", "give another file with -o"
        )
    robot = imported(path, floating)
    _check_massless(robot.model)
    if file:
        write_text(file, robot.text)
    return Imported(
        model=robot.model.name,
        kind=robot.kind,
        file=file,
        bodies=len(robot.model.bodies),
        joints=robot.joints,
        velocities=len(robot.model.velocities),
        changed=(*robot.changed, *robot.assumed),
        left_out=robot.left_out,
        text=robot.text,
    )


def _check_massless(model: Model) -> None:
    """As `check` does. What else is to be mended there, as loops that do not close, can be in the
    model's file."""
    values = {x.name: x.value for x in model.parameters}
    if all(number(body.mass, values) for body in model.bodies):
        return
    try:
        survey = survey_of(system(model))
    except HamelError:
        return
    check_determined(survey)


def show(record: Imported, console: Console) -> None:
    """The file's text itself where none was written, else its size and what was changed or left
    out."""
    if record.file is None:
        console.print(record.text, end="", soft_wrap=True)
        return
    size = (
        f"{counted(record.bodies, 'body', 'bodies')}, "
        f"{counted(record.velocities, 'velocity', 'velocities')}"
    )
    console.print(f"{record.model}: {record.kind} of {size} written to {record.file}")
    for note in record.changed:
        console.print(f"  {note}")
    for note in record.left_out:
        console.print(f"  left out: {note}")
