"""MATLAB and Octave: a class of static functions with help texts, over one MEX file that is
compiled where it is used."""

from __future__ import annotations

from codegen import compiler, text
from codegen.program import Program
from codegen.targets.records import Target
from codegen.targets.simulate import run_data

FOLDER = "matlab"
LONGEST = 63 - len("_mex")  # characters of a name
KEYWORDS = """
    arguments break case catch classdef continue do else elseif end end_try_catch
    end_unwind_protect endclassdef endenumeration endevents endfor endfunction endif endmethods
    endparfor endproperties endswitch endwhile enumeration events for function global if methods
    otherwise parfor persistent properties return spmd switch try until unwind_protect
    unwind_protect_cleanup while
"""
# functions that NAME.m calls, which a class of that name would hide
CALLED = """
    addpath ans build cd defaults delete disp double error eps exist fileparts fullfile i inf
    isempty isfield j mex mfilename mkoctfile nan numel onCleanup permute pi rehash reshape simulate
    size strcmp struct zeros
"""


def files(program: Program) -> dict[str, str]:
    """matlab/NAME.m and matlab/NAME_mex.c."""
    data = {**run_data(program), "example": compiler.example(program.name)}
    return {
        f"{FOLDER}/{program.name}.m": text.render("matlab.m.j2", program, **data),
        f"{FOLDER}/{program.name}_mex.c": text.render("mex.c.j2", program, **data),
    }


def refusal(program: Program) -> str:
    """Names that are no identifiers there, and numbers that are no doubles."""
    if program.real.words:
        return f"its MEX file computes in float64, not in {program.real.name}"
    names = (program.name, *(kernel.name for kernel in program.kernels))
    for name in names:
        reason = _odd(name, program.name)
        if reason:
            return reason
    return ""


def _odd(name: str, model: str) -> str:
    """Why this is no name there."""
    if not (name[0].isalpha() and name.isascii()):
        return f"'{name}' is no identifier of MATLAB, which begins with a letter of ASCII"
    if len(name) > LONGEST:
        return f"'{name}' has {len(name)} characters; MATLAB takes {LONGEST} and _mex"
    words = KEYWORDS.split() if name != "events" else ()
    if name in words or (name == model and name in (*KEYWORDS.split(), *CALLED.split())):
        return f"'{name}' means something else in MATLAB"
    return ""


MATLAB = Target(
    "matlab",
    "MATLAB and Octave: a class with help texts over a MEX file",
    files,
    refusal=refusal,
    readme="matlab.md.j2",
)
