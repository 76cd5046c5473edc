"""Lines end where they may: long fractions, and lists in the text of TeX articles.

Of derive.textbook: typeset, write_latex.
"""

import sympy

from derive.textbook.layout import ROW, SYMBOL, wide_entries
from derive.textbook.typeset import ALONE, PIECE, Typesetter, width
from derive.textbook.write_latex import _breakable

A, B, C, D, X = sympy.symbols("a b c d x")
NAMES = {s: str(s) for s in (A, B, C, D, X)}


def test_a_long_sum_over_a_divisor_is_broken_between_its_terms() -> None:
    terms = sum(sympy.sin(k * X) * A**k for k in range(2, 8))
    product = A * (terms + B) * (terms - C) / sympy.cos(D)
    setter = Typesetter(NAMES)
    pieces = setter.pieces(product)
    assert len(pieces) > 4 and pieces[0] == r"\frac{a}{\cos d}"
    assert max(map(width, pieces)) <= PIECE


def test_a_short_fraction_and_one_without_sums_stay_whole() -> None:
    setter = Typesetter(NAMES)
    for whole in (A * sympy.sin(B) / C, A * sympy.sin(B) * sympy.cos(C) / sympy.Abs(sympy.cos(X))):
        assert len(setter.pieces(whole, line=5)) == 1


def test_no_line_ends_after_a_number_before_a_bracket() -> None:
    setter = Typesetter(NAMES)
    long = sympy.sin(A * X) * B + sympy.cos(A * X) * C + sympy.sin(D * X)
    pieces = setter.pieces(long * sympy.sin(A + B) * 3)
    assert len(pieces) > 2 and pieces[0].startswith("3")
    assert all(width(piece) > ALONE for piece in pieces)


def test_words_that_are_multiplied_have_a_sign_between_them() -> None:
    words = {A: r"\mathrm{steer\,torque}", B: r"\dot{\mathrm{steer}}", C: "c"}
    setter = Typesetter(words)
    assert setter.latex(A * B) == rf"{words[A]} \cdot {words[B]}"
    assert setter.latex(A * C) == rf"{words[A]} \, c"


def test_lists_may_end_a_line_behind_a_comma() -> None:
    assert _breakable(r"x,\; y") == r"x,\; \allowbreak y"
    assert _breakable(r"\left(x,\,y\right)") == r"(x,\,\allowbreak y)"
    assert _breakable(r"\left(a + b\right)") == r"\left(a + b\right)"
    assert _breakable(r"M_{11}") == r"M_{11}"


def test_a_matrix_is_no_wider_than_a_phone_reads() -> None:
    widths = [[20, 20, 20], [4, 4, 4]]
    listed = wide_entries(widths)
    columns = [SYMBOL if (0, j) in listed else 20 for j in range(3)]
    assert listed and sum(columns) <= ROW
