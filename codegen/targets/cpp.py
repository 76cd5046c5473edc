"""C++: a header over the C, with std::array and, where Eigen is there, its matrices."""

from __future__ import annotations

from typing import Any

from codegen import text
from codegen.program import Program
from codegen.targets.records import Target

KEYWORDS = """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t
    char32_t class compl concept const consteval constexpr constinit const_cast continue co_await
    co_return co_yield decltype default delete do double dynamic_cast else enum explicit export
    extern false float for friend goto if inline int long mutable namespace new noexcept not not_eq
    nullptr operator or or_eq private protected public register reinterpret_cast requires return
    short signed sizeof static static_assert static_cast struct switch template this thread_local
    throw true try typedef typeid typename union unsigned using virtual void volatile wchar_t while
    xor xor_eq
"""
# macros of compilers and of the headers that are included, and namespaces that are used
TAKEN = "linux unix NULL EOF NAN INFINITY errno std Eigen"


def files(program: Program) -> dict[str, str]:
    """NAME.hpp."""
    data: dict[str, Any] = {"prefix": program.name, "PREFIX": program.name.upper()}
    return {f"{program.name}.hpp": text.render("cpp.hpp.j2", program, **data)}


def refusal(program: Program) -> str:
    """The model's name is that of a namespace."""
    if program.name in KEYWORDS.split():
        return f"'{program.name}' is a keyword of C++; give the model another name"
    if program.name in TAKEN.split():
        return f"'{program.name}' means something else in C++; give the model another name"
    return ""


CPP = Target(
    "cpp", "C++11 header over the C, for std::array and Eigen", files, (), refusal, "cpp.md.j2"
)
