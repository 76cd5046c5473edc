"""An FMU of the older standard FMI 2.0, for tools that import no other: the same functions under
their names of then, in NAME_fmi2.fmu."""

from __future__ import annotations

from pathlib import Path

import codegen.runtime.build_fmu
from codegen import text
from codegen.program import Program
from codegen.targets.fmu import FOLDER, NEEDS, RUNTIME, TAKER, described, refusal
from codegen.targets.records import Target


def files(program: Program) -> dict[str, str]:
    """NAME_fmi2.c, modelDescription2.xml, build_fmu2.py and the runtime."""
    data = described(program)
    script = Path(codegen.runtime.build_fmu.__file__).read_text("utf-8")
    own = {'NAME = ""': f'NAME = "{program.name}"', "VERSION: int = 3": "VERSION: int = 2"}
    for before, after in own.items():
        script = script.replace(before, after, 1)
    places = {v.reference: n for n, v in enumerate(data["variables"], 1)}
    return {
        f"{program.name}_fmi2.c": text.render("fmi.c.j2", older=True, **data),
        "modelDescription2.xml": text.render("model_description2.xml.j2", places=places, **data),
        "build_fmu2.py": script,
        **{name: (FOLDER / name).read_text("utf-8") for name in (*RUNTIME, "runtime_fmi2.h")},
    }


FMU2 = Target(
    "fmu2",
    "FMI 2.0, Model Exchange and Co-Simulation: NAME_fmi2.fmu",
    files,
    needs=NEEDS,
    refusal=refusal,
    taker=TAKER,
    readme="fmu2.md.j2",
)
