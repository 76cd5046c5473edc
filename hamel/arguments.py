"""Arguments and options that several verbs of the command line share, and how their texts are
read."""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import click

import hamel

Function = Callable[..., Any]

ROBOT = (
    click.option(
        "--floating", is_flag=True, help="Of a URDF or MJCF file: the root link moves freely."
    ),
    click.option(
        "--exact",
        is_flag=True,
        help="Of a URDF file: angles to the last digit (default: 1.5708 is a right angle).",
    ),
    click.option(
        "--include",
        multiple=True,
        metavar="DIR",
        help="Of an MJCF file: a folder it may include from, beside its own; may be repeated.",
    ),
    click.option(
        "--allow-unphysical",
        "unphysical",
        is_flag=True,
        help="Of a URDF or MJCF file: an inertia that no body can have is taken as it is.",
    ),
    click.option(
        "--parameters",
        default="",
        metavar="inertial|barycentric",
        help="Of a URDF or MJCF file: masses, centres of mass and inertias become parameters, and "
        "a payload is added; barycentric: masses, first moments and inertias about the origin.",
    ),
)

OF_ROBOTS = {
    "floating": "--floating",
    "exact": "--exact",
    "include": "--include",
    "unphysical": "--allow-unphysical",
    "parameters": "--parameters",
}


def model_argument(function: Function, required: bool = True, name: str = "model") -> Function:
    """The argument MODEL with the options that belong to it."""

    @functools.wraps(function)
    def run(**options: Any) -> Any:
        model = options.pop(name)
        said = {name: options.pop(name) for name in OF_ROBOTS}
        if any(said.values()) and model is None:
            raise click.UsageError(f"{', '.join(OF_ROBOTS.values())} are said of a file")
        if any(said.values()):
            model = hamel.RobotFile(model, **said)
        return function(model, **options)

    for option in reversed(ROBOT):
        run = option(run)
    return click.argument(name, required=required)(run)


CHOICE = click.option(
    "--choice",
    metavar="NAME",
    help="The choice of quasi-velocities, or a+b for charts of one motion (default: the file's "
    "first).",
)
FORMULATION = click.option(
    "--formulation",
    metavar="NAME",
    default="quasi_velocities",
    show_default=True,
    help="How the equations are formed: see list.",
)
REAL = click.option(
    "--real",
    default="float64",
    show_default=True,
    metavar="NAME",
    help="What the code computes in: float64 or float32.",
)


class Listed(click.Option):
    """An option that takes names with commas between them, and all that was said where it stands
    several times."""

    def __init__(self, *given: Any, metavar: str = "a,b", **named: Any) -> None:
        def joined(context: click.Context, parameter: click.Parameter, value: Any) -> str:
            return ",".join(value)

        super().__init__(*given, metavar=metavar, multiple=True, callback=joined, **named)


TARGETS = functools.partial(click.option, "--target", "targets", cls=Listed)
CONSTANTS = click.option(
    "--constants",
    cls=Listed,
    metavar="all|a,b",
    help="Parameters to bake in as numbers (default: none, all stay arguments).",
)


def name_list(text: str) -> tuple[str, ...]:
    """What stands between commas."""
    return tuple(name for name in (part.strip() for part in text.split(",")) if name)


def constant_names(text: str) -> Any:
    """Names of parameters, or "all"."""
    return "all" if text.strip() == "all" else name_list(text)


class _Positive(click.ParamType):
    """A finite number above zero."""

    name = "float"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number = click.FLOAT.convert(value, param, ctx)
        if not (number > 0 and math.isfinite(number)):
            self.fail(f"{value} is not a positive number.", param, ctx)
        return float(number)


class _Finite(click.ParamType):
    """A finite number."""

    name = "float"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number = click.FLOAT.convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return float(number)


POSITIVE, FINITE = _Positive(), _Finite()


def number_list(text: str) -> tuple[float, ...]:
    """Numbers between commas. Raises BadParameter."""
    try:
        return tuple(map(float, name_list(text)))
    except ValueError:
        raise click.BadParameter(f"'{text}' is no list of numbers", param_hint="--rtol") from None


def name_and_value(text: str, option: str) -> tuple[str, str]:
    """Both sides of NAME=VALUE. Raises BadParameter."""
    name, equals, value = text.partition("=")
    if not (name.strip() and equals and value.strip()):
        raise click.BadParameter(f"'{text}' is not NAME=VALUE", param_hint=option)
    return name.strip(), value.strip()


def values_by_name(texts: Sequence[str], option: str = "--set") -> dict[str, str]:
    """Of several NAME=VALUE. Raises BadParameter, also where a name has two values."""
    pairs = [name_and_value(text, option) for text in texts]
    counts = Counter(name for name, _ in pairs)
    twice = next((name for name, count in counts.items() if count > 1), None)
    if twice:
        raise click.BadParameter(f"'{twice}' has {counts[twice]} values", param_hint=option)
    return dict(pairs)
