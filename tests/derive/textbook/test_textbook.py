"""What the textbook prints is evaluated, formula by formula, and must equal what is compiled.

Of derive.textbook: charts, choice, complement, constraints, dependent, elimination, energy,
interaction, inverse, kinematics, linear, manuscript, methods, motion, multipliers, outputs,
projected, prose, records.
Of derive.textbook.formulas: compose, graph, layout, notation, ring, terms.
Of derive.textbook.given: model, sentences.
Of derive.textbook.writing: pages.
"""

import functools
import hashlib
import os
import re
import subprocess
import sys
from dataclasses import replace
from html import unescape
from xml.etree import ElementTree

import casadi as ca
import numpy as np
import pytest
import sympy

from derive.formulations import FORMULATIONS, equations
from derive.model import load, load_text
from derive.states import system
from derive.states.sampling import states
from derive.textbook import html, latex, laws, printed
from derive.textbook.derivation import derivation
from derive.textbook.formulas.convert import Reader
from derive.textbook.formulas.typeset import Typesetter
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import per_second, symbol, velocity
from derive.textbook.writing.html import page
from derive.textbook.writing.latex import article, escape
from derive.textbook.writing.mathml import mathml
from tests.loops import four_bars
from tests.scenes import MODELS, ROOT, is_tree

TOLERANCE = 1e-9
EVERY_CHOICE = {"four_bar", "snake3"}
ONE_CHOICE = {
    "snakeboard",  # a platform with arms
    "chaplygin_sleigh",
    "rolling_disk",
    "slider_crank",
    "pendulum",
    "bead_in_bowl",
    "cart_pole",
    "double_pendulum",
    "planar_3r",
    "mobile_manipulator_2r",
}
IMPOSSIBLE = {("snake3", "world")}  # x and y rates depend on each other through the wheel of link 1


def cases():
    """Every choice of some models and one of others with parameters as symbols; all the rest are
    slow tests."""
    for path in sorted(MODELS.glob("*.yaml")):
        model = load(path)
        names = [
            choice.name for choice in model.choices if (path.stem, choice.name) not in IMPOSSIBLE
        ]
        for k, name in enumerate(names):
            soon = path.stem in EVERY_CHOICE or (k == 0 and path.stem in ONE_CHOICE)
            yield case(path.stem, name, (), "quasi_velocities", soon)
            yield case(
                path.stem, name, "all", "quasi_velocities", k == 0 and path.stem in EVERY_CHOICE
            )
        for method in FORMULATIONS:
            if method.name != "quasi_velocities" and (method.name == "recursive") <= is_tree(model):
                quick = EVERY_CHOICE | (
                    {"cart_pole", "double_pendulum"}
                    if method.name == "recursive"
                    else {"bead_on_wire"}
                )
                yield case(path.stem, names[0], (), method.name, path.stem in quick)


def case(model, choice, constants, formulation, soon):
    label = f"{model}-{choice if formulation == 'quasi_velocities' else formulation}{'-numbers' if constants else ''}"
    return pytest.param(
        model, choice, constants, formulation, id=label, marks=() if soon else pytest.mark.slow
    )


@functools.cache
def derived(model, choice, constants=(), formulation="quasi_velocities"):
    return equations(system(load(MODELS / f"{model}.yaml"), constants), choice, formulation)


class State:
    """A random consistent state; terms are evaluated there by CasADi."""

    def __init__(self, found, seed):
        self.found, self.augmented = found, found.generalized_velocities
        sample = states(found.system, 1, seed=seed, parameters=0.1)
        self.t, self.q, self.v, self.u, self.p = (
            x[0] for x in (sample.t, sample.q, sample.v, sample.u, sample.p)
        )
        self.w = (
            self.v
            if self.augmented
            else self.terms([named(found, "B")], w=np.zeros(len(found.w)))[0] @ self.v
        )
        self.v = self.v if self.augmented else self.terms([named(found, "v")])[0].ravel()

    def terms(self, values, w=None):
        s = self.found.system
        x = next(a for a in self.found.arguments if a.name == "x").symbols[s.q.numel() :]
        symbols, here = ([], []) if self.augmented else ([x], [self.w if w is None else w])
        function = ca.Function(
            "terms", [s.t, s.q, s.v, *symbols, s.u, s.p], [ca.densify(ca.SX(v)) for v in values]
        )
        result = function.call([self.t, self.q, self.v, *here, self.u, self.p])
        return [np.asarray(v, dtype=float) for v in result]

    def basic(self):
        """Name → value of what a model declares."""
        s, model = self.found.system, self.found.system.model
        free = [x.name for x in model.parameters if x.name not in s.constants]
        labels = [
            free,
            [c.name for c in model.coordinates],
            [v.name for v in model.velocities],
            [i.name for i in model.inputs],
        ]
        values = {}
        for names, numbers in zip(labels, (self.p, self.q, self.v, self.u)):
            values |= dict(zip(names, numbers))
        return (
            {"t": self.t} | values | speeds(values, [] if self.augmented else self.found.w, self.w)
        )


def speeds(values, names, numbers):
    """Quasi-velocities have their own names, primed where a parameter has the same one."""
    result = {}
    for name, number in zip(names, numbers):
        while name in values or name in result:
            name += "'"
        result[name] = number
    return result


def named(found, name):
    return next(x.value for x in found.named if x.name == name)


def discrepancies(formulas, state):
    """Every printed formula in order, each over the values that the earlier ones gave: (name,
    relative difference)."""
    values = state.basic()
    for formula, exact in zip(formulas, state.terms([f.value for f in formulas])):
        result = evaluated(formula, values)
        values |= {s.name: x for s, x in zip(formula.left, result.ravel()) if s is not None}
        yield (
            formula.name,
            np.max(np.abs(result - exact), initial=0.0) / (1 + np.max(np.abs(exact), initial=0.0)),
        )


def evaluated(formula, values):
    """A display's lines one after the other: a line may use the ones above it."""
    here, result = dict(values), []
    for left, x in zip(formula.left, formula.right):
        free = sorted(x.free_symbols, key=lambda s: s.name)
        undefined = [s.name for s in free if s.name not in here]
        assert not undefined, f"{formula.name} uses {undefined} before they are defined"
        result.append(
            float(compiled(x, tuple(free))(*[here[s.name] for s in free])) if free else float(x)
        )
        if left is not None:
            here[left.name] = result[-1]
    return np.array(result).reshape(formula.right.shape)


def compiled(expression, symbols):
    return sympy.lambdify(symbols, expression, "math")


@pytest.mark.parametrize("model, choice, constants, formulation", list(cases()))
def test_what_is_printed_is_what_is_compiled(model, choice, constants, formulation):
    found = derived(model, choice, constants, formulation)
    document, state = derivation(found), State(found, 7)
    wrong = {
        name: error
        for name, error in discrepancies(document.printed, state)
        if not error <= TOLERANCE
    }
    assert not wrong
    residuals = state.terms([law.residual for law in document.laws])
    broken = {
        law.name: x
        for law, x in zip(document.laws, residuals)
        if not np.max(np.abs(x), initial=0.0) <= 1e-6
    }
    assert not broken
    check_page(page(document))
    check_article(article(document))


def check_page(text):
    """Well-formed MathML without unknown commands; nothing that runs or is fetched."""
    for element in re.findall(r"<math.*?</math>", text, re.DOTALL):
        ElementTree.fromstring(element)
    assert "<mi>\\" not in text and "<mi>&</mi>" not in text
    assert "<script" not in text and "http" not in text and "/work" not in text


def check_article(text):
    """Balanced braces, environments and brackets; no character that pdfLaTeX has no font for."""
    bare = re.sub(r"\\[\\{}]", "", text)
    assert bare.count("{") == bare.count("}")
    open_ones = []
    for kind, name in re.findall(r"\\(begin|end)\{(\w+\*?)\}", text):
        assert kind == "begin" or open_ones.pop() == name
        open_ones += [name] if kind == "begin" else []
    assert not open_ones
    assert len(re.findall(r"\\left[^a-z]", text)) == len(re.findall(r"\\right[^a-z]", text))
    assert all(ord(c) < 0x180 for c in text)


@pytest.mark.parametrize("planted", ["M", "S", "h", "wdot", "lam", "M_w entries"])
def test_a_planted_sign_error_is_seen(planted):
    found = derived("slider_crank", "crank")
    formulas = [replace(f, right=-f.right) if f.name == planted else f for f in printed(found)]
    errors = dict(discrepancies(formulas, State(found, 7)))
    assert planted in errors and errors[planted] > 1e-3


@pytest.mark.parametrize(
    "model, choice",
    [("slider_crank", "slider+crank"), ("slider_crank", "slider+tangent"), ("snakeboard", None)],
)
def test_charts_are_shown_with_their_guards_and_the_way_between(model, choice):
    found = equations(system(load(MODELS / f"{model}.yaml")), choice, charts=True)
    document, state = derivation(found), State(found, 7)
    errors = dict(discrepancies(document.printed, state))
    assert "B(1)" in errors and not {
        name: error for name, error in errors.items() if not error <= TOLERANCE
    }
    residuals = dict(
        zip(
            [law.name for law in document.laws],
            state.terms([law.residual for law in document.laws]),
        )
    )
    assert (
        max(np.max(np.abs(residuals[name])) for name in ("to chart 1", "back from chart 1")) <= 1e-9
    )
    check_page(page(document))
    check_article(article(document))
    shown = page(document)
    assert (
        all(chart.choice in shown for chart in (found, *found.charts))
        and "A chart is left where its margin" in shown
    )
    guards = [
        g.name
        for chart in found.charts
        for f in chart.functions
        if f.name == "dynamics"
        for g in f.guards
    ]
    assert all(f"guard {name}" in errors for name in guards)


def test_a_wrong_way_between_charts_is_seen():
    found = equations(system(load(MODELS / "slider_crank.yaml")), "slider+crank")
    for name in ("state", "velocity"):
        wrong = [
            replace(f, result=replace(f.result, value=1.001 * f.result.value))
            if f.name == name
            else f
            for f in found.charts[0].functions
        ]
        broken = replace(found, charts=(replace(found.charts[0], functions=tuple(wrong)),))
        residuals = State(broken, 7).terms(
            [law.residual for law in laws(broken) if "chart" in law.name]
        )
        assert max(np.max(np.abs(x)) for x in residuals) > 1e-5


def test_laws_can_fail():
    found = derived("snake3", "head")
    state = State(found, 7)
    state.v = state.v + 0.1  # no longer S w
    assert max(np.max(np.abs(x)) for x in state.terms([law.residual for law in laws(found)])) > 1e-3


SECTIONS = (
    "Given", "Coordinates and generalized velocities", "Kinematics", "Energies and forces", "Constraints",
    "Choice of quasi-velocities", "Velocities that the constraints allow", "Block inverse", "Equations with multipliers",
    "Projection", "Final equations", "Multipliers", "Energy and power", "Outputs", "Symbols",
)  # fmt: skip


def test_a_page_has_every_section_in_order():
    text = html(derived("four_bar", "crank"))
    places = [text.index(f". {title}</h2>") for title in SECTIONS]
    assert places == sorted(places)
    assert "Planar four-bar linkage" in text and "because the model declares it" in text


def words_of(text: str) -> str:
    """What is read: no element, no style, and every formula as one letter."""
    bare = re.sub(r"<style.*?</style>|<svg.*?</svg>", "", text, flags=re.DOTALL)
    bare = re.sub(r"<math.*?</math>", "x", bare, flags=re.DOTALL)
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", " ", bare)))


def test_words_hold_no_raw_names_and_say_what_a_student_asks():
    words = words_of(html(derived("four_bar", "crank")))
    assert "_" not in words and "Equations of motion: four bar" in words
    assert "The quasi-velocity x is x, with:" in words
    assert "It gives one of them, divided by" in words and "Sampled states are" in words
    assert words.count("Entries that are not listed are zero") == 1
    assert "potential energy of gravity is:" in words and "springs" not in words
    assert "planar or free" not in words and "parallel" in words
    assert words.index("Bold letters are") < words.index("The configuration is described")


def test_numbers_of_loads_have_units_and_rates_theirs():
    text = html(derived("four_bar", "crank"))
    assert mathml(r"0.01\;\mathrm{N\,m\,s/rad}") in text
    row = re.escape(mathml(r"\ddot{q}_{1}")) + r"</td>.{0,40}>rate of .*?</td>.{0,30}>rad/s²"
    assert re.search(row, text)


def test_a_model_of_formulas_speaks_of_no_joint_and_no_body():
    words = words_of(html(derived("pendulum", "swing")))
    assert "Lagrange's equations are as follows" in words and "Newton" not in words
    assert "joint" not in words.split("Energies and forces")[0]
    assert "rod and x give x and x (pivot: cannot vanish)" in words


def test_joints_in_space_have_axes_and_bodies_their_meaning():
    text = (
        "model: m\ngravity: [0, 0, -9.81 m/s^2]\nparameters: {a: 0.3}\n"
        "bodies: {big_arm: {mass: 1 kg, inertia: [1, 1, 1], about: it swings}}\n"
        "joints: {low_hinge: {type: revolute, parent: ground, child: big_arm, axis: y,"
        " at: {parent: {rpy: [a, 0, 0]}, child: {rpy: [a, 0, 0]}}}}\n"
    )
    page = html(equations(system(load_text(text))))
    words = words_of(page)
    assert "revolute about x" in words and "it swings" in words and "axes of all are" in words
    assert "big arm" in words and "low hinge" in words and "big_arm" not in words
    assert "There are no applied forces: x ." in words.replace("x.", "x .")
    assert mathml(r"(0,\; \cos a,\; \sin a)") in page


def test_velocities_that_are_chosen_as_they_are_need_no_projection():
    words = words_of(html(derived("double_pendulum", "relative")))
    assert "They are the generalized velocities themselves" in words
    assert "They are those from above" in words and "Projection" not in words
    assert "tied by constraints" not in words


def test_what_is_told_once_is_told_once():
    """Where entries are too long to be printed nothing marks them as printed."""
    doc = Manuscript(derived("pendulum", "swing"))
    assert doc.first("accelerations") and not doc.first("accelerations")
    doc.column = 2
    assert doc.first("accelerations")


@pytest.mark.parametrize(
    "unit, rate", [("m/s", "m/s^2"), ("rad/s", "rad/s^2"), ("", "1/s"), ("N*m", "N*m/s")]
)
def test_units_of_rates(unit, rate):
    assert per_second(unit) == rate


def test_a_letter_alone_is_upright_where_it_is_meant_to_be():
    """latex2mathml drops the style of a single letter: d of a derivative, an index B."""
    upright = '<mi mathvariant="normal">d</mi>'
    assert mathml(r"\frac{\mathrm{d}}{\mathrm{d}t}").count(upright) == 2


@pytest.mark.slow
def test_same_bytes_for_every_hash_seed():
    code = (
        "from derive.model import load; from derive.states import system; from derive.formulations import equations\n"
        "from derive.textbook import html, latex\n"
        "import hashlib, sys\n"
        "e = equations(system(load('models/rolling_disk.yaml')), 'lean_frame')\n"
        "print(hashlib.sha256((html(e) + latex(e)).encode()).hexdigest())"
    )
    seen = {
        subprocess.run(
            [sys.executable, "-c", code],
            cwd=ROOT,
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("0", "1")
    }
    assert len(seen) == 1 and len(seen.pop().strip()) == 2 * hashlib.sha256().digest_size


HOSTILE = r"""
model: hostile
description: '<script>alert("x")</script> </math> & 100 % $m_1$ \input{x} #1 ~^ {a} "quoted" ẇ ≤ 𝔘'
coordinates: {x: m}
parameters:
  M: {value: 2 kg, about: '</td><script> \end{document} 5%_'}
  M_11: 1 kg
  T: 1 N/m
  lambda1: 3 N
  a_long_name: 0.5 m
kinetic: (M + M_11)/2*der(x)**2
potential: T/2*(x - a_long_name)**2
forces: {x: lambda1}
outputs: {V: x}
"""


def hostile(folder):
    path = folder / "hostile.yaml"
    path.write_text(HOSTILE, encoding="utf-8")
    return equations(system(load(path)), "auto")


def test_the_users_text_is_text(tmp_path):
    found = hostile(tmp_path)
    document = derivation(found)
    web, tex = page(document), article(document)
    check_page(web)
    check_article(tex)
    assert "&lt;script&gt;alert" in web and "&lt;/math&gt;" in web
    assert r"\input{" not in tex and tex.count(r"\end{document}") == 1
    assert r"100 \% \$m\_1\$ \textbackslash{}input\{x\} \#1" in tex


def test_names_of_the_model_do_not_collide_with_names_of_the_page(tmp_path):
    found = hostile(tmp_path)
    document = derivation(found)
    assert not {
        name: e
        for name, e in discrepancies(document.printed, State(found, 1))
        if not e <= TOLERANCE
    }
    text = page(document)
    assert r"\mathrm{M\,11}" in article(document) and r"<mi>lambda1</mi>" in text


@pytest.mark.parametrize(
    "name, latex",
    [
        ("phi1", r"\phi_{1}"),
        ("th", r"\theta"),
        ("lam", r"\lambda"),
        ("rR", r"r_{\mathrm{R}}"),
        ("IBxz", r"I_{\mathrm{Bxz}}"),
        ("mb", "m_{b}"),
        ("rear_spin", r"\mathrm{rear\,spin}"),
        ("x_prime", "x'"),
        ("l1", "l_{1}"),
        ("q1_dot", r"\dot{q}_{1}"),
        ("tau", r"\tau"),
        ("l_arm", r"l_{\mathrm{arm}}"),
        ("yaw_dot", r"\dot{\mathrm{yaw}}"),
        ("x", "x"),
        ("t", r"\mathrm{t}"),
        ("a_b_c", r"a_{\mathrm{b\,c}}"),
        ("wheel_2", r"\mathrm{wheel}_{2}"),
    ],
)
def test_identifiers_become_symbols(name, latex):
    assert symbol(name) == latex


def test_generalized_velocities_carry_their_joint():
    assert velocity("base.vx", "") == r"v_{x}^{\mathrm{base}}"
    assert velocity("base.w", "") == r"\omega^{\mathrm{base}}"
    assert velocity("der(q1)", "q1") == r"\dot{q}_{1}"


X, Y = ca.SX.sym("x"), ca.SX.sym("y")
TERMS = [
    ca.sin(X) ** 2 + ca.cos(X) ** 2,
    ca.sin(X) * ca.cos(Y) + ca.cos(X) * ca.sin(Y),
    (X * X + 2 * X * Y + Y * Y) / (3 * X),
    1 / (ca.sin(X) * ca.cos(Y) / ca.sin(Y) - ca.cos(X)),
    ca.sqrt(X * X * 4) + ca.sqrt(X + 2 * Y) * ca.sqrt(X + 2 * Y),
    ca.tan(X) + ca.atan2(X, Y) + ca.exp(-X) * ca.log(Y),
    ca.fmin(X, Y) + ca.fmax(X, 0.3) + ca.fabs(Y - X) + ca.sign(X - 1),
    X**2.5 + X ** (-3) + ca.constpow(X, 0.5) + X**Y,
    ca.tanh(X) + ca.sinh(Y) + ca.cosh(X) + ca.asin(X / 9) + ca.acos(Y / 9) + ca.atan(X),
    0.1 * X + Y / 3 + 1e-9 * X * Y - 12345.678901 * Y,
    ca.if_else(X < Y, X, Y * Y),
    ca.floor(X * 5) + ca.ceil(Y * 5),
]


@pytest.mark.parametrize("term", TERMS, ids=str)
def test_a_term_is_read_as_it_is(term):
    symbols = sympy.symbols("x y")
    reader = Reader(ca.vertcat(X, Y), symbols, False)
    node = reader.graph.read(ca.SX(term))
    shown = [*(reader.whole(ca.SX(term)) or []), *reader._plain(node, {})]
    exact = float(ca.Function("f", [X, Y], [term])(0.7, 1.9))
    for x in shown:
        assert float(sympy.N(x.subs(dict(zip(symbols, (0.7, 1.9)))))) == pytest.approx(
            exact, rel=1e-12
        )
    ElementTree.fromstring(mathml(Typesetter({symbols[0]: "x", symbols[1]: "y"}).latex(shown[0])))


@pytest.mark.parametrize(
    "term, shown",
    [
        (ca.sin(X) ** 2 + ca.cos(X) ** 2, "1"),
        (ca.sin(X) * ca.cos(Y) + ca.cos(X) * ca.sin(Y), r"\sin\left(x + y\right)"),
        (X * X + 2 * X * Y + Y * Y, r"\left(x + y\right)^{2}"),
        (ca.sqrt(X * X) * 2, r"2 \, \left|x\right|"),
        (0.5 * X * Y * Y, r"\frac{x \, y^{2}}{2}"),
        (0.1 * X - Y, r"0.1 \, x - y"),
    ],
)
def test_terms_are_shown_as_a_person_writes_them(term, shown):
    symbols = sympy.symbols("x y")
    found = Reader(ca.vertcat(X, Y), symbols, False).whole(ca.SX(term))
    assert (
        found is not None
        and Typesetter({symbols[0]: "x", symbols[1]: "y"}).latex(found[0]) == shown
    )


def test_long_terms_are_cut_into_named_ones():
    big = X
    for k in range(40):
        big = ca.sin(big * Y + k) + ca.sqrt(1 + big * big)
    symbols = sympy.symbols("x y")
    reader = Reader(ca.vertcat(X, Y), symbols, False)
    assert reader.whole(big) is None
    found = reader.in_pieces(big, lambda k: sympy.Symbol(f"z{k}"), 100)
    assert found is not None
    values = dict(zip(symbols, (0.3, 0.8)))
    for piece in found[0]:
        values[piece.symbol] = float(sympy.N(piece.expression.subs(values)))
    exact = float(ca.Function("f", [X, Y], [big])(0.3, 0.8))
    assert float(sympy.N(found[1][0].subs(values))) == pytest.approx(exact, rel=1e-9)


def test_of_many_pivots_the_first_are_told():
    """Nobody reads a thousand lines that are alike."""
    shown = html(equations(system(load_text(four_bars(45)))))
    assert shown.count("gives the angular velocity of") == 10  # of 90
    assert "80 more" in shown
    assert shown.count("It has to satisfy") == 8
    assert "The other 37 are watched in the same way." in shown
    short = html(equations(system(load_text(four_bars(3)))))
    assert short.count("It has to satisfy") == 3
    assert "watched in the same way" not in short


def test_text_is_escaped_for_latex():
    assert escape("a_b 50% ẇ ≥ é 𝔘 \\x{y}") == (
        r"a\_b 50\% \ensuremath{\dot{w}} \ensuremath{\ge} é \texttt{U+1D518} \textbackslash{}x\{y\}"
    )


def test_rows_that_say_nothing_have_no_multipliers_to_recover():
    """A surface through the joint's own axis: its row vanishes everywhere, and nothing is named
    after it."""
    text = (
        "model: m\nplane: xy\nbodies: {c: {mass: 1, inertia: 0.1}}\n"
        "joints: {C: {type: revolute, parent: ground, child: c}}\n"
        "constraints: {e: {type: point_on_surface, body: c, surface: x + 2*y, of: ground}}\n"
    )
    assert "No constraint row restricts the motion" in html(equations(system(load_text(text))))


WHEEL = """
model: wheel
plane: xz
gravity: [0, -9.81 m/s^2]
bodies: {wheel: {mass: 5 kg, inertia: 0.2}}
joints: {base: {type: planar, parent: ground, child: wheel, coordinates: [x, z, turn]}}
constraints:
  contact: {type: rolling, body: wheel, shape: {wheel: {radius: 0.3 m}}, plane: {normal: z}}
initial: {guess: {z: 0.3 m}}
"""
USING = {
    "torque": "body: wheel, components: -0.003 m*reaction.contact.normal*tanh(der(turn)/(1 rad/s))",
    "force": "body: wheel, at: [0, 0], components: [-0.1*reaction.contact.normal, 0]",
    "wrench": "frame: wheel, force: [-0.1*reaction.contact.normal, 0]",
    "expression": "velocity: base.vx, expression: -0.1*reaction.contact.normal",
    "damper": "velocity: base.w, coefficient: (0.1 m*s)*abs(reaction.contact.normal)",
    "friction": "velocity: base.w, coulomb: (0.1 m)*abs(reaction.contact.normal), smoothing: 1",
    "tension": (
        "between: [ground, wheel], at: [[5, 0], [0, 0]], tension: 0.1*abs(reaction.contact.normal)"
    ),
}


@pytest.mark.parametrize("kind", USING)
def test_loads_that_use_reactions_show_the_multiplier(kind):
    text = f"{WHEEL}loads: {{f: {{type: {kind}, {USING[kind]}}}}}\n"
    shown = article(derivation(equations(system(load_text(text)))))
    assert r"\lambda_{\mathrm{contact.normal}}" in shown


HELD = """
model: held
plane: xy
bodies: {a: {mass: 1 kg, com: [1.2 m, 0.3 m], inertia: 0.1}}
joints: {A: {type: revolute, parent: ground, child: a, coordinate: q1}}
constraints: {driven: {type: prescribed, coordinate: q1, motion: (2 rad/s)*t}}
"""


def test_without_freedom_the_page_says_where_the_motion_comes_from():
    """ρ = M v̇ + h − Q has v̇ in it, which no equation of motion gives there."""
    text = latex(equations(system(load_text(HELD))))
    section = text[text.index("Choice of quasi-velocities") :]
    said = section[: section.index(r"\section")]
    assert r"$\mathbf{v}=\mathbf{A}^+\mathbf{c}$" in said
    assert r"$\dot{\mathbf{v}}=\mathbf{A}^+\boldsymbol{\beta}$" in said


def test_numbers_of_a_file_without_parameters_are_all_decimals():
    """1.2 beside 0.3 is no 6/5 beside 0.3."""
    page = latex(
        equations(system(load_text(HELD.replace("(2 rad/s)*t", "(1.2 rad/s)*t - 0.3*(t/(1 s))^2"))))
    )
    assert "1.2" in page and "0.3" in page and r"\frac{6" not in page and r"\frac{3" not in page
