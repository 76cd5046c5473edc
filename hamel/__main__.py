"""The command `hamel`, and `python -m hamel`.

An interrupt is quiet from the first moment on: while the command line is imported, too.
"""

import _signal  # pyright: ignore[reportMissingImports]  # `signal` takes a while to import: time in which an interrupt would be loud
import gc
import os
from types import FrameType

# Derivations make many small objects and hardly a cycle: to look for cycles as often as Python does
# by itself takes a tenth of a build.
OBJECTS = 100_000  # made and not gone, until it is looked for cycles among them


def main() -> None:
    """The command line with the arguments of this process."""
    gc.set_threshold(OBJECTS)
    _signal.signal(_signal.SIGINT, _interrupted)
    from hamel.cli import main as command

    _signal.signal(_signal.SIGINT, _signal.default_int_handler)
    command()


def _interrupted(number: int, frame: FrameType | None) -> None:
    """Nothing was begun yet, so that nothing has to be cleared away."""
    os.write(2, b"error: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    main()
