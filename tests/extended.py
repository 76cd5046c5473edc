"""Generated C recast to long double and integrated there, so that orders show over more decades
than doubles have."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from codegen import compiler
from codegen.emit import emit
from codegen.passes import precision, program
from codegen.program import Program
from codegen.reals import FUNCTIONS, Real
from codegen.targets import schemes, simulate
from derive.formulations.records import Equations

EXTENDED = Real(
    "longdouble", "long double", "L", "np.longdouble", "", 21, "1e5", "1e-12", "1e-14", 16,
    {"double": "long double", "DBL_EPSILON": "LDBL_EPSILON"} | {name: f"{name}l" for name in FUNCTIONS},
)  # fmt: skip
LONGER = np.finfo(np.longdouble).eps < 1e-18  # than double, and in hardware: not on every processor
POLYNOMIALS = "#if defined(__GNUC__)\n    typedef"  # sines of double's digits, beside calls of libm


class Simulator:
    """simulate and project of the C code over long doubles."""

    def __init__(
        self,
        found: Equations,
        functions: list[str],
        integrators: tuple[str, ...],
        enforcements: tuple[str, ...],
    ) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("codegen.passes.rewriting.improve.LONGEST_FUNCTION", 0)  # in a hurry
            made = program(found, functions, integrators, enforcements)
        self.program = replace(
            made,
            real=EXTENDED,
            kernels=tuple(precision._kernel(kernel, EXTENDED) for kernel in made.kernels),
        )
        self.nx = len(made.argument("x").names)
        self.p, self.u = (
            np.array(made.argument("p").defaults, np.longdouble),
            np.zeros(len(made.argument("u").names), np.longdouble),
        )
        self.integrators, self.enforcements = integrators, enforcements
        with tempfile.TemporaryDirectory(prefix="hamel-extended-") as folder:
            self.library = _library(self.program, Path(folder))

    def projected(self, x: np.ndarray) -> np.ndarray:
        """x on the constraints as exactly as long doubles can; as it is where there is nothing to
        project on."""
        if "project" not in [kernel.name for kernel in self.program.kernels]:
            return x.astype(np.longdouble)
        call, out = (
            getattr(self.library, f"{self.program.name}_project"),
            np.empty(self.nx, np.longdouble),
        )
        given = [
            value.ctypes.data_as(ctypes.c_void_p)
            for value in (x.astype(np.longdouble), self.u, self.p, out)
        ]
        assert call(ctypes.c_longdouble(0.0), *given) == 0
        return out

    def rows(
        self, times: np.ndarray, x: np.ndarray, integrator: str, enforcement: str, step: float
    ) -> np.ndarray:
        """The states at the times by equal steps, one per row."""
        s = np.zeros(1, self.layout)
        out, work = (np.zeros(n, np.longdouble) for n in (times.size * self.nx, times.size))
        s["integrator"] = self.integrators.index(integrator)
        s["enforcement"] = self.enforcements.index(enforcement)
        s["step_size"] = step
        s["x"][0, : self.nx] = x
        at = [
            value.ctypes.data_as(ctypes.c_void_p)
            for value in (times.astype(np.longdouble), self.u, self.p, s, out, work)
        ]
        tolerances = ctypes.c_longdouble(1e-2), ctypes.c_longdouble(1e-4)
        turns = [None] * bool(self.program.turning)
        call = getattr(self.library, f"{self.program.name}_simulate")
        status = call(
            at[3],
            ctypes.c_size_t(times.size),
            *at[:3],
            *tolerances,
            ctypes.c_long(10**8),
            *at[4:],
            *turns,
        )
        assert status == 0
        return out.reshape(times.size, self.nx)

    @property
    def layout(self) -> np.dtype:
        """The structure of a simulation, in long doubles."""
        kinds = {"int": "i", "long": "l", "double": np.longdouble}
        kinds |= {f"{self.program.name}_{name}": np.uintp for name in ("inputs", "watch")}
        fields = [
            (name, kinds[kind], size or ()) for kind, name, size, _ in simulate.fields(self.program)
        ]
        return np.dtype(fields, align=True)


def _in_two_parts(value: Fraction, number: Callable[[Fraction], str] = schemes.number) -> str:
    """A coefficient that is longer than a double as the sum of two."""
    text = number(value)
    return (
        text
        if "/" in text or value.denominator == 1
        else f"({text} + {float(value - Fraction(float(value)))!r})"
    )


def _library(made: Program, folder: Path) -> ctypes.CDLL:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(schemes, "number", _in_two_parts)
        files = emit(made)
    for name, text in files.items():
        if name.endswith((".c", ".h")):
            (folder / name).write_text(text.replace(POLYNOMIALS, "#if 0\n    typedef"))
    command = compiler.find_compiler()
    assert command is not None
    sources = [f"{made.name}.c", f"{made.name}_simulate.c"]
    parts = sorted(file.name for file in folder.glob(f"{made.name}_*.c"))
    sources += [
        name
        for name in parts
        if name.split("_")[-1] not in ("module.c", "batch.c", "cpu.c", "simulate.c")
    ]
    subprocess.run(
        [
            *command,
            "-std=c99",
            "-O1",
            "-fPIC",
            *compiler.shared(),
            *sources,
            "-lm",
            "-o",
            "made.so",
        ],
        cwd=folder,
        check=True,
    )
    return ctypes.CDLL(str(folder / "made.so"))
