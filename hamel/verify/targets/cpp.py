"""The C++ target, by C++ compilers: the header in every standard without a warning, and a program
that calls every function through it, against the module."""

from __future__ import annotations

import itertools
import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from codegen.compiler import shared_library
from derive.diagnostics import ToolchainError
from hamel.verify.records import CheckResult
from hamel.verify.targets.records import Subject, TargetCheck, result

COMPILERS = ("g++", "clang++")
STANDARDS = ("c++11", "c++14", "c++17", "c++20")
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
HEAD = """#include "{name}.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace m = hamel::{name};

static double number()
{{
    double value = 0.0;
    if (std::scanf("%lf", &value) != 1)
        std::abort();
    return value;
}}

template <std::size_t N> static void read(std::array<m::Real, N> &values)
{{
    for (std::size_t i = 0; i < N; i++)
        values[i] = static_cast<m::Real>(number());
}}

int main()
{{
    m::Inputs u;
    m::Parameters p;
"""
CALL = """    for (int k = 0; k < {count}; k++) {{
        std::array<m::Real, {length}> x;
        std::array<m::Real, {size}> out;
        const m::Real t = static_cast<m::Real>(number());
        read(x);
        read(u);
        read(p);
        if (m::{function}(t, x, u, p, out) != m::Status::ok)
            out.fill(static_cast<m::Real>(std::nan("")));
        for (std::size_t i = 0; i < {size}; i++)
            std::printf("%.17g\\n", static_cast<double>(out[i]));
    }}
"""


def check(subject: Subject) -> tuple[CheckResult, ...]:
    """Compiled strictly by every compiler that is there; run by the first of them."""
    compilers = [name for name in COMPILERS if shutil.which(name)]
    if not compilers:
        raise ToolchainError("no C++ compiler (g++ or clang++)", "apt install g++")
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "main.cpp"
        source.write_text(_program(subject), encoding="utf-8")
        refused = [
            f"{compiler} -std={standard}"
            for compiler in compilers
            for standard in STANDARDS
            if not _compiles(subject, source, compiler, standard)
        ]
        about = f"by {' and '.join(compilers)}; refused: {', '.join(refused) or 'never'}"
        warnings = CheckResult("no warnings", len(refused), 0.0, not refused, about)
        if refused:
            return (warnings,)
        errors = _errors(subject, _values(subject, source, compilers[0]))
    return warnings, result(subject, "values", errors, "every function through the header")


def _program(subject: Subject) -> str:
    """Reads the arguments of every row, prints the results."""
    calls = (
        CALL.format(
            function=name,
            count=len(subject.sizes(name)),
            length=len(subject.row(name, 0)[1]),
            size=_expected(subject, name, 0).size,
        )
        for name in _functions(subject)
    )
    return "".join([HEAD.format(name=subject.name), *calls, "    return 0;\n}\n"])


def _functions(subject: Subject) -> list[str]:
    return [name for name in subject.rows if subject.sizes(name)]


def _expected(subject: Subject, name: str, k: int) -> np.ndarray:
    return np.asarray(getattr(subject.module, name)(*subject.row(name, k)))


def _compiles(subject: Subject, source: Path, compiler: str, standard: str) -> bool:
    command = [compiler, f"-std={standard}", *STRICT, f"-I{subject.folder}", "-fsyntax-only"]
    return subprocess.run([*command, source], check=False, capture_output=True).returncode == 0


def _values(subject: Subject, source: Path, compiler: str) -> Sequence[float]:
    """What the program prints; nothing where it does not come to its end."""
    library, program = subject.folder / shared_library(subject.name), source.with_suffix("")
    if not library.is_file():
        raise ToolchainError(f"{library.name} is not there", "build it without --numpy")
    command = [compiler, "-O1", f"-I{subject.folder}", source, library, "-lm", "-o", program]
    given = (np.hstack(subject.row(n, k)) for n in _functions(subject) for k in _places(subject, n))
    numbers = " ".join(f"{value:.17g}" for row in given for value in row)
    try:
        subprocess.run([*command, f"-Wl,-rpath,{subject.folder}"], check=True, capture_output=True)
        done = subprocess.run([program], input=numbers, check=True, capture_output=True, text=True)
    except (subprocess.CalledProcessError, OSError):
        return ()
    return [float(line) for line in done.stdout.split()]


def _places(subject: Subject, name: str) -> range:
    return range(len(subject.sizes(name)))


def _errors(subject: Subject, values: Sequence[float]) -> list[float]:
    """Of every function; as many values as they all have must have been printed."""
    names = _functions(subject)
    count = sum(_expected(subject, n, 0).size * len(_places(subject, n)) for n in names)
    if len(values) != count:
        return [math.inf]
    rest = iter(values)
    return [subject.error(name, _following(subject, name, rest)) for name in names]


def _following(
    subject: Subject, name: str, values: Iterator[float]
) -> Callable[..., Sequence[float]]:
    """Gives one result of the function after the other, whatever it is called with."""
    size = _expected(subject, name, 0).size
    return lambda *given: list(itertools.islice(values, size))


CPP = TargetCheck("cpp", "C++ compilers", check)
