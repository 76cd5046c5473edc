"""The formula parser and the evaluation of its trees.

Of derive.expressions: quantities, scalars, tokens.
"""

import math
import pickle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from derive.diagnostics import ModelError
from derive.expressions import tree
from derive.expressions.evaluate import (
    casadi_functions,
    float_functions,
    is_constant,
    number,
    value,
)
from derive.expressions.functions import FUNCTIONS
from derive.expressions.linearity import (
    NONLINEAR,
    Degree,
    degree,
)
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.quantities import plain_number, quantity
from derive.expressions.tree import Name, Negative, Number, Power, Product, Quotient, Rate, Sum

NAMES = {"a": 1.7, "b": -0.6, "c": 2.3, "x": 0.4}
x, y, a = Name("x"), Name("y"), Name("a")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x + y - 2", Sum((x, y, Number(-2.0)))),
        ("x - (y - a)", Sum((x, Negative(Sum((y, Negative(a))))))),
        ("-x^2", Negative(Power(x, Number(2.0)))),
        ("-2^2", Number(-4.0)),
        ("2^-1", Power(Number(2.0), Number(-1.0))),
        ("x^y^2", Power(x, Power(y, Number(2.0)))),
        ("x**y**2", Power(x, Power(y, Number(2.0)))),
        ("-x*y", Negative(Product((x, y)))),
        ("x*-y", Product((x, Negative(y)))),
        ("x/y/a", Quotient(Quotient(x, y), a)),
        ("x/y*a", Product((Quotient(x, y), a))),
        ("--x", x),
        ("+x", x),
        ("der(x)", Rate("x")),
        ("der ( x )", Rate("x")),
        ("base.vx", Name("base.vx")),
        ("pi", Number(math.pi)),
        (".5e1", Number(5.0)),
        ("atan2(x, y)", tree.Call("atan2", (x, y))),
        ("30 deg", Number(math.pi / 6, "rad")),
        ("2 kN/mm^2", Number(2e9, "N/m^2")),
        ("9.81 m/s^2*x", Product((Number(9.81, "m/s^2"), x))),
        ("0.01 N*m*s/rad", Number(0.01, "N*m*s/rad")),
        ("2 m*x", Product((Number(2.0, "m"), x))),
        ("3 rpm", Number(3 * (2 * math.pi / 60), "rad/s")),
    ],
)
def test_trees(text: str, expected: tree.Expression) -> None:
    if text == "-2^2":
        assert number(expression(text), {}) == -4.0
    else:
        assert expression(text) == expected


@pytest.mark.parametrize(
    "text",
    [
        "a + b*c",
        "a - b - c",
        "a/b/c",
        "a*b/c*x",
        "-a**2",
        "a**-b",
        "a**2**0.5",
        "(a + b)*(a - b)",
        "a - -b",
        "+a*-b",
        "2*a**3 - 4/c",
    ],
)
def test_precedence_is_that_of_python(text: str) -> None:
    assert number(expression(text), NAMES) == pytest.approx(eval(text, {}, NAMES), rel=1e-15)


ATOMS = st.sampled_from(["a", "b", "c", "x", "2", "0.5", "3.25"])
FORMULAS = st.recursive(
    ATOMS,
    lambda inner: (
        st.tuples(inner, st.sampled_from([" + ", " - ", "*", "/"]), inner).map("".join)
        | inner.map(lambda f: f"({f})")
        | inner.map(lambda f: f"-{f}")
        | inner.map(lambda f: f"({f})**2")
        | inner.map(lambda f: f"sin({f})")
    ),
    max_leaves=12,
)


@settings(max_examples=300, deadline=None)
@given(FORMULAS)
def test_random_formulas_agree_with_python(text: str) -> None:
    try:
        expected = eval(text, {"sin": math.sin}, NAMES)
    except ArithmeticError:
        return
    assert number(expression(text), NAMES) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@settings(max_examples=100, deadline=None)
@given(FORMULAS)
def test_casadi_agrees_with_floats(text: str) -> None:
    import casadi as ca

    symbols = {name: ca.SX.sym(name) for name in NAMES}
    try:
        formula = expression(text)
        expected = number(formula, NAMES)
    except FormulaError:
        return
    graph = ca.Function(
        "f", list(symbols.values()), [value(formula, symbols, {}, casadi_functions())]
    )
    assert float(graph(*NAMES.values())) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_every_function_means_the_same_everywhere() -> None:
    import casadi as ca

    for function in FUNCTIONS.values():
        numbers = [0.3, 0.7, 0.5][: function.arity[0]]
        words = [*numbers, 0.9] if function.name == "piecewise" else numbers
        formula = expression(f"{function.name}({', '.join(map(str, words))})")
        expected = number(formula, {})
        assert float(value(formula, {}, {}, casadi_functions())) == pytest.approx(
            expected, rel=1e-15
        )
        assert float(ca.DM(expected)) == expected


def test_sums_are_left_folds_without_a_leading_zero() -> None:
    class Recorder(str):
        def __add__(self, other: str) -> "Recorder":
            return Recorder(f"({self!s}+{other!s})")

    names = {name: Recorder(name) for name in "abc"}
    assert value(expression("a + b + c"), names, {}, {}) == "((a+b)+c)"


def test_integer_powers_and_roots_stay_what_they_are() -> None:
    import casadi as ca

    z = ca.SX.sym("z")
    found = value(expression("z**2 + z^0.5 + 0.25*z"), {"z": z}, {}, casadi_functions())
    assert str(found) == "((sq(z)+sqrt(z))+(0.25*z))"


def test_rates_have_their_own_table() -> None:
    assert value(expression("x*der(x)"), {"x": 3.0}, {"x": 5.0}, float_functions()) == 15.0


def test_vectors_only_where_they_are_wanted() -> None:
    assert expression("[x, y]", vectors=True) == tree.Vector((x, y))
    with pytest.raises(FormulaError, match="a list inside a formula"):
        expression("[x, y]")


@pytest.mark.parametrize(
    "text", ["0", "-0", "+3", "1.", "-0.25", "1e3", "-2.5E-7", "0.0e9", "123456789.125"]
)
def test_plain_numbers_are_read_at_once_as_any_formula(text: str) -> None:
    """In brackets they take the grammar's way."""
    plain, formula = plain_number(text), expression(f"({text})")
    assert plain == formula == expression(text) or plain is None
    assert isinstance(formula, Number) and math.copysign(1, formula.value) == math.copysign(
        1, float(text)
    )


@pytest.mark.parametrize(
    "text",
    ["", "+", "007", "1e999", "1e-400", "1e61", "1e-61", ".5", "1_0", "٣", "1 2", "0x1", "1e"],
)
def test_what_is_no_plain_number_takes_the_grammar(text: str) -> None:
    """Which says what is wrong with it."""
    assert plain_number(text) is None


def test_ten_thousand_terms() -> None:
    names = {f"x{i}": 1.0 for i in range(10_000)}
    for operator, expected in ((" + ", 10_000.0), ("*", 1.0)):
        assert number(expression(operator.join(names)), names) == expected


REFUSED = [
    ("", 0, "empty"),
    ("x +", 3, "ends too early"),
    ("x y", 2, "unexpected 'y'"),
    ("(x", 0, "never closed"),
    ("x)", 1, "unexpected ')'"),
    ("x,y", 1, "unexpected ','"),
    ("1e400", 0, "too large"),
    ("9" * 400, 0, "too large"),
    ("1e308 km", 0, "too large"),
    ("1e-400", 0, "too small"),
    ("9**9**9", 0, "not a finite number"),
    ("((9**64)**64)**64", 2, "too large"),
    ("1e60 km", 0, "too large"),
    ("1e-60 mm", 0, "too small"),
    ("1e59*1e59", 0, "too large"),
    ("exp(800)", 0, "not a finite number"),
    ("1/(1 - 1)", 3, "division by zero"),
    ("0**-1", 0, "not a finite number"),
    ("(-8)**(1/3)", 0, "not a finite number"),
    ("log(0)", 0, "not a finite number"),
    ("exp(1e3)", 0, "not a finite number"),
    ("(" * 61 + "x" + ")" * 61, 60, "nested too deeply"),
    ("-(" * 70 + "x" + ")" * 70, 121, "nested too deeply"),
    ("^".join("x" * 100), 121, "nested too deeply"),
    ("/".join("x" * 200), 0, "nested too deeply"),
    ("x" * 2_000_000, 0, "characters"),
    ("sin(x, y)", 0, "does not take 2 arguments"),
    ("max(x)", 0, "does not take 1 argument"),
    ("der(x + y)", 4, "der() takes the name"),
    ("der()", 4, "der() takes the name"),
    ("2 m^x", 4, "power of a unit"),
    ("2 m^0.55", 4, "power of a unit"),
    ("2 km^10", 5, "power of a unit"),
    ("1/2 kg", 2, "two ways"),
    ("x.y.", 3, "unexpected character '.'"),
    ("lambda: 1", 6, "unexpected character ':'"),
    ("x if y else a", 2, "unexpected 'if'"),
    ("x.__class__", None, ""),
    ("'x'", 0, "unexpected character"),
    ("x == y", 2, "unexpected character '='"),
    ("x // y", 3, "unexpected '/'"),
    ("x % y", 2, "unexpected character '%'"),
    ("x ^", 3, "ends too early"),
    ("٣", 0, "unexpected character"),
]


@pytest.mark.parametrize(
    ("text", "at", "message"), REFUSED, ids=[text[:12] for text, _, _ in REFUSED]
)
def test_refused(text: str, at: int | None, message: str) -> None:
    if at is None:  # a dotted name and nothing more: it resolves to nothing in any model
        assert expression(text) == Name(text)
        return
    with pytest.raises(FormulaError) as caught:
        expression(text)
    assert message in caught.value.detail[0]
    assert caught.value.at == at


def test_errors_survive_pickling() -> None:
    with pytest.raises(FormulaError) as caught:
        expression("1 +")
    again = pickle.loads(pickle.dumps(caught.value))
    assert isinstance(again, ModelError) and str(again) == str(caught.value)


def test_unit_symbols_and_the_model_s_names() -> None:
    assert expression("2 m", names=["m"]) == Number(2.0, "m")  # right after a number it is the unit
    assert expression("2*m", names=["m"]) == Product((Number(2.0), Name("m")))
    assert expression("(2 kg)*g", names=["g"]) == Product((Number(2.0, "kg"), Name("g")))
    assert expression("(2 kg*g)*x", names=["g"]) == Product(
        (Number(0.002, "kg^2"), x)
    )  # alone in brackets too
    with pytest.raises(FormulaError, match="can be the unit or the model's own name"):
        expression("2 kg*g", names=["g"])
    assert expression("2 kg*sin(x)") == Product((Number(2.0, "kg"), tree.Call("sin", (x,))))
    assert quantity("-9.81 m/s^2") == Number(-9.81, "m/s^2")
    assert quantity("2 m + 1 m") is None and quantity("l") is None


@settings(max_examples=500, deadline=None)
@given(st.text(max_size=60) | st.text(alphabet="0123456789.e+-*/^()[],xm der sin", max_size=60))
def test_any_text_is_a_formula_or_a_formula_error(text: str) -> None:
    try:
        formula = expression(text, names=["x"], vectors=True)
    except FormulaError as error:
        assert 0 <= error.at <= len(text)
    else:
        assert len(list(tree.walk(formula))) >= 1
        assert tree.rebuilt(formula, lambda leaf: leaf) == formula


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x", Degree(0, 0)),
        ("0*der(x)", Degree(0, 0)),
        ("der(x)", Degree(1, 1)),
        ("x*der(x) + y*base.vx", Degree(1, 1)),
        ("der(x) - x", Degree(0, 1)),
        ("der(x)/sin(y)", Degree(1, 1)),
        ("sin(y)/der(x)", NONLINEAR),
        ("der(x)*der(y)", Degree(2, 2)),
        ("(der(x) + 1)^3", Degree(0, 3)),
        ("der(x)^x", NONLINEAR),
        ("der(x)^0.5", NONLINEAR),
        ("sqrt(der(x)^2)", NONLINEAR),
        ("speed", NONLINEAR),
        ("0", Degree(0, 0)),
    ],
)
def test_degrees(text: str, expected: Degree) -> None:
    formula = expression(text)
    found = degree(formula, ["base.vx"], {"speed": NONLINEAR})
    assert found == expected


def test_constants() -> None:
    assert (
        is_constant(expression("2*sin(1)^2"))
        and not is_constant(expression("2*x"))
        and not is_constant(expression("der(x)"))
    )
