"""The Python package around the bindings: loader, stub, build script, notice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from codegen import compiler, text
from codegen.program import Program
from codegen.targets.records import Target


def files(program: Program) -> dict[str, str]:
    """__init__.py, __init__.pyi, py.typed, build.py and LICENSE.txt."""
    data: dict[str, Any] = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
    }
    return {
        "__init__.py": text.render("init.py.j2", **data),
        "__init__.pyi": text.render("init.pyi.j2", **data),
        "py.typed": "",
        "build.py": _build_script(program),
        "LICENSE.txt": text.render("license.txt.j2", **data),
    }


def _build_script(program: Program) -> str:
    """The compile step that hamel itself uses, as a script that stands alone."""
    source = Path(compiler.__file__).read_text(encoding="utf-8")
    return source.replace('NAME = ""', f'NAME = "{program.name}"', 1)


PACKAGE = Target("package", "Python package files", files)
