"""hamel: explicit equations of motion from a model file, as verified C and NumPy.

    import hamel
    built = hamel.build("models/four_bar.yaml", choice="crank")
    module = hamel.load(built.folder)

Each verb of the command line is a function here. Importing this package imports none of the
libraries behind the verbs.
"""

import sys
from types import ModuleType

from derive.robots import Floating, RobotFile
from hamel.api import (
    build,
    check,
    choices,
    derive,
    explain,
    extremes,
    import_,
    linearize,
    list,
    load,
    report,
    schema,
    simulate,
    verify,
)

__version__ = "0.1.0"
__all__ = [
    "Floating",
    "RobotFile",
    "build",
    "check",
    "choices",
    "derive",
    "explain",
    "extremes",
    "import_",
    "linearize",
    "list",
    "load",
    "report",
    "schema",
    "simulate",
    "verify",
]


class _Face(ModuleType):
    """Keeps `hamel.verify` the verb: importing the package of the same name would put itself in its
    place."""

    def __setattr__(self, name: str, value: object) -> None:
        if name not in __all__ or not isinstance(value, ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Face
