"""Lines end where they may: long fractions, and lists in the text of TeX articles.

Of derive.textbook.formulas: typeset.
Of derive.textbook.writing: latex.
"""

import re
from fractions import Fraction

import pytest
import sympy

from derive.formulations import equations
from derive.model import load, load_text
from derive.states import system
from derive.textbook import html
from derive.textbook.choice import power_of_ten
from derive.textbook.derivation import derivation
from derive.textbook.formulas.compose import number
from derive.textbook.formulas.layout import GAP, ROW, SYMBOL, rounded, wide_entries
from derive.textbook.formulas.measure import letters
from derive.textbook.formulas.typeset import ALONE, OPENING, PIECE, Typesetter, width
from derive.textbook.writing.latex import _breakable, article
from tests.scenes import MODELS

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
    """Before and behind, raised or not: a space alone would read as one of the name's own."""
    words = {
        A: r"\mathrm{steer\,torque}",
        B: r"\dot{\mathrm{steer}}",
        C: "c",
        D: r"m_{\mathrm{arm}}",
    }
    setter = Typesetter(words)
    assert setter.latex(A * B) == rf"{words[A]} \cdot {words[B]}"
    assert setter.latex(A * B**2) == rf"{words[A]} \cdot {words[B]}^{{2}}"
    assert setter.latex(2 * A**2 * C) == rf"2 \cdot {words[A]}^{{2}} \cdot c"
    assert setter.latex(A * (C + D)) == rf"{words[A]} \cdot \left(c + {words[D]}\right)"
    assert setter.latex(C * D * sympy.sin(C)) == rf"c \, {words[D]} \, \sin c"
    met = sympy.Piecewise((A, sympy.Le(C, D)), (0, True))
    assert setter.latex(met).startswith(rf"{words[A]} \cdot \left[")


def test_a_word_before_a_bracket_on_two_lines_has_its_sign() -> None:
    setter = Typesetter({**NAMES, A: r"\mathrm{steer\,torque}"})
    long = sympy.Add(*[sympy.sin(k * X) * B**k for k in range(2, 8)])
    assert setter.pieces(A * long)[0].startswith(rf"\mathrm{{steer\,torque}} \cdot {OPENING}")
    assert any(piece.startswith(r"\cdot") for piece in setter.pieces(C * A * long * (B + D)))


def test_eulers_number_is_no_parameter() -> None:
    assert Typesetter(NAMES).latex(A * sympy.exp(-X)) == r"a \, e^{-x}"
    setter = Typesetter({**NAMES, A: "e"})
    assert setter.latex(A * sympy.exp(-X)) == r"e \, \exp\left(-x\right)"


def test_lists_may_end_a_line_behind_a_comma() -> None:
    assert _breakable(r"x,\; y") == r"x,\; \allowbreak y"
    assert _breakable(r"\left(x,\,y\right)") == r"(x,\,\allowbreak y)"
    assert _breakable(r"\left(a + b\right)") == r"\left(a + b\right)"
    assert _breakable(r"M_{11}") == r"M_{11}"


def test_a_matrix_is_no_wider_than_a_phone_reads() -> None:
    widths = [[20, 20, 20], [4, 4, 4]]
    listed = wide_entries(widths)
    columns = [SYMBOL if (0, j) in listed else 20 for j in range(3)]
    assert listed and sum(columns) + 2 * GAP <= ROW


@pytest.mark.parametrize("name", ["four_bar", "rolling_disk"])
def test_letters_of_matrices_are_no_smaller_than_half_of_the_text(name: str) -> None:
    """At 390 pixels a display has room for about 25 letters of the size of the text."""
    page = html(equations(system(load(MODELS / f"{name}.yaml"))))
    matrices = re.findall(r'<math style="--w:(\d+)"[^>]*>(?:(?!</math>).)*<mtable', page)
    assert len(matrices) > 3 and max(map(int, matrices)) <= 50


def test_fractions_in_a_matrix_are_counted_as_small() -> None:
    fraction = r"\frac{a + b + c + d}{2}"
    assert letters(rf"\begin{{bmatrix}} {fraction} \end{{bmatrix}}") < letters(fraction) + 1


def test_a_number_alone_is_given_as_a_decimal_and_others_as_fractions() -> None:
    assert rounded(sympy.Rational(17, 4)) == sympy.Float("4.25", 15)
    assert rounded(sympy.Rational(1, 3)) == sympy.Rational(1, 3)
    assert rounded(A / 2) == A / 2
    assert [number(Fraction(*x), False) for x in ((4, 5), (5, 7))] == [
        sympy.Rational(4, 5),
        sympy.Rational(5, 7),
    ]
    assert number(Fraction(1, 100), False) == sympy.Float("0.01", 15)
    assert [power_of_ten(x) for x in (1e-6, 2.5e-7, 3.0)] == ["10^{-6}", r"2.5 \cdot 10^{-7}", "3"]


def test_a_condition_is_a_factor_in_brackets_that_the_page_explains() -> None:
    """Slopes of tables and of what has a kink hold conditions; two rows for each would not fit."""
    setter = Typesetter(NAMES)
    met = sympy.Piecewise((1, sympy.Le(A, B)), (0, True))
    assert setter.latex(C * met / D) == r"\frac{c \, \left[a \le b\right]}{d}"
    kink = sympy.Piecewise((A - B, sympy.Ge(A, B)), (0, True))
    assert setter.latex(-kink) == r"-\left(a - b\right) \, \left[a \ge b\right]"
    page = html(equations(system(load(MODELS / "gallery" / "cam.yaml"))))
    assert page.count("A condition in brackets is a factor") == 1 and "otherwise" not in page


def test_one_coordinate_has_a_rate_and_several_have_rates() -> None:
    page = article(derivation(equations(system(load(MODELS / "rolling_disk.yaml")))))
    assert "The rate of the coordinate $\\theta$ is:" in page


def test_lines_may_end_inside_long_products_of_named_velocities() -> None:
    """Names with indices above and below count: a phone shows no formula in tiny letters."""
    wx, wy, wz, lean, spin, r = sympy.symbols("wx wy wz lean spin r", real=True)
    base = {x: rf"\omega_{a}^{{\mathrm{{base}}}}" for x, a in ((wx, "x"), (wy, "y"), (wz, "z"))}
    angles = {lean: r"\mathrm{lean}", spin: r"\mathrm{spin}"}
    setter = Typesetter({r: "r", **base, **angles}, 1)
    c, s = sympy.cos, sympy.sin
    inner = wx * c(spin) - wy * c(lean) * s(lean) - 2 * wy * s(spin)
    term = (wx**2 * c(spin) - wz * inner) * c(spin) - wx * (wy * c(lean) * s(lean) * s(spin) + wx)
    pieces = setter.pieces(-r * (term / sympy.Abs(c(lean)) + (wx**2 + wz**2) * sympy.Abs(c(lean))))
    assert max(letters(piece) for piece in pieces) <= 26
    whole = "".join(pieces)
    assert whole.count("(") == whole.count(")")


def test_angles_that_are_shares_of_pi_print_as_such() -> None:
    text = """model: angles
plane: xy
parameters: {a: pi/10, b: 45 deg, c: -2*pi/3, d: 0.3, e: 3.14159 rad}
bodies: {r: {mass: 1 kg, com: [(1 m)*cos(a + b), (1 m)*cos(c + d + e)], inertia: 1}}
joints: {j: {type: revolute, parent: ground, child: r, coordinate: q}}
"""
    page = article(derivation(equations(system(load_text(text)))))
    for value in (r"$\pi/10$", r"$\pi/4$", r"$-2\,\pi/3$", "& 0.3 &", "& 3.14159 &"):
        assert value in page


def test_a_printed_page_has_margins_and_letters_of_its_own() -> None:
    """A bicycle prints on eleven pages; with the spaces of a screen it took eighteen."""
    page = html(equations(system(load(MODELS / "pendulum.yaml"))))
    printed = page[page.index("@media print") :]
    assert "@page { size: A4" in printed and "font-size: 9.5pt" in printed


DECIMALS = """
model: decimals
plane: xy
bodies: {b: {mass: 7 kg}}
joints: {B: {type: prismatic, parent: ground, child: b, axis: x, coordinate: q}}
loads: {k: {type: spring, joint: B, stiffness: 3.3333333333 N/m}}
"""


def test_a_box_has_its_explanations_below_it() -> None:
    text = article(derivation(equations(system(load_text(DECIMALS)))))
    boxes = re.findall(r"\\begin\{empheq\}.*?\\end\{empheq\}(.{21})", text, re.DOTALL)
    assert "\nwhere\n\\begin{align*}" in boxes
    assert not re.search(r"\\begin\{empheq\}(?:(?!\\end\{empheq\}).)*intertext", text, re.DOTALL)
