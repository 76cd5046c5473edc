"""WebAssembly: the functions and `simulate` as a module for browsers and Node, without a runtime
behind it: NAME.wasm, a variant with SIMD, an ES module that loads the better one, and its types."""

from __future__ import annotations

from pathlib import Path

import codegen.runtime.build_wasm
from codegen import text
from codegen.program import Program
from codegen.targets.records import Target
from codegen.targets.simulate import run_data

FOLDER = "wasm"
# names of the ES module and of what it gives, and words that no function of JavaScript can have
TAKEN = """
    await break case catch class const continue debugger default delete do else enum export extends
    false finally for function if implements import in instanceof interface let new null package
    private protected public return static super switch this throw true try typeof var void while
    with yield constructor prototype simulate raw exports
"""


def files(program: Program) -> dict[str, str]:
    """wasm/NAME_wasm.c, NAME.mjs, NAME.d.mts and the script that compiles."""
    data = run_data(program)
    script = Path(codegen.runtime.build_wasm.__file__).read_text("utf-8")
    at = f"{FOLDER}/{program.name}"
    return {
        f"{at}_wasm.c": text.render("wasm.c.j2", program, **data),
        f"{at}.mjs": text.render("wasm.mjs.j2", program, **data),
        f"{at}.d.mts": text.render("wasm.d.mts.j2", program, **data),
        "build_wasm.py": script.replace('NAME = ""', f'NAME = "{program.name}"', 1),
    }


def refusal(program: Program) -> str:
    """A function whose name JavaScript has other use for."""
    odd = [kernel.name for kernel in program.kernels if kernel.name in TAKEN.split()]
    return f"'{odd[0]}' means something else in JavaScript" if odd else ""


WASM = Target(
    "wasm",
    "WebAssembly for browsers and Node: NAME.wasm, an ES module, its types",
    files,
    refusal=refusal,
    readme="wasm.md.j2",
)
