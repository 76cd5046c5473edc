"""Robot files → models: URDF and MJCF become the text of a model, which is then read like any
other.

So errors that the model language finds in a robot are told at the place in the robot's own file.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

from derive import model
from derive.diagnostics import Diagnostic, ModelError, listed
from derive.expressions.limits import BELOW, too_large
from derive.model.builder import Model as BuiltModel
from derive.model.mechanism.bodies import WAIVER
from derive.model.memory import without_collections
from derive.model.records import Model
from derive.robots import ROBOTS, UNREAD, File, RobotFile, mjcf, urdf
from derive.robots.friction import smooth
from derive.robots.inertias import gather, waive
from derive.robots.limits import MOST_BODIES
from derive.robots.markup import Budget, parsed, read, unquoted
from derive.robots.parameters import KINDS, name_parameters
from derive.robots.robot import Robot
from derive.robots.writing import Written, text_of

UNPHYSICAL = "--allow-unphysical takes it as it is"
OF_INERTIA = ("inertia: ", "tensor: ")  # what stands before an inertia in the text of a model
# field of RobotFile → its option, and what to write in a model file instead
OPTIONS = {
    "floating": ("--floating", "a joint of type free in the model file"),
    "exact": ("--exact", ""),
    "include": ("--include", ""),
    "unphysical": ("--allow-unphysical", "physical: false at the body"),
    "parameters": ("--parameters", "parameters: in the model file"),
}


@dataclass(frozen=True)
class Imported:
    """A robot as a model's text. `left_out` alters the motion, `assumed` may, `changed` does not;
    `joints`: the file's name → the model's."""

    model: Model
    text: str
    kind: str
    changed: tuple[str, ...]
    assumed: tuple[str, ...]
    left_out: tuple[str, ...]
    joints: Mapping[str, str]


def load(path: File) -> Model:
    """The Model of a model file, of a model made in Python or of a robot file; what a robot loses
    is warned of."""
    if isinstance(path, BuiltModel):
        return model.load_text(path.yaml(), str(path), path.folder)
    path = path if isinstance(path, RobotFile) else os.fspath(path)
    if Path(path).suffix.lower() in UNREAD:
        raise ModelError(
            f"{path} is an SDF file by its name, which is not read",
            "make a URDF or MJCF file of it",
        )
    if Path(path).suffix.lower() not in ROBOTS:
        if isinstance(path, RobotFile):
            _refuse_options(path)
        return model.load(os.fspath(path))
    result = imported(path)
    for sentence in result.model.notes:
        warnings.warn(f"{path}: {sentence}", RuntimeWarning, stacklevel=2)
    return result.model


def _refuse_options(file: RobotFile) -> NoReturn:
    given = [name for name in OPTIONS if getattr(file, name)] or ["floating"]
    option, instead = OPTIONS[given[0]]
    raise ModelError(f"{option} is for URDF and MJCF files, and {file} is neither", instead)


def imported(path: File, floating: bool = False) -> Imported:
    """A URDF or MJCF file as a model; ModelError with places in that file for everything wrong with
    it."""
    file = path if isinstance(path, RobotFile) else RobotFile(path)
    with without_collections():
        return _imported(replace(file, floating=file.floating or floating))


def _imported(file: RobotFile) -> Imported:
    robot = _robot(file)
    _check_size(robot)
    _check_numbers(robot)
    gather(robot)
    smooth(robot)
    if file.unphysical:
        waive(robot)
    if file.parameters:
        _check_kind(file.parameters)
        name_parameters(robot, file.parameters)
    text = text_of(robot, Path(file).name)
    joints = {
        joint.place.get("name"): joint.name
        for joint in robot.joints
        if joint.place.tag in ("joint", "freejoint")
    }
    result = _model(text, robot, file)
    left_out = tuple(f"left out: {sentence}" for sentence in robot.left_out)
    notes = (*robot.assumed, *result.notes, *left_out)
    origins = tuple((origin or robot.root).diagnostic("") for origin in text.origins)
    return Imported(
        replace(result, notes=notes, origins=origins),
        text.text,
        robot.kind,
        tuple(robot.changed),
        tuple(robot.assumed),
        tuple(robot.left_out),
        joints,
    )


def _robot(file: RobotFile) -> Robot:
    budget, name = Budget(), Path(file).stem
    root = parsed(read(file), budget)
    if root.tag == "robot":
        return urdf.robot(root, name, file.floating, file.exact)
    if root.tag == "mujoco":
        return mjcf.robot(root, name, file.floating, budget, file.include)
    raise ModelError(
        unquoted(root.diagnostic("the file is no robot", "<robot> (URDF) or <mujoco> (MJCF)"))
    )


def _check_kind(parameters: str) -> None:
    if parameters not in KINDS:
        raise ModelError(
            f"unknown parameters '{parameters}' of a robot", f"expected: {listed(KINDS)}"
        )


def _check_size(robot: Robot) -> None:
    """Before anything is made of it: what grows faster than the file does."""
    if len(robot.bodies) > MOST_BODIES:
        robot.root.refuse(f"the robot has {len(robot.bodies)} bodies", f"at most {MOST_BODIES}")


def _check_numbers(robot: Robot) -> None:
    """Masses and inertias that are made of sizes and densities may leave what a model can have."""
    for body in robot.bodies:
        values = {"mass": body.mass, "centre of mass": max(map(abs, body.com))}
        values["inertia"] = next(filter(too_large, body.inertia), 0.0)
        for what, value in values.items():
            if too_large(value):
                body.place.refuse(f"the {what} of '{body.name}' comes to {value:g}", BELOW)


def _model(made: Written, robot: Robot, path: File) -> Model:
    """The text read as a model; what is wrong is told where it stands in the robot's file."""
    moments = {body.place: body.moments for body in robot.bodies if body.moments}
    lines = made.text.split("\n")
    try:
        return model.load_text(made.text, str(path))
    except ModelError as error:
        diagnostics: list[Diagnostic] = []
        for problem in error.diagnostics:
            origin = made.origins[problem.line - 1] if problem.line else None
            hint = UNPHYSICAL if problem.hint == WAIVER else problem.hint
            place = origin or robot.root
            if problem.line and lines[problem.line - 1][: problem.column - 1].endswith(OF_INERTIA):
                place = moments.get(place, place)
            diagnostics.append(place.diagnostic(problem.message, problem.expected, hint))
        raise ModelError(dict.fromkeys(diagnostics)) from None
