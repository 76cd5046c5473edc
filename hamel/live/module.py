"""Equations → WebAssembly, in memory: the loader's text and the bytes it loads."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Collection
from dataclasses import dataclass, replace

from codegen.emit import emit
from codegen.runtime.build_wasm import INSTALL, find_compiler
from codegen.targets.wasm import FOLDER, WASM
from derive.diagnostics import ToolchainError
from derive.formulations.records import Equations
from hamel.build.scratch import workspace
from hamel.build.stages import program_of

SCRIPT = "build_wasm.py"


@dataclass(frozen=True)
class Module:
    """An ES module without its file, and the WebAssembly that it loads."""

    loader: str
    binary: bytes


def check_compiler() -> None:
    """Raises ToolchainError where nothing compiles for WebAssembly."""
    if find_compiler() is None:
        raise ToolchainError(
            "a live page needs a compiler for WebAssembly, and there is none", hint=INSTALL
        )


def module_of(
    equations: Equations, functions: Collection[str], integrator: str, enforcement: str
) -> Module:
    """Compiled. Raises ToolchainError where the compiler fails."""
    program = program_of(equations, functions, (integrator,), (enforcement,))
    program = replace(program, targets=(WASM.name,))
    with workspace() as folder:
        for name, text in emit(program).items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, "utf-8")
        done = subprocess.run(
            [sys.executable, SCRIPT], cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise ToolchainError(f"the live page was not compiled: {done.stderr.strip()[-2000:]}")
        at = folder / FOLDER / program.name
        loader = at.with_suffix(".mjs").read_text("utf-8")
        return Module(loader, at.with_suffix(".wasm").read_bytes())
