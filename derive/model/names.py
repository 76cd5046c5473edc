"""Which names a model may use: they become C identifiers, Python arguments and file names."""

from __future__ import annotations

import keyword
import re
import sys
import unicodedata

from derive.expressions.functions import FUNCTIONS, OUTPUT_FUNCTIONS

LONGEST = 60
# of LaTeX that `symbol:` takes; no other gets into a page
COMMANDS = (
    "alpha beta gamma delta epsilon varepsilon zeta eta theta vartheta iota kappa lambda mu nu xi "
    "pi rho sigma tau upsilon phi varphi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma "
    "Upsilon Phi Psi Omega hat bar tilde mathrm mathbf ell"
)
_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_C = _words(
    """alignas alignof auto bool break case char const constexpr continue default do double else
    enum extern false float for goto
    if inline int long nullptr register restrict return short signed sizeof static static_assert
    struct switch thread_local true
    typedef typeof typeof_unqual union unsigned void volatile while asm fortran"""
)
_CPP = _words(
    """and and_eq bitand bitor catch char8_t char16_t char32_t class co_await co_return co_yield
    compl concept const_cast
    consteval constinit decltype delete dynamic_cast explicit export friend mutable namespace new
    noexcept not not_eq
    operator or or_eq private protected public reinterpret_cast requires static_cast template this
    throw try typeid
    typename using virtual wchar_t xor xor_eq"""
)
# macros that gcc or the headers of generated code define
_MACROS = _words(
    "NULL EOF NAN INFINITY HUGE_VAL errno assert linux unix main offsetof signbit isnan isinf "
    "isfinite"
)
# of POSIX: the generated header has NAME_OK for the model's own name
_ENDING_IN_OK = _words("r w x f")
LANGUAGE = frozenset({"t", "pi", "der", "ground", "guess", *FUNCTIONS, *OUTPUT_FUNCTIONS})
_MODULES = (
    frozenset({"numpy", "hamel", "derive", "codegen", "casadi", "sympy", "jax", "numba"})
    | sys.stdlib_module_names
)


def identifier(name: str) -> str:
    """The name as C and Python can have it: what is no letter or digit becomes an underscore."""
    return re.sub(r"[^A-Za-z0-9]", "_", name)


def cut(text: str) -> str:
    """What a message quotes of a text that may be too long."""
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"


def _spelled(name: str) -> str:
    """How a name that is one Greek letter may be written."""
    about = unicodedata.name(name, "") if len(name) == 1 else ""
    letter = re.match(r"GREEK (SMALL|CAPITAL) LETTER (\w+)\Z", about)
    if letter is None:
        return ""
    word = letter[2].lower().replace("lamda", "lambda")
    if letter[1] == "CAPITAL":
        word = word.capitalize()
    plain = word if objection(word) is None else f"{word}1"
    shown = f" with `symbol: \\{word}` is shown as {name}" if word in COMMANDS.split() else ""
    return f"; {plain}{shown}"


def objection(name: str) -> tuple[str, str] | None:
    """Why a name cannot be used and what was expected, or None."""
    if re.match(r"[0-9]+ *[a-zA-Z/*^]*\Z", name):
        return (
            f"{cut(name)!r} is not a name",
            "a letter first; a number has a decimal point: 2.5 kg",
        )
    if not _WORD.match(name) or len(name) > LONGEST:
        return (
            f"{cut(name)!r} is not a name",
            f"a letter, then letters, digits and underscores, at most {LONGEST}{_spelled(name)}",
        )
    if "__" in name or name.endswith("_"):
        return (
            f"'{name}' is not a name",
            "no double and no trailing underscore: generated names use them",
        )
    if name in LANGUAGE:
        return f"'{name}' is a word of the model language", "another name"
    if keyword.iskeyword(name):
        return (
            f"'{name}' is a keyword of Python",
            "another name: it becomes a name in the generated module",
        )
    if name in _C or name in _CPP:
        return (
            f"'{name}' is a keyword of {'C' if name in _C else 'C++'}",
            "another name: it becomes a name in the generated module",
        )
    if name in _MACROS:
        return (
            f"'{name}' is defined by C headers",
            "another name: it becomes a name in the generated module",
        )
    return None


def module_objection(name: str) -> tuple[str, str] | None:
    """The same for the model's own name, which becomes the name of a Python module."""
    if name in _MODULES:
        return (
            f"'{name}' is the name of a Python module",
            "another name: the generated module carries it",
        )
    if name.lower() in _ENDING_IN_OK:
        return (
            f"the module of '{name}' would define {name.upper()}_OK, as C headers do",
            "a longer name",
        )
    return objection(name)
