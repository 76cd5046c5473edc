"""The command `hamel`, and `python -m hamel`.

An interrupt is quiet from the first moment on: while the command line is imported, too.
"""

import os
import signal
from types import FrameType


def main() -> None:
    """The command line with the arguments of this process."""
    signal.signal(signal.SIGINT, _interrupted)
    from hamel.cli import main as command

    signal.signal(signal.SIGINT, signal.default_int_handler)
    command()


def _interrupted(number: int, frame: FrameType | None) -> None:
    """Nothing was begun yet, so that nothing has to be cleared away."""
    os.write(2, b"error: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    main()
