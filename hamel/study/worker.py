"""A worker process: reads calls, one JSON object a line, and writes what they yield, a line each.
See crew.py."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
from collections.abc import Callable, Iterator
from typing import Any

from derive.diagnostics import HamelError
from hamel.study import building, libraries, running

CALLS: dict[str, Callable[..., Iterator[dict[str, Any]]]] = {
    "build": building.built,
    "exact": running.exact,
    "run": running.rows,
    "track": running.tracks,
    "library": libraries.rows,
}


def main() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted, and ends its workers
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)  # libraries print there
    os.dup2(silent, 2)
    for line in sys.stdin:
        order = json.loads(line)
        for message in _answers(order["call"], order["arguments"]):
            out.write(json.dumps(_plain(message)) + "\n")
            out.flush()


def _answers(call: str, arguments: dict[str, Any]) -> Iterator[dict[str, Any]]:
    try:
        yield from CALLS[call](**arguments)
    except HamelError as error:
        yield {"error": error.diagnostics[0].message, "exit_code": error.exit_code}
    except Exception as error:
        yield {
            "error": f"internal error: {type(error).__name__}: {error}".splitlines()[0],
            "exit_code": 70,
        }
    else:
        yield {"over": "done"}


def _plain(value: Any) -> Any:
    """Infinite and undefined numbers as null."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


if __name__ == "__main__":
    main()
