"""Every road leads to the same equations, and what it prints is what is compiled.

Of derive.textbook.formulas: coefficients, measure.
Of derive.textbook: forces, routes, worked.
Of derive.model: letters.
Of derive.textbook.roads: block_inversion, boltzmann_hamel, kane, multipliers, records.
"""

import functools
import re

import casadi as ca
import numpy as np
import pytest
import sympy
from sympy import Matrix, cos, sin, symbols, tan

from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import equations
from derive.model import load, load_text
from derive.states import system
from derive.states.sampling import states
from derive.textbook import ROADS, html, latex
from derive.textbook.derivation import derivation
from derive.textbook.forces import balance
from derive.textbook.formulas.coefficients import Coefficients
from derive.textbook.formulas.terms import Terms
from tests import digits
from tests.scenes import MODELS

TOLERANCE = 1e-12
QUICK = ("chaplygin_sleigh", "cart_pole", "bead_on_wire")
NAMES = [road.name for road in ROADS]
TRIAL = ca.DM([0.3, -1.1, 0.7, 0.9, -0.4, 1.3, 0.2, -0.6] * 8)  # any accelerations


def cases():
    for path in sorted(MODELS.glob("*.yaml")):
        for road in NAMES:
            marks = () if path.stem in QUICK else pytest.mark.slow
            yield pytest.param(path.stem, road, id=f"{path.stem}-{road}", marks=marks)


@functools.cache
def derived(model):
    return equations(system(load(MODELS / f"{model}.yaml")))


class State:
    """A random admissible state, its velocities exactly on the constraints of the choice."""

    def __init__(self, found, seed=5):
        self.found, s = found, found.system
        sample = states(s, 1, seed=seed, parameters=0.1)
        self.w_symbols = found.argument("x").symbols[s.q.numel() :, 0]
        self.t, self.q, v, self.u, self.p = (
            x[0] for x in (sample.t, sample.q, sample.v, sample.u, sample.p)
        )
        B = ca.Function("B", [s.t, s.q, s.p], [ca.densify(found.term("B"))])
        self.w = np.asarray(B(self.t, self.q, self.p)) @ v

    def exact(self, values):
        """With many digits, v = S w + R c computed with as many."""
        s = self.found.system
        arguments = [s.t, s.q, self.w_symbols, s.u, s.p]
        numbers = [[self.t], self.q, self.w, self.u, self.p]
        (v,) = digits.evaluated(arguments, [self.found.term("v")], numbers)
        return digits.evaluated([*arguments, s.v], values, [*numbers, v])

    def basic(self, document):
        """Symbol of the page → number, of everything that the model declares."""
        s, model = self.found.system, self.found.system.model
        (v,) = self.exact([s.v])
        free = [x.name for x in model.parameters if x.name not in s.constants]
        names = [free, *([x.name for x in part] for part in (model.coordinates, model.velocities))]
        names.append([x.name for x in model.inputs])
        values = {"t": self.t}
        for labels, numbers in zip(names, (self.p, self.q, v, self.u)):
            values |= dict(zip(labels, numbers))
        for name, number in zip(self.found.w, self.w):
            while name in values:
                name += "'"
            values[name] = number
        return values


def printed_errors(document, state):
    """Name → relative difference of what a formula prints, over what the formulas before it gave."""
    values, errors = state.basic(document), {}
    exact = state.exact([formula.value for formula in document.printed])
    for formula, entries in zip(document.printed, exact):
        rows, columns = formula.value.shape
        numbers = [entries[j * rows + i] for i in range(rows) for j in range(columns)]
        scale = 1 + max(map(abs, numbers), default=0)
        for left, right, number in zip(formula.left, formula.right, numbers):
            free = sorted(right.free_symbols, key=lambda x: x.name)
            got = sympy.lambdify(free, right, "mpmath")(*[values[x.name] for x in free])
            errors[formula.name] = max(errors.get(formula.name, 0), abs(got - number) / scale)
            if left is not None:
                values[left.name] = got
    return {name: float(x) for name, x in errors.items()}


def law_errors(document, state):
    """Name → largest residual of a matrix equation, with many digits."""
    exact = state.exact([law.residual for law in document.laws])
    return {
        law.name: float(max(map(abs, entries), default=0))
        for law, entries in zip(document.laws, exact)
    }


@pytest.mark.parametrize("model, road", list(cases()))
def test_every_road_prints_what_is_compiled_and_comes_to_the_same_equations(model, road):
    found = derived(model)
    try:
        document = derivation(found, [road])
    except AssumptionError as error:
        assert (
            "singular" in str(error) or "not written out" in str(error) or "freedom" in str(error)
        )
        return
    state = State(found)
    errors = printed_errors(document, state)
    assert not {name: x for name, x in errors.items() if not x <= TOLERANCE}
    terms, way = Terms(found), next(x for x in ROADS if x.name == road)
    (size,) = state.exact([terms.wdot])
    scale = 1 + float(max(map(abs, size)))  # constants of the model are rounded
    errors = law_errors(document, state)
    assert not {name: x for name, x in errors.items() if not x <= TOLERANCE * scale}
    assert any(law.name == "projected" for law in document.laws)
    (difference,) = state.exact([way.accelerations(terms) - terms.wdot])
    assert max(map(abs, difference)) <= TOLERANCE * (1 + max(map(abs, size)))
    if way.left is not None:
        trial = TRIAL[: terms.w.numel()]
        left = way.left(terms, ca.SX(trial)) - balance(terms, ca.SX(trial))
        (same,) = state.exact([left])
        assert max(map(abs, same)) <= TOLERANCE * (1 + max(map(abs, size)))


@pytest.mark.parametrize("pair", ["block_inversion,boltzmann_hamel", "kane,udwadia_kalaba"])
def test_two_roads_stand_side_by_side_and_agree(pair):
    found = derived("chaplygin_sleigh")
    document = derivation(found, pair.split(","))
    state = State(found)
    errors = printed_errors(document, state) | law_errors(document, state)
    assert not {name: x for name, x in errors.items() if not x <= TOLERANCE}
    assert {section.column for section in document.sections} == {0, 1, 2}
    page = html(found, roads=pair.split(","))
    assert 'class="beside"' in page and "The two roads compared" in page
    assert "fails" in page and "operations for the accelerations" in page
    assert "The two roads compared" in latex(found, roads=pair.split(","))


ROTORS = """
loads:
  along: {type: armature, velocity: base.vx, inertia: 2 kg}
  across: {type: armature, velocity: base.vy, inertia: 5 kg}
"""


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("road", NAMES)
def test_rotors_on_velocities_that_are_no_rates(road, free):
    """They add J v̇ and nothing gyroscopic, on every road."""
    text = (MODELS / "chaplygin_sleigh.yaml").read_text().partition("reference:")[0] + ROTORS
    if free:
        text = re.sub(r"(?ms)^constraints:.*?(?=^quasi)", "", text).replace("body: {v", "old: {v")
        text = re.sub(r"(?ms)^quasi_velocities:.*?(?=^initial)", "", text)
    found = equations(system(load_text(text)))
    try:
        document = derivation(found, [road])
    except AssumptionError as error:
        assert "freedom" in str(error) or "constraints" in str(error)
        return
    if road in ("kane", "gibbs_appell"):  # whose sums are over bodies
        assert "Rotors, and what the file gives" in repr(document)
    state, terms = State(found), Terms(found)
    way = next(x for x in ROADS if x.name == road)
    errors = printed_errors(document, state) | law_errors(document, state)
    assert not {name: x for name, x in errors.items() if not x <= TOLERANCE}
    (difference,) = state.exact([way.accelerations(terms) - terms.wdot])
    assert max(map(abs, difference)) <= TOLERANCE


@pytest.mark.parametrize("planted", ["gamma", "bracket", "drift"])
def test_a_wrong_coefficient_is_seen(planted, monkeypatch):
    found = derived("bead_on_wire" if planted == "drift" else "chaplygin_sleigh")
    if planted == "gamma":
        own = Coefficients.of
        monkeypatch.setattr(Coefficients, "of", lambda self, r, k: -own(self, r, k))
    elif planted == "bracket":
        monkeypatch.setattr("derive.textbook.formulas.coefficients.structure", lambda system: {})
    else:
        own_drift = Coefficients.drift
        monkeypatch.setattr(Coefficients, "drift", lambda self, k: -own_drift(self, k))
        found = equations(system(load_text(DRIVEN)))
    errors = law_errors(derivation(found, ["boltzmann_hamel"]), State(found))
    assert errors["Boltzmann–Hamel"] > 1e-3


DRIVEN = """
model: driven
plane: xy
parameters: {m: 1 kg, J: 0.2 kg*m^2, a: 0.5 m, c: 0.3 m/s, k: 2 rad/s}
bodies: {sled: {mass: m, com: [a, 0], inertia: J}}
joints: {base: {type: planar, parent: ground, child: sled, coordinates: [x, y, th]}}
constraints: {edge: {nonholonomic: base.vy - c*sin(k*t)*cos(th)}}
quasi_velocities: {body: [base.vx, base.w]}
"""


def test_a_moving_row_has_coefficients_of_its_drift():
    found = equations(system(load_text(DRIVEN)))
    document = derivation(found, ["boltzmann_hamel"])
    errors = law_errors(document, State(found))
    assert Coefficients(Terms(found)).drifts
    assert not {name: x for name, x in errors.items() if not x <= TOLERANCE}


def coefficients(model):
    """(s, r, l) → γ as it is printed, of those that are not zero; counted from one."""
    document = derivation(derived(model), ["boltzmann_hamel"])
    result = {}
    for formula in document.printed:
        if formula.name.startswith("gamma["):
            for left, right in zip(formula.left, formula.right):
                s, _, pair = left.name[len("gamma[") : -1].partition(";")
                result[(int(s), *map(int, pair.split(",")))] = right
    return result


def brackets(fields, rows, q):
    """Textbook way: [u_r, u_l] = Σ γ^s_rl u_s with the fields u in coordinates, and rows that are
    their inverse."""
    result = {}
    for r in range(len(fields)):
        for k in range(r + 1, len(fields)):
            bracket = fields[k].jacobian(q) * fields[r] - fields[r].jacobian(q) * fields[k]
            for s, value in enumerate(sympy.simplify(rows * bracket)):
                if value != 0:
                    result[s + 1, r + 1, k + 1] = value
    return result


def same(first, second):
    keys = first.keys() | second.keys()
    return all(sympy.simplify(first.get(key, 0) - second.get(key, 0)) == 0 for key in keys)


def test_coefficients_of_the_chaplygin_sleigh_are_the_textbooks():
    """Neimark, Fufaev 1972, III; Bloch, Nonholonomic Mechanics and Control, 1.7: with u₁ along the
    blade, u₂ the rotation and u₃ across the blade, [u₁, u₂] = −u₃ is the only bracket."""
    x, y, th = symbols("x y th")
    along, turning = Matrix([cos(th), sin(th), 0]), Matrix([0, 0, 1])
    rows = Matrix([[cos(th), sin(th), 0], [0, 0, 1], [-sin(th), cos(th), 0]])
    expected = brackets([along, turning], rows, Matrix([x, y, th]))
    assert expected == {(3, 1, 2): -1}
    assert same(coefficients("chaplygin_sleigh"), expected)


def test_coefficients_of_the_rolling_disk_are_the_textbooks():
    """Neimark, Fufaev 1972, III: ω₁ = θ̇, ω₂ = ψ̇ + φ̇ sin θ, ω₃ = φ̇ cos θ in the axes of the leaning
    frame, rolling without slip: γ²₁₃ = −1, γ³₁₃ = tan θ, and across the track γ⁶₂₃ = −r / cos θ."""
    yaw, lean, spin, x, y = symbols("yaw lean spin x y")
    r = symbols("r", positive=True)
    # contact point; across the track, (−sin yaw, cos yaw), its velocity vanishes
    q = Matrix([yaw, lean, spin, x, y])
    track = [cos(yaw), sin(yaw)]
    fields = [
        Matrix([0, 1, 0, 0, 0]),
        Matrix([0, 0, 1, r * track[0], r * track[1]]),
        Matrix(
            [1 / cos(lean), 0, -tan(lean), -r * tan(lean) * track[0], -r * tan(lean) * track[1]]
        ),
    ]
    rows = Matrix(
        [
            [0, 1, 0, 0, 0],
            [sin(lean), 0, 1, 0, 0],
            [cos(lean), 0, 0, 0, 0],
            [0, 0, -r, cos(yaw), sin(yaw)],
            [0, 0, 0, -sin(yaw), cos(yaw)],
        ]
    )
    expected = brackets(fields, rows, q)
    assert same(expected, {(2, 1, 3): -1, (3, 1, 3): tan(lean), (5, 2, 3): -r / cos(lean)})
    found = {key: value.subs("r", r) for key, value in coefficients("rolling_disk").items()}
    found = {key: value.subs("lean", lean) for key, value in found.items()}
    # the track changes sides where the disk lies flat: here cos θ > 0
    upright = symbols("c", positive=True)
    across = found.pop((6, 2, 3)).subs(cos(lean), upright)
    assert same(found, {(2, 1, 3): -1, (3, 1, 3): tan(lean)})
    assert sympy.simplify(across - expected[5, 2, 3].subs(cos(lean), upright)) == 0


def test_coefficients_of_the_snakeboard_are_the_textbooks():
    """Bloch, Krishnaprasad, Marsden, Murray 1996; Bloch, Marsden, Zenkov 2009: the joint rates
    commute with each other, and each steering rate fails to commute with the drive along the wheels
    of its own pair."""
    x, y, th, psi, f, b = symbols("x y th psi f b")
    length = symbols("l", positive=True)
    q = Matrix([x, y, th, psi, f, b])
    body = Matrix([[cos(th), -sin(th), 0], [sin(th), cos(th), 0], [0, 0, 1]])
    drive = body * Matrix(
        [1, sin(f + b) / (2 * cos(f) * cos(b)), sin(f - b) / (2 * length * cos(f) * cos(b))]
    )
    unit = sympy.eye(6)
    fields = [unit[:, 3], unit[:, 4], unit[:, 5], Matrix([*drive, 0, 0, 0])]
    inverse = body.T
    wheels = [
        Matrix([[-sin(f), cos(f), length * cos(f)]]) * inverse,
        Matrix([[-sin(b), cos(b), -length * cos(b)]]) * inverse,
    ]
    rows = Matrix([unit[3, :], unit[4, :], unit[5, :], Matrix([[*inverse[0, :], 0, 0, 0]])])
    rows = Matrix([*rows.tolist(), *[[*row, 0, 0, 0] for row in wheels]])
    expected = brackets(fields, rows, q)
    assert same(expected, {(5, 2, 4): 1 / cos(f), (6, 3, 4): 1 / cos(b)})
    names = {"phi_f": f, "phi_b": b}
    assert same({k: x.subs(names) for k, x in coefficients("snakeboard").items()}, expected)


def test_a_holonomic_row_has_no_coefficients():
    """Frobenius: the allowed directions of a position constraint stay inside it."""
    found = Coefficients(Terms(derived("slider_crank")))
    assert found.table == {} and found.free == 1
    board = Coefficients(Terms(derived("rolling_disk")))
    holonomic = [
        board.free + k
        for k, i in enumerate(board.terms.independent)
        if board.terms.system.rows[i].position >= 0
    ]
    assert holonomic
    assert all(zeros[s] for zeros in board.vanishing.values() for s in holonomic)


def test_an_unknown_road_is_said_with_the_nearest():
    with pytest.raises(ModelError, match="boltzmann_hamel"):
        derivation(derived("chaplygin_sleigh"), ["boltzman_hamel"])


def test_a_singular_mass_matrix_has_no_free_accelerations():
    text = (
        "model: m\ncoordinates: {x: m, s: m}\nparameters: {m: 1 kg}\n"
        "kinetic: m/2*der(x)**2\nconstraints: {c: {holonomic: x - s}}\n"
    )
    found = equations(system(load_text(text)))
    with pytest.raises(AssumptionError, match="singular"):
        derivation(found, ["udwadia_kalaba"])
    errors = law_errors(derivation(found, ["multipliers"]), State(found))
    assert not {name: x for name, x in errors.items() if not x <= TOLERANCE}


def test_numbers_stand_beside_the_formulas():
    found = derived("chaplygin_sleigh")
    document = derivation(found)
    numbers = dict(zip((x.name for x in document.printed), document.numbers))
    assert numbers["M_w"] == pytest.approx((1.0, 0.0, 0.0, 0.45))  # m, and J + m a²
    assert "Numbers beside the formulas" in html(found)


SYMBOLS = r"""
model: m
plane: xy
parameters: {stiff: {value: 3 N/m, symbol: '\kappa_{0}'}, mass: {value: 1 kg, symbol: "m'"}}
bodies: {block: {mass: mass, inertia: 0.1, symbol: B}}
joints: {J: {type: prismatic, parent: ground, child: block, axis: x, coordinate: s, spring: {stiffness: stiff}, symbol: '\hat{x}'}}
"""


def test_a_file_says_how_its_names_are_typeset():
    found = equations(system(load_text(SYMBOLS)))
    text = latex(found)
    assert r"\kappa_{0}" in text and "m'" in text
    assert r"\hat{x}" in text and r"\dot{\hat{x}}" in text and "v_{B,x}" in text


def test_a_joint_says_it_of_all_its_coordinates():
    """A list from the first one on; the others keep their names, and their rates follow."""
    free = (
        r"{J: {type: planar, parent: ground, child: block, coordinates: [x, y, turn], symbol: %s}}"
    )
    text = SYMBOLS[: SYMBOLS.index("joints:")] + f"joints: {free}"
    shown = latex(equations(system(load_text(text % r"['\xi_{1}', '\eta']"))))
    assert r"\xi_{1}" in shown and r"\eta" in shown and r"\mathrm{turn}" in shown
    for wrong in (r"[a, b, c, d]", r"[a, '\input{x}']"):
        with pytest.raises(ModelError, match=r"3 coordinates, not 4|is not a symbol"):
            load_text(text % wrong)


@pytest.mark.parametrize("symbol", [r"\input{x}", r"x}", r"x_a_b", r"\hatx", "<b>", "", "a" * 80])
def test_what_is_no_symbol_is_said(symbol):
    text = SYMBOLS.replace(r"\hat{x}", symbol)
    with pytest.raises(ModelError, match="is not a symbol") as caught:
        load_text(text)
    assert len(symbol) <= 60 or f"'{'a' * 60}…' is" in str(caught.value)


@pytest.mark.parametrize("road", ["kane", "boltzmann_hamel"])
def test_what_a_road_did_without_is_said_where_it_is_used(road):
    page = latex(derived("chaplygin_sleigh"), roads=[road])
    used = page.index(r"\mathbf{h}_w &= ")
    assert page.index(r"$\mathbf{h}$ holds velocity products") > used
    assert r"$\mathbf{M},\; \allowbreak \mathbf{h},\; \allowbreak \mathbf{Q}$ & mass matrix" in page
