"""hamel: explicit equations of motion from a model file, as verified C and NumPy.

    import hamel
    built = hamel.build("models/four_bar.yaml", choice="crank")
    module = hamel.load(built.folder)

Each verb of the command line is a function here. Importing this package imports nothing else: the
verbs come with the first of them that is asked for, the libraries behind a verb when it runs.
"""

import importlib
import sys
from types import ModuleType

TYPE_CHECKING = False  # typing's own takes as long to import as all of this
if TYPE_CHECKING:
    from codegen.runtime.events import Event
    from derive.diagnostics import (
        AssumptionError,
        HamelError,
        ModelError,
        ToolchainError,
        VerificationError,
    )
    from derive.model.builder import Model
    from derive.robots import Floating, RobotFile
    from hamel.api import (
        base_parameters,
        book,
        build,
        check,
        choices,
        derive,
        draw,
        excitation,
        explain,
        extremes,
        free_parameters,
        identify,
        import_,
        linearize,
        list,
        load,
        report,
        schema,
        simulate,
        sweep,
        verify,
    )

__version__ = "0.1.0"
__all__ = [
    "AssumptionError",
    "Event",
    "Floating",
    "HamelError",
    "Model",
    "ModelError",
    "RobotFile",
    "ToolchainError",
    "VerificationError",
    "base_parameters",
    "book",
    "build",
    "check",
    "choices",
    "derive",
    "draw",
    "excitation",
    "explain",
    "extremes",
    "free_parameters",
    "identify",
    "import_",
    "linearize",
    "list",
    "load",
    "report",
    "schema",
    "simulate",
    "sweep",
    "verify",
]


_HOMES = {
    "AssumptionError": "derive.diagnostics",
    "Event": "codegen.runtime.events",
    "Floating": "derive.robots",
    "HamelError": "derive.diagnostics",
    "Model": "derive.model.builder",
    "ModelError": "derive.diagnostics",
    "RobotFile": "derive.robots",
    "ToolchainError": "derive.diagnostics",
    "VerificationError": "derive.diagnostics",
}


class _Face(ModuleType):
    """The verbs under their names. Importing a package of the same name, such as `hamel.verify`,
    does not put itself in a verb's place."""

    def __getattr__(self, name: str) -> object:
        if name not in __all__:
            raise AttributeError(f"module 'hamel' has no attribute '{name}'")
        home = _HOMES.get(name, "hamel.api")
        value = getattr(importlib.import_module(home), name)
        setattr(self, name, value)
        return value

    def __setattr__(self, name: str, value: object) -> None:
        if name not in __all__ or not isinstance(value, ModuleType):
            super().__setattr__(name, value)

    def __dir__(self):  # type: ignore[no-untyped-def]
        return [*super().__dir__(), *__all__]


sys.modules[__name__].__class__ = _Face
