"""Text for generated files: expressions, numbers, escaping, wrapping, templates."""

from __future__ import annotations

import functools
import json
import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import jinja2

from codegen.program import Expression, Program
from codegen.reals import Real, recast
from derive import templates

TEMPLATES = Path(__file__).parent / "templates"
_SYMBOL = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
_LEVEL = {"add": 1, "sub": 1, "mul": 2, "div": 2, "neg": 3}
_ATOM = 4


@dataclass(frozen=True)
class Language:
    """How a language writes calls (format strings by operation; `{0}({1})` else), infinity and
    not-a-number."""

    calls: dict[str, str]
    infinity: str
    nan: str


C = Language(
    {
        "lt": "(double)({0} < {1})", "le": "(double)({0} <= {1})", "eq": "(double)({0} == {1})",
        "ne": "(double)({0} != {1})",
        "and": "(double)({0} != 0 && {1} != 0)", "or": "(double)({0} != 0 || {1} != 0)",
        "not": "(double)({0} == 0)",
        "where": "({0} != 0 ? {1} : 0.0)", "sign": "(double)(({0} > 0) - ({0} < 0))",
    },
    "INFINITY",
    "NAN",
)  # fmt: skip
# In loops over lanes: fmin, fmax and others of C are calls there, and where the result of a
# comparison is an integer that more is done with, gcc takes half as many lanes, or one.
_ANEW = (
    "exp",
    "expm1",
    "log",
    "log1p",
    "tanh",
    "sinh",
    "cosh",
    "atan",
    "asin",
    "acos",
    "atan2",
    "pow",
)
IN_LANES = ("SMALLER", "LARGER", *(name.upper() for name in _ANEW))  # functions of its own
LANES = replace(
    C,
    calls={
        **C.calls,
        **{name: f"{name.upper()}({{0}})" for name in _ANEW[:-2]},
        "atan2": "ATAN2({0}, {1})", "pow": "POW({0}, {1})",
        "fmin": "SMALLER({0}, {1})", "fmax": "LARGER({0}, {1})",
        "sign": "(({0} > 0 ? 1.0 : 0.0) - ({0} < 0 ? 1.0 : 0.0))",
        "and": "(({0} != 0 ? 1.0 : 0.0) * ({1} != 0 ? 1.0 : 0.0))",
        "or": "({0} != 0 ? 1.0 : {1} != 0 ? 1.0 : 0.0)",
    },
)  # fmt: skip
NUMPY = Language(
    {
        **{name: f"np.{name}({{0}})" for name in
           ("sqrt", "sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "expm1", "log1p",
            "floor", "ceil", "fabs", "sign")},
        **{name: f"np.{full}({{0}})" for name, full in
           {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh",
            "acosh": "arccosh", "atanh": "arctanh"}.items()},
        **{name: f"np.{full}({{0}}, {{1}})" for name, full in
           {"pow": "float_power", "atan2": "arctan2", "hypot": "hypot",
            "fmin": "fmin", "fmax": "fmax", "copysign": "copysign", "fmod": "fmod"}.items()},
        "lt": "np.where({0} < {1}, 1.0, 0.0)", "le": "np.where({0} <= {1}, 1.0, 0.0)",
        "eq": "np.where({0} == {1}, 1.0, 0.0)",
        "ne": "np.where({0} != {1}, 1.0, 0.0)",
        "and": "np.where(({0} != 0) & ({1} != 0), 1.0, 0.0)",
        "or": "np.where(({0} != 0) | ({1} != 0), 1.0, 0.0)", "not": "np.where({0} == 0, 1.0, 0.0)",
        "where": "np.where({0} != 0, {1}, 0.0)", "erf": "_erf({0})",
    },
    "np.inf",
    "np.nan",
)  # fmt: skip


def numpy(real: Real) -> Language:
    """NumPy in that precision: what makes float64 of everything is called otherwise in the
    others."""
    if not real.words:
        return NUMPY
    truths = {
        name: f"{NUMPY.calls[name]}.astype({real.python})"
        for name in ("lt", "le", "eq", "ne", "and", "or", "not")
    }
    return replace(NUMPY, calls={**NUMPY.calls, **truths, "pow": "np.power({0}, {1})"})


def number(value: float, language: Language = C) -> str:
    """The shortest text that reads back as the same double."""
    if math.isnan(value):
        return language.nan
    if math.isinf(value):
        return language.infinity if value > 0 else f"-{language.infinity}"
    return repr(float(value))


def expression(value: Expression, language: Language) -> str:
    """The expression as text, with parentheses where the order of evaluation needs them and nowhere
    else."""
    return _print(value, language)[0]


def _print(value: Any, language: Language) -> tuple[str, int]:
    """Text and binding level."""
    if isinstance(value, str):
        return value, _ATOM
    if isinstance(value, float):
        return number(value, language), _ATOM if value >= 0 or value != value else 3
    operation, *operands = value
    if operation in _SYMBOL:
        return _binary(operation, *(_print(operand, language) for operand in operands))
    if operation == "neg":
        return f"-{_bracket(*_print(operands[0], language), _ATOM)}", 3
    form = language.calls.get(operation)
    texts = [
        _bracket(*_print(operand, language), _ATOM if operation in _INFIX else 0)
        for operand in operands
    ]
    return form.format(*texts) if form else f"{operation}({', '.join(texts)})", _ATOM


_INFIX = frozenset({"sign", "lt", "le", "eq", "ne", "and", "or", "not", "where"})


def _binary(operation: str, left: tuple[str, int], right: tuple[str, int]) -> tuple[str, int]:
    """a + (b + c) is printed (b + c) + a without the parentheses: the same rounding, easier to
    read."""
    level = _LEVEL[operation]
    if operation in ("add", "mul") and right[1] == level and left[1] != level:
        left, right = right, left
    return f"{_bracket(*left, level)} {_SYMBOL[operation]} {_bracket(*right, level + 1)}", level


def _bracket(text: str, level: int, least: int) -> str:
    return text if level >= least else f"({text})"


def printable(text: str) -> str:
    """One line of printable text: control characters and line ends become spaces."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def comment(text: str) -> str:
    """Text that is safe inside a C comment, in C89 and with trigraphs too."""
    safe = (
        printable(text)
        .replace("*/", "* /")
        .replace("/*", "/ *")
        .replace("??", "? ?")
        .replace("\\", "/")
    )
    return safe.replace("*/", "* /").replace("/*", "/ *")


def c_string(text: str) -> str:
    """A C string literal, quotes included; anything but plain ASCII as octal escapes of its UTF-8
    bytes."""
    plain = {byte: chr(byte) for byte in range(32, 127) if chr(byte) not in '"\\?'}
    return (
        '"'
        + "".join(
            plain.get(byte, f"\\{byte:03o}") for byte in printable(text).encode("utf-8", "replace")
        )
        + '"'
    )


def python_string(text: str) -> str:
    """A Python string literal in ASCII."""
    return json.dumps(printable(text))


def matlab_string(text: str) -> str:
    """A string literal of MATLAB and Octave."""
    quoted = printable(text).replace("'", "''")
    return f"'{quoted}'"


def python_doc(text: str) -> str:
    """Text that is safe inside a triple-quoted Python string."""
    return printable(text).replace("\\", "\\\\").replace('"', "'")


def xml(text: str) -> str:
    """Text that is safe as an attribute of XML, between double quotes."""
    return escape(printable(text), {'"': "&quot;"})


def wrapped(text: str, width: int = 110, indent: str = "") -> str:
    """Lines of at most `width` characters, all but the first indented."""
    return ("\n" + indent).join(
        textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False)
    ) or ""


ENTRIES = 12  # that a message names


def entries(names: Sequence[str]) -> str:
    """What the entries of an array are called, behind a message about it; not all of many."""
    said = ", ".join(names[:ENTRIES]) + (", …" if len(names) > ENTRIES else "")
    return f": {said}" if said else ""


@functools.cache
def _environment() -> jinja2.Environment:
    environment = templates.environment(
        jinja2.FileSystemLoader(TEMPLATES),
        TEMPLATES,
        keep_trailing_newline=True,
        # constants are few, and looking for them takes longer than to evaluate them
        optimized=False,
        # what goes in is escaped by the filters below, each for the language at hand
        autoescape=False,
    )
    filters: dict[str, Callable[..., str]] = {
        "comment": comment, "c_string": c_string, "py": python_string,
        "matlab": matlab_string, "doc": python_doc,
        "number": number, "xml": xml,
        "py_number": functools.partial(number, language=NUMPY), "wrapped": wrapped,
        "entries": entries,
    }  # fmt: skip
    environment.filters.update(filters)  # pyright: ignore[reportUnknownMemberType]  # jinja2 leaves them open
    return environment


def render(template: str, program: Program, **data: object) -> str:
    """A template of codegen/templates with data; C comes out in the program's precision."""
    result = _environment().get_template(template).render(program=program, **data)
    return recast(result, program.real) if template.endswith((".c.j2", ".h.j2")) else result
