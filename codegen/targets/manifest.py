"""manifest.json: what is in the folder, for programs."""

from __future__ import annotations

import json

from codegen.program import Argument, Chart, Kernel, Program
from codegen.runtime.steps import METHODS
from codegen.targets.records import Target


def files(program: Program) -> dict[str, str]:
    """manifest.json without the hashes of the files, which the build adds when all of them are
    known."""
    return {"manifest.json": json.dumps(_manifest(program), indent=1, ensure_ascii=True) + "\n"}


def _manifest(program: Program) -> dict[str, object]:
    return {
        "generator": "hamel",
        "model": program.name,
        "description": program.description,
        "formulation": program.formulation,
        "choice": program.choice,
        "reason": program.reason,
        **({"real": program.real.name} if program.real.words else {}),  # without it: float64
        "pivots": list(program.pivots),
        "quasi_velocities": list(program.quasi_velocities),
        **({"charts": [_chart(chart) for chart in program.charts]} if program.charts else {}),
        "assumptions": list(program.assumptions),
        "constants": list(program.constants),
        "fixed": dict(program.fixed),
        "left_out": list(program.left_out),
        "program": program.fingerprint,
        "arguments": {argument.name: _argument(argument) for argument in program.arguments},
        "functions": {kernel.name: _function(kernel) for kernel in program.offered},
        **({"step_methods": list(METHODS)} if program.steppers else {}),
        "operations": {kernel.name: kernel.operations["total"] for kernel in program.kernels},
        "precomputed": {
            kernel.name: {
                "constants": h.precompute.size,
                "once": h.precompute.operations["total"],
                "then": h.rest.operations["total"],
            }
            for kernel in program.kernels
            if (h := kernel.hoisted)
        },
        "operations_by_kind": {kernel.name: dict(kernel.operations) for kernel in program.kernels},
        **({"rolled": dict(program.rolling)} if program.rolling else {}),
        "flags": list(program.flags),
        "tuned": dict(program.timings),
        "ledger": [[e.function, e.step, e.before, e.after] for e in program.ledger],
    }


def _chart(chart: Chart) -> dict[str, object]:
    """The functions of a chart are called NAME + `suffix` where they differ from those of the
    first."""
    return {
        "choice": chart.choice,
        "suffix": chart.suffix,
        "quasi_velocities": list(chart.quasi_velocities),
    }


def _argument(argument: Argument) -> dict[str, object]:
    described: dict[str, object] = {
        "labels": list(argument.labels),
        "names": list(argument.names),
        "units": list(argument.units),
    }
    return {**described, "defaults": list(argument.defaults)} if argument.name == "p" else described


def _function(kernel: Kernel) -> dict[str, object]:
    return {
        "about": kernel.about,
        "arguments": list(kernel.uses),
        "x": list(kernel.x.labels),
        "result": kernel.result,
        "shape": list(kernel.shape),
        "labels": list(kernel.labels),
        "units": list(kernel.units),
        "pattern": kernel.pattern
        and {
            "shape": kernel.pattern.shape,
            "rows": kernel.pattern.rows,
            "columns": kernel.pattern.columns,
        },
        "guards": [{"name": guard.name, "limit": guard.limit} for guard in kernel.guards],
        "iteration": {"tolerance": kernel.loop.tolerance, "most": kernel.loop.most}
        if kernel.loop
        else None,
    }


MANIFEST = Target("manifest", "manifest.json", files)
