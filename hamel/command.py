"""What a verb of the command line is: a click command that prints a record as text or, with
--json, as one object.

Only click is imported until a verb runs.
"""

from __future__ import annotations

import functools
import importlib
import keyword
import logging
from collections.abc import Callable
from typing import Any

import click

import hamel
from hamel import failures

Function = Callable[..., Any]

EPILOG = (
    "Exit codes: 0 ok, 1 model error, 2 assumption violated, 3 toolchain missing or output not "
    "writable, 4 verification failed, "
    "64 wrong usage, 70 internal error, 130 interrupted."
)


@click.group(
    epilog=EPILOG,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
@click.version_option(hamel.__version__, prog_name="hamel")
def group() -> None:
    """Explicit equations of motion from a model file: derived, compiled, verified."""


def verb(function: Function) -> click.Command:
    """Make a command of a function that returns a record: `--json` prints the record, else the
    verb's `show` does."""
    name = function.__name__.rstrip("_")

    @functools.wraps(function)
    def run(as_json: bool, debug: bool, verbose: bool, **options: Any) -> None:
        if verbose:
            _log()
        record = function(**options)
        _print(name, record, as_json, options)
        if getattr(record, "passed", True) is False:
            raise click.exceptions.Exit(failures.VERIFICATION)

    run = click.option("--debug", is_flag=True, help="Show the traceback of an error.")(run)
    run = click.option(
        "-v", "--verbose", is_flag=True, help="Say every stage of the work with its seconds."
    )(run)
    run = click.option(
        "--json", "as_json", is_flag=True, help="Print one JSON object and nothing else."
    )(run)
    return group.command(name)(run)


def _log() -> None:
    """What is logged goes to standard error as it is."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(message)s"))
    log = logging.getLogger("hamel")
    log.handlers[:] = [handler]
    log.setLevel(logging.DEBUG)


def _print(name: str, record: Any, as_json: bool, options: dict[str, Any]) -> None:
    if as_json:
        _print_json(record)
        return
    from hamel.show import page

    console = page()
    shown = importlib.import_module(f"hamel.verbs.{name}{'_' * keyword.iskeyword(name)}")
    shown.show(record, console)
    if options.get("explain"):
        shown.explain(record, console)


def _print_json(record: Any) -> None:
    import json

    from hamel.records import as_json

    click.echo(json.dumps(as_json(record), allow_nan=False))
