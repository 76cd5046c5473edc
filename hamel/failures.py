"""What a user sees of an error: one message and a documented exit code, never a traceback unless
--debug asks for it."""

from __future__ import annotations

import json
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

import click

import codegen
import derive
import hamel
from derive.diagnostics import Diagnostic, HamelError, ToolchainError, one_line

VERIFICATION = 4
USAGE, INTERNAL, INTERRUPTED, PIPE = 64, 70, 130, 141  # sysexits.h and 128 + signal

# NumPy's words for a number that is none; what comes of it is checked and told where it is used
FLOATS = r"(divide by zero|overflow|underflow|invalid value) encountered"


def guarded(command: Callable[[], Any], arguments: Sequence[str]) -> int:
    """Run `command` and return the exit code; errors go to standard error or, with --json, to
    standard output as one object."""
    _open_streams()
    try:
        warnings.formatwarning = _once(set())
        warnings.filterwarnings("ignore", FLOATS, RuntimeWarning)
        _check_neighbours()
        code = command()
        sys.stdout.flush()
        return code if isinstance(code, int) else 0
    except BrokenPipeError:
        return _unread()
    except (KeyboardInterrupt, click.Abort):
        return _report((Diagnostic(message="interrupted"),), INTERRUPTED, arguments)
    except HamelError as error:
        return _report(error.diagnostics, error.exit_code, arguments)
    except click.ClickException as error:
        return _report((_usage(error),), USAGE, arguments)
    except OSError as error:
        message = f"{error.filename}: {error.strerror}" if error.filename else str(error)
        return _report((Diagnostic(message=message),), ToolchainError.exit_code, arguments)
    except Exception as error:
        if numeric := _numeric(error):
            return _report(numeric.diagnostics, numeric.exit_code, arguments)
        return _report((_internal(error),), INTERNAL, arguments)


def _open_streams() -> None:
    """Where whoever started the process has closed one, what is printed there goes nowhere."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8"))


def _unread() -> int:
    """Nobody reads on: the interpreter gets somewhere to flush to when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return PIPE


def _once(said: set[str]) -> Callable[..., str]:
    """Warnings as one line without a place in our sources, each said once."""

    def line(message: Warning | str, *place: Any, **more: Any) -> str:
        text = f"warning: {one_line(str(message))}\n"
        new = text not in said
        said.add(text)
        return text if new else ""

    return line


def _usage(error: click.ClickException) -> Diagnostic:
    context = getattr(error, "ctx", None)
    return Diagnostic(
        message=error.format_message(),
        hint=f"see '{context.command_path if context else 'hamel'} --help'",
    )


def _numeric(error: Exception) -> HamelError | None:
    """A number that got out of hand past the derivation: a broken assumption, not a bug."""
    from derive.numerics import FAILURES, refusal  # NumPy is there already where one is raised

    return refusal("the result", error) if isinstance(error, FAILURES) else None


def _internal(error: Exception) -> Diagnostic:
    last = traceback.extract_tb(error.__traceback__)[-1]
    place = f"{os.path.basename(last.filename)}:{last.lineno}"
    what = f"{type(error).__name__}: {error}".splitlines()[0]
    return Diagnostic(
        message=f"internal error, please report it with the model: {what} ({place}); --debug "
        "shows the traceback"
    )


def _report(problems: Sequence[Diagnostic], code: int, arguments: Sequence[str]) -> int:
    if "--json" in arguments:
        first, *more = [_as_json(problem) for problem in problems]
        try:
            print(json.dumps({"error": first, "exit_code": code, "more": more}), flush=True)
            return code
        except BrokenPipeError:
            return _unread()
        except OSError:  # it is full: then on standard error, in words
            pass
    print(HamelError(problems), file=sys.stderr)
    if "--debug" in arguments:
        traceback.print_exc()
    return code


def _as_json(problem: Diagnostic) -> dict[str, Any]:
    return asdict(problem)


def _check_neighbours() -> None:
    """PyPI has other packages called `derive` and `codegen`; if one of them is found first nothing
    here can work."""
    home = os.path.dirname(os.path.dirname(os.path.abspath(hamel.__file__)))
    for package in (derive, codegen):
        place = os.path.dirname(os.path.dirname(os.path.abspath(package.__file__ or "")))
        if place != home:
            raise ToolchainError(
                f"the package '{package.__name__}' in {place} hides hamel's own",
                hint=f"pip uninstall {package.__name__}",
            )
