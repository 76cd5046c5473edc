"""Linear equations along steady motions: published digits, closed forms, and the bookkeeping of
zeros.

Of derive.linearize: turned, cyclic, limits, records, turning, search, starts, branch.
Of hamel.linear: figure, limits, page, plots, ranges, sweep, words.
"""

import re
from html import unescape
from xml.etree import ElementTree

import casadi as ca
import numpy as np
import pytest
import sympy

import hamel
from derive.diagnostics import AssumptionError, HamelError, ModelError
from derive.formulations import equations
from derive.linearize import study
from derive.linearize.critical import critical_values
from derive.linearize.cyclic import cyclic_coordinates
from derive.linearize.minimal import evaluator, with_linearization
from derive.linearize.sensitivity import modes
from derive.linearize.spectrum import eigenvalues
from derive.linearize.steady import motion_of
from derive.linearize.unreduced import constraint_counts, unreduced
from derive.model import load, load_text
from derive.states import system
from derive.states.initial import initial_state
from derive.textbook import printed
from hamel.cli import main
from hamel.verbs.linearize import _complex as linearized_text
from tests.scenes import MODELS
from tests.texts import FLAT


def studied(name: str, at: str | None = None, choice: str | None = None, **values: float):
    found = equations(system(load(MODELS / f"{name}.yaml")), choice)
    return study(found, motion_of(found, at), values)


SLED = """
model: sled
plane: xy
parameters: {k: 2 N*m*s/rad}
bodies: {b: {mass: 1 kg, com: [0.2, 0], inertia: 2}, c: {mass: 1 kg, com: [0.3, 0], inertia: 0.1}}
joints:
  r: {type: planar, parent: ground, child: b, coordinates: [x, y, a]}
  s: {type: revolute, parent: b, child: c, coordinate: p, spring: {stiffness: 3}, damper: 0.1}
constraints: {skate: {type: no_slip, body: b, at: [0.1, 0], direction: y}}
loads: {drag: {type: damper, velocity: r.w, coefficient: k}}
quasi_velocities:
  body: {speed: r.vx, spin: 2*r.w, rel: der(p)}
  other: {speed: 3*r.vx, spin: 2*r.w, rel: der(p)}
inputs: {push: {velocity: r.vx}, twist: {velocity: r.w}}
steady_motion:
  curve: {HELD, push: free, twist: free, sweep: {V: [1 m/s, 3 m/s], W: [0.1 rad/s, 1 rad/s]}}
initial: {x: 0 m}
"""


@pytest.mark.parametrize("spin", ["2*r.w", "2*der(a)"])
def test_declared_quasi_velocities_are_held_as_what_they_stand_for(spin: str) -> None:
    """Their formulas written out give the same motion and the same matrices, also those of rates
    of coordinates, which were once taken for nothing."""
    short = SLED.replace("2*r.w", spin).replace(
        "HELD", "body.speed: V, spin: 2*W, rel: 0, guess: {other.speed: 3 m/s}"
    )
    long = SLED.replace("HELD", "r.vx: V, r.w: W, der(p): 0, guess: {der(x): 1 m/s}")
    at = {"V": 2.0, "W": 0.3}
    along = {"V": np.array([1.5, 2.5])}
    found, wanted = (
        study(x, motion_of(x, None), at)
        for x in (equations(system(load_text(t))) for t in (short, long))
    )
    got, hand = found.along(along), wanted.along(along)
    assert np.any(np.abs(hand) > 0.1)
    assert np.allclose(got, hand, rtol=1e-11, atol=1e-11)


def test_a_quasi_velocity_of_several_choices_needs_its_choice() -> None:
    text = SLED.replace("HELD", "speed: V, spin: 2*W, rel: 0")
    with pytest.raises(ModelError, match="'speed' is a quasi-velocity of several choices") as error:
        load_text(text)
    assert "body.speed" in str(error.value) and "other.speed" in str(error.value)


def changes(found, name: str, values: np.ndarray):
    def matrix(x):
        return found.along({name: [x]})[0]

    return critical_values(matrix, values, eigenvalues(found.along({name: values})))


@pytest.fixture(scope="module")
def bicycle():
    return studied("bicycle")


@pytest.fixture(scope="module")
def waveboard():
    return studied("waveboard")


# Meijaard, Papadopoulos, Ruina, Schwab (2007), evaluated with 40 digits: weave, capsize, castering.
SPECTRA = {
    0: [3.13164324790655567, -3.13164324790655567, 5.53094371765393464, -5.53094371765393464],
    1: [3.52696170990069417 + 0.807740275199310045j, -3.13423125066578423, -7.11008014637440773],
    2: [2.68234517512745345 + 1.68066296590675776j, -3.07158645641514251, -8.67387984831737163],
    3: [1.70675605663973515 + 2.31582447384324357j, -2.63366137253665296, -10.3510146724592282],
    4: [0.413253315211241321 + 3.07910818603205363j, -1.42944427361325745, -12.1586142657644397],
    5: [-0.775341882195841925 + 4.46486771378822514j, -0.322866429004087078, -14.0783896927982472],
    6: [-1.52644486584141715 + 5.87673060598708403j, -0.00406690076970336242, -16.085371230980284],
    7: [-2.13875644258363428 + 7.19525913329804255j, 0.102681705747664159, -18.1578846612520209],
    8: [-2.69348683581094772 + 8.4603797139693359j, 0.143278797657129498, -20.279408943945663],
    9: [-3.21675402252490747 + 9.69377351531782195j, 0.157901840309172982, -22.4378855904085906],
    10: [-3.72016840437287573 + 10.906811394762882j, 0.161053386531715542, -24.6245963501740002],
}


def test_the_bicycle_has_four_eigenvalues_and_they_are_the_published_ones(bicycle):
    assert bicycle.reduced == ("lean", "steer", "lean_dot", "steer_dot")
    assert len(bicycle.linear.states) == 10 and bicycle.spurious == 0
    found = eigenvalues(bicycle.along({"speed": np.arange(11.0)}))
    for spectrum, wanted in zip(found, SPECTRA.values()):
        everyone = [*wanted, *[x.conjugate() for x in wanted if isinstance(x, complex)]]
        assert len(spectrum) == len(everyone) == 4
        for x in everyone:
            assert np.min(np.abs(spectrum - x)) < 1e-12


def test_the_matrices_of_the_bicycle_come_out_of_the_nonlinear_model(bicycle):
    """M, C1, K0 and K2 of M q̈ + v C1 q̇ + (g K0 + v² K2) q = 0 from the reduced mass matrix and
    force."""
    named = {n.name: n.value for n in bicycle.equations.named}
    x = bicycle.equations.arguments[1].symbols
    mass, slope = (
        evaluator(bicycle.equations, value)
        for value in (named["M_w"], ca.jacobian(named["f_w"], x))
    )
    motions = bicycle.motions({"speed": [0.0, 1.0]})
    at = motions.x, motions.u, motions.p
    T = evaluator(bicycle.equations, bicycle.linear.T)(*at)
    J = (slope(*at) @ T)[:, :2, [3, 4, 7, 8]]
    K, C, g = -J[:, :, :2], -J[:, :, 2:], 9.81
    wanted = {
        "M": (
            [[80.81722, 2.31941332208709135], [2.31941332208709135, 0.29784188199685553]],
            mass(*at)[0, :2, :2],
        ),
        "C1": ([[0, 33.8664139149249439], [-0.85035641456978437, 1.68540397397559674]], C[1]),
        "K0": (
            [[-80.95, -2.59951685249871641], [-2.59951685249871641, -0.803294884586176881]],
            K[0] / g,
        ),
        "K2": ([[0, 76.5973458957322215], [0, 2.65431523794604025]], K[1] - K[0]),
    }
    assert np.max(np.abs(C[0])) < 1e-12  # no damping at rest
    for name, (published, found) in wanted.items():
        assert np.max(np.abs(found - published)) < 1e-12 * np.max(np.abs(published)), name


def test_critical_speeds_of_the_bicycle(bicycle):
    found = changes(bicycle, "speed", np.linspace(0, 10, 21))
    assert [c.kind for c in found] == ["double", "hopf", "zero"]
    published = [0.68428307889245579629, 4.2923825363411039587, 6.0242620153883588899]
    assert [c.value for c in found] == pytest.approx(published, abs=1e-12)
    assert found[0].eigenvalue == pytest.approx(3.78290405129320292, abs=1e-12)
    assert found[1].eigenvalue.imag == pytest.approx(3.4350338486614363036, abs=1e-12)


def test_a_planted_sign_in_the_stiffness_is_seen(bicycle):
    """The multipliers' own stiffness is what beginners forget: without it the eigenvalues are
    others."""
    form = bicycle.linear
    motions = bicycle.motions({"speed": [5.0]})
    # dropping the dependent coordinates' part of T is what forgetting the perturbed constraints
    # does
    T = ca.DM.eye(form.T.size1())[:, list(form.independent)]
    f = next(f.result.value for f in bicycle.equations.functions if f.name == "dynamics")
    J = ca.jacobian(f[list(form.independent)], bicycle.equations.arguments[1].symbols)
    wrong = evaluator(bicycle.equations, ca.mtimes(J, T))(motions.x, motions.u, motions.p)
    right = bicycle.full(motions)
    assert (
        np.max(np.abs(wrong - right)) < 1e-9
    )  # straight ahead the pitch does not follow to first order …
    leaning = motions.x + 0.1 * (np.array(bicycle.equations.arguments[1].labels) == "lean")
    wrong = evaluator(bicycle.equations, ca.mtimes(J, T))(leaning, motions.u, motions.p)
    right = bicycle.A(leaning, motions.u, motions.p)
    assert np.max(np.abs(wrong - right)) > 1e-3  # … in a lean it does


def test_critical_speed_of_a_disk():
    found = studied("rolling_disk")
    assert found.reduced == ("lean", "u1")
    (change,) = changes(found, "speed", np.linspace(0, 8, 9))
    r, g = 0.35, 9.81
    assert change.value == pytest.approx(np.sqrt(g / (3 * r)), abs=1e-12)
    speeds = np.linspace(0, 8, 9)
    squares = eigenvalues(found.along({"speed": speeds}))[:, 0] ** 2
    assert np.max(np.abs(squares - (0.8 * g / r - 2.4 * speeds**2))) < 1e-11


def test_a_pole_on_a_cart():
    """Against the equations of motion written by hand (friction linearised: mu/vs)."""
    found = studied("cart_pole")
    M, m, l, mu, vs, c, g = 1.0, 0.2, 0.6, 0.4, 0.01, 0.001, 9.81
    h = l / 2
    mass = np.array([[M + m, -m * h], [-m * h, m * l**2 / 3]])
    A = np.zeros((4, 4))
    A[:2, 2:] = np.eye(2)
    A[2:] = np.linalg.solve(mass, np.array([[0, 0, -mu / vs, 0], [0, m * g * h, 0, -c]]))
    motions = found.motions({})
    assert np.max(np.abs(found.full(motions)[0] - A)) < 1e-12 * np.max(np.abs(A))
    B = evaluator(found.equations, found.linear.B)(motions.x, motions.u, motions.p)[0]
    assert np.max(np.abs(B[2:] - np.linalg.solve(mass, [[1.0], [0.0]]))) < 1e-13
    assert [found.linear.states[k] for k in found.cyclic] == ["s"]


def test_what_is_not_steady_is_refused():
    with pytest.raises(AssumptionError, match=r"'straight' is no steady motion"):
        studied("rolling_disk", choice="base.wx,base.wy,base.wz")
    text = (
        (MODELS / "hoop.yaml")
        .read_text(encoding="utf-8")
        .replace(", sweep: {speed: [0, 8 rad/s]}", "")
    )
    found = equations(system(load_text(text)))
    with pytest.raises(AssumptionError, match="needs a value for 'speed'"):
        study(found, motion_of(found, "straight"))
    with pytest.raises(AssumptionError, match="did you mean 'straight'"):
        studied("rolling_disk", at="strait")


@pytest.mark.parametrize(
    ("name", "at", "spurious"),
    [
        ("bicycle", None, 8),
        ("rolling_disk", None, 4),
        ("hoop", "upright", 4),
        ("cart_pole", None, 0),
        ("four_bar", "guess", 4),
    ],
)
def test_the_unreduced_equations_agree_and_have_their_spurious_zeros(name, at, spurious):
    found = studied(name, at)
    motions = found.motions({})
    counts = constraint_counts(
        found.equations.system, motions.x[0, : found.equations.system.q.numel()], motions.p[0]
    )
    other = unreduced(
        found.linear, motions, tuple(found.linear.independent[k] for k in found.cyclic)
    )
    assert other.spurious == spurious == 2 * counts[0] + counts[1]
    assert other.difference < 1e-9 and other.nilpotent < 1e-9


def test_sensitivities_are_the_slopes_of_the_eigenvalues(bicycle):
    for mode in modes(bicycle):
        for name in ("speed", "c", "IFyy", "lam"):
            step = 1e-5 * bicycle.at[name]
            pair = eigenvalues(
                bicycle.along({name: [bicycle.at[name] + step, bicycle.at[name] - step]})
            )
            above, below = (row[np.argmin(np.abs(row - mode.eigenvalue))] for row in pair)
            assert abs(mode.sensitivity[name] - (above - below) / (2 * step)) < 1e-6 * (
                1 + abs(mode.sensitivity[name])
            )


def test_the_printed_equations_of_the_disk_have_the_closed_form_as_their_eigenvalues():
    """λ² = (4/5) g/r − (12/5) Ω², symbolically, from the formulas on the page of the derivation."""
    found = equations(system(load(MODELS / "rolling_disk.yaml")))
    page = {formula.name: formula.right for formula in printed(found)}
    mass, slopes = page["M_w at"], page["K at"]
    A = sympy.Matrix(page["A rates"]).col_join(mass.inv() * slopes)
    r, u2 = sympy.symbols("r u2")
    A = A.subs({symbol: 9.81 for symbol in A.free_symbols if str(symbol).startswith("g")})
    assert A.free_symbols == {r, u2}  # the mass is gone
    polynomial = sympy.factor(
        sympy.nsimplify(A.charpoly(sympy.Symbol("L")).as_expr(), rational=True)
    )
    wanted = sympy.Rational(4, 5) * sympy.Rational(981, 100) / r - sympy.Rational(12, 5) * u2**2
    assert (
        sympy.simplify(polynomial - sympy.Symbol("L") ** 2 * (sympy.Symbol("L") ** 2 - wanted)) == 0
    )


def test_hoop_in_closed_form():
    r, g = 0.4, 9.81
    (rolling,) = changes(studied("hoop"), "speed", np.linspace(0, 8, 9))
    assert rolling.value == pytest.approx(np.sqrt(g / (4 * r)), abs=1e-12)
    (spinning,) = changes(studied("hoop", "upright"), "turn", np.linspace(0, 8, 9))
    assert spinning.value == pytest.approx(np.sqrt(2 * g / (3 * r)), abs=1e-12)


def test_steady_turning_is_continued_and_satisfies_its_equation():
    found = studied("hoop", "turning")
    leans = np.linspace(0.02, 0.5, 7)
    x = found.motions({"lean0": leans}).x
    m, r, g = 1.5, 0.4, 9.81
    A, C, turn = m * r**2 / 2, m * r**2, 1.0
    labels = found.equations.arguments[1].labels
    w2 = x[:, labels.index("u2")]
    balance = (
        (-A * turn**2 * np.sin(leans) * np.cos(leans))
        + (C + m * r**2) * w2 * turn * np.cos(leans)
        + m * g * r * np.sin(leans)
    )
    assert np.max(np.abs(balance)) < 1e-12 * m * g * r


def test_a_held_input_and_a_free_one():
    found = studied("ball_on_beam", s0=0.2)
    motions = found.motions({})
    assert motions.u[0, 0] == pytest.approx(
        0.11 * 9.81 * 0.2, rel=1e-13
    )  # the torque that holds the ball's weight


def test_the_waveboard_is_never_self_stable_as_given(waveboard):
    """Straight ahead det A keeps its sign whatever the speed: the capsize mode of a board alike at
    both ends cannot pass zero."""
    found = waveboard
    motions = found.motions({})
    other = unreduced(
        found.linear, motions, tuple(found.linear.independent[k] for k in found.cyclic)
    )
    assert other.spurious == 8 and other.difference < 1e-9 and other.nilpotent < 1e-9
    assert found.spurious == 0 and len(found.linear.states) == 14 and len(found.reduced) == 8
    speeds = np.linspace(0.5, 8, 6)
    for name, values in (
        ("eps", (0.2, 0.5)),
        ("kt", (200.0, 900.0)),
        ("mu", (0.1, 0.9)),
        ("mr", (10.0, 90.0)),
    ):
        for value in values:
            A = found.along({"speed": speeds, name: np.full(6, value)})
            assert np.all(eigenvalues(A).real.max(axis=1) > 0), (name, value)
            assert len(set(np.sign(np.linalg.det(A)))) == 1, (name, value)


def test_the_page_is_one_file_without_network(tmp_path):
    record = hamel.linearize(
        MODELS / "hoop.yaml", at="straight", sweep={"speed": "0:8:9"}, out=tmp_path / "hoop.html"
    )
    text = (tmp_path / "hoop.html").read_text(encoding="utf-8")
    assert record.page == tmp_path / "hoop.html"
    assert "<math" in text and "<animate " in text and "2.47613610" in text
    assert not re.search(r"e-1[4-9]|e-[23]\d", text[text.index("What the eigenvalues depend on") :])
    assert not re.search(r"<script|<link|@import|url\(|src=", text)
    assert set(re.findall(r"https?://[^\"' <]+", text)) <= {"http://www.w3.org/2000/svg"}
    ElementTree.fromstring(re.search(r"<svg.*?</svg>", text, re.DOTALL)[0])


def test_two_names_make_a_map_and_bad_ranges_are_said(tmp_path):
    record = hamel.linearize(
        MODELS / "hoop.yaml",
        sweep={"r": "0.3 m:0.5 m:2", "speed": "0:8:3"},
        out=tmp_path / "map.html",
    )
    assert len(record.rows) == 6 and set(record.rows[0]) == {
        "r",
        "speed",
        "eigenvalues",
        "spurious",
    }
    assert [row["spurious"] for row in record.rows] == [0] * 6
    for bad, said in (
        ({"speed": "0"}, "first:last"),
        ({"speed": "0:1:x"}, "whole count"),
        ({"sped": "0:1:3"}, "did you mean 'speed'"),
    ):
        with pytest.raises(HamelError, match=said):
            hamel.linearize(MODELS / "hoop.yaml", sweep=bad)


@pytest.mark.slow
def test_the_bicycle_on_tyres_becomes_the_one_on_knife_edges(bicycle):
    """A thin tyre is a knife edge; a tyre of 2 cm moves the weave speed."""
    found = studied("extremes/bicycle_toroidal")
    speeds = np.array([2.0, 5.0, 8.0])
    thin = eigenvalues(
        found.along({"speed": speeds, "tR": np.full(3, 1e-9), "tF": np.full(3, 1e-9)})
    )
    assert np.max(np.abs(thin - eigenvalues(bicycle.along({"speed": speeds})))) < 1e-6
    weave = next(c.value for c in changes(found, "speed", np.linspace(3, 6, 4)) if c.kind == "hopf")
    assert abs(weave - 4.2923825363411) > 0.01


def test_the_walk_through_says_what_is_found(bicycle):
    text = (MODELS.parent / "docs" / "bicycle.md").read_text(encoding="utf-8")
    model = (MODELS / "bicycle.yaml").read_text(encoding="utf-8")
    for line in re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)[1].splitlines():
        assert line in model.splitlines()
    printed_values = [float(x) for x in re.findall(r"at speed = ([\d.]+)", text)]
    assert printed_values == pytest.approx(
        [0.68428307889245579629, 4.2923825363411039587, 6.0242620153883588899], abs=1e-12
    )
    assert "hamel linearize" in text and "spurious" in text


@pytest.mark.slow
def test_zeros_are_taken_out_whichever_way_they_are_named(bicycle):
    """All as families, some by name, all as cyclic: the same four eigenvalues."""
    motion = motion_of(bicycle.equations, None)
    wanted = eigenvalues(bicycle.along({}))
    for cyclic in ((), ("x", "rear_spin")):
        found = study(bicycle.equations, motion, {}, cyclic)
        assert sum(map(len, found.families)) + len(found.cyclic) == 6
        assert np.max(np.abs(eigenvalues(found.along({})) - wanted)) < 1e-9
    with pytest.raises(AssumptionError, match="'lean' is not cyclic"):
        study(bicycle.equations, motion, {}, ("lean",))


def test_equilibria_are_found_from_the_initial_values():
    hanging = studied("pendulum", "guess")
    assert hanging.motions({}).x[0, :2] == pytest.approx([0.0, -1.0], abs=1e-9)
    assert eigenvalues(hanging.along({}))[0] == pytest.approx(
        [1j * np.sqrt(9.81), -1j * np.sqrt(9.81)], abs=1e-9
    )
    with pytest.raises(AssumptionError, match="depends on time"):
        studied("car_axis", "guess")
    with pytest.raises(AssumptionError, match="no steady motion was found near the initial values"):
        studied("screw_press", "guess")


ROD = """
model: rod
gravity: [-9.81 m/s^2, 0, 0]
bodies: {b: {mass: 1 kg, com: [0, 0, -0.2], inertia: [0.02, 0.03, 0.01]}}
joints: {J: {type: ball, parent: ground, child: b, orientation: {euler: EULER, angles: [a, n, c]}}}
initial: {n: 90 deg}
"""


@pytest.mark.parametrize("angle", ["90 deg", "90.0000001 deg"])
def test_no_slopes_at_gimbal_lock(angle):
    """Half of what the rod does was lost there, without a word."""
    locked = equations(system(load_text(ROD.replace("EULER", "xyz").replace("90 deg", angle))))
    with pytest.raises(AssumptionError, match=r"a, c change without bound .* gimbal lock") as told:
        study(locked, motion_of(locked, "guess")).motions({})
    assert "orientation: quaternion" in str(told.value)


def test_a_rod_by_angles_that_are_regular_where_it_hangs():
    """±i √(m g l / I) of both axes, I about the point that holds it."""
    text = ROD.replace("EULER", "yzx").replace("n: 90 deg", "a: 90 deg")
    e = equations(system(load_text(text)))
    values = eigenvalues(study(e, motion_of(e, "guess")).along({}))[0]
    for inertia in (0.02 + 0.04, 0.03 + 0.04):
        assert min(abs(values - 1j * np.sqrt(1.962 / inertia))) < 1e-9


def test_a_fast_oscillation_of_something_small_is_no_family():
    """In SI its matrix, [0 1; -1e11 -1e4], is singular to eleven digits."""
    text = """
model: plate
coordinates: {y: m}
parameters: {m: 2.3e-11 kg, k: 2.5 N/m, d: 3e-7 N*s/m, g: 2e-6 m}
kinetic: m/2*der(y)^2
potential: k/2*(y - g/100)^2
forces: {y: -d*der(y)}
"""
    found = equations(system(load_text(text)))
    result = study(found, motion_of(found, None))
    assert result.families == () and result.cyclic == ()
    decay, rate = 3e-7 / 4.6e-11, np.sqrt(2.5 / 2.3e-11 - (3e-7 / 4.6e-11) ** 2)
    wanted = [complex(-decay, rate), complex(-decay, -rate)]
    assert eigenvalues(result.along({}))[0] == pytest.approx(wanted, rel=1e-10)


ORBIT = """
model: orbit
coordinates: {x: m, y: m, z: m}
parameters: {mu: 3.986004418e14 m^3/s^2, J2: 1.08263e-3, R: 6378137 m, m: 500 kg}
where: {r: "sqrt(x^2 + y^2 + z^2)"}
kinetic: m/2*(der(x)^2 + der(y)^2 + der(z)^2)
potential: "-m*mu/r*(1 - J2*(R/r)^2*(3*(z/r)^2 - 1)/2)"
initial: {x: 7000 km, der(y): 5 km/s, der(z): 5.6 km/s}
outputs: {alt: r - R}
"""


def test_an_orbit_has_no_cyclic_positions():
    """Slopes of 1e-6 per second squared and less are small in SI alone."""
    assert cyclic_coordinates(equations(system(load_text(ORBIT)))) == ()


def test_a_search_that_runs_away_finds_no_motion():
    """Far enough out nothing pushes any more, and steps go on: from rest, 1e14 m away."""
    found = equations(system(load_text(ORBIT)))
    with pytest.raises(AssumptionError, match="no steady motion was found"):
        study(found, motion_of(found, None))


def test_a_singular_position_has_no_linear_equations():
    """A parallelogram in a line may go on as another linkage."""
    found = equations(system(load_text(FLAT)))
    said = (
        "'guess' is at a singular configuration of flat: .*; 2 speeds are free there, 1 elsewhere"
    )
    with pytest.raises(AssumptionError, match=said):
        study(found, motion_of(found, None))


@pytest.mark.parametrize(
    ("entry", "said", "expected"),
    [
        ("{th: 0, push: 3 rad}", "a steady motion in rad", "N"),
        ("{th: 0, push: free, guess: {th: 1 rad}}", "'th' is held and guessed", "one of the two"),
        ("{th: 0, cyclic: [q]}", "unknown coordinate 'q'", "s, th"),
        (
            "{th: 0, sweep: {ll: [1 m, 2 m]}}",
            "'ll' is neither free in this motion nor a parameter",
            "did you mean 'l'?",
        ),
        ("{th: 0, sweep: {l: [1 m, 1 m]}}", "the range of 'l'", "two different values"),
        ("{th: 0, guess: 3}", "'guess' is not a mapping", "names and numbers"),
        ("{th: free}", "'th' is free", "only inputs can be called free"),
        ("{der(s): speed, guess: {speed: 1 m/s}}", "'speed' is free to choose", "--set speed="),
        ("{th: [0]}", "'th' is a list or mapping", "a formula"),
    ],
)
def test_mistakes_in_a_steady_motion_are_shown_where_they_are(entry, said, expected):
    text = (
        (MODELS / "cart_pole.yaml")
        .read_text(encoding="utf-8")
        .replace("{s: 0 m, th: 0 rad}", entry)
    )
    line = next(k for k, x in enumerate(text.splitlines(), start=1) if "upright:" in x)
    with pytest.raises(ModelError) as refused:
        load_text(text, "cart.yaml")
    message = str(refused.value)
    assert (
        message.startswith(f"cart.yaml:{line}:")
        and said in message
        and expected in message
        and "^" in message
    )


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["--sweep", "speed=1:nan:3"], 1, "it is a finite number"),
        (["--set", "speed=3 kg"], 1, "no quantity in rad/s"),
        (["--set", "sped=3"], 1, "did you mean 'speed'"),
        (["--cyclic", "foo"], 2, "unknown coordinate 'foo'"),
        (["--cyclic", "lean"], 2, "not cyclic"),
        (
            ["--choice", "base.wx,base.wy,base.wz"],
            2,
            "rolling_disk.yaml:16:3: error: 'straight' is no steady motion",
        ),
        (["--sweep", "r=0:0:2"], 2, "singular"),
        (["--step", "-1"], 64, "positive number"),
        (["--sweep", "r=1:2:3", "--sweep", "r=1:2:3"], 64, "'r' has 2 values"),
    ],
)
def test_mistakes_on_the_command_line_are_answered(arguments, code, said, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["linearize", str(MODELS / "rolling_disk.yaml"), *arguments])
    told = capsys.readouterr().err
    assert (
        ended.value.code == code
        and said in told
        and "Traceback" not in told
        and "internal" not in told
    )


def test_the_command_writes_its_page_here_unless_a_program_reads(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for arguments, there in ((["--json"], False), ([], True)):
        with pytest.raises(SystemExit) as ended:
            main(["linearize", str(MODELS / "rolling_disk.yaml"), *arguments])
        assert ended.value.code in (0, None) and (tmp_path / "linearization.html").exists() is there
    capsys.readouterr()


def test_a_board_with_unlike_ends_falls_more_slowly(waveboard):
    """What docs/waveboard.md says of `de`: the real eigenvalue becomes a slow oscillation, still
    growing."""
    values = eigenvalues(waveboard.along({"speed": [3.0], "de": [np.radians(7.5)]}))[0]
    assert values[0].real == pytest.approx(0.496, abs=1e-3) and values[0].imag > 0
    assert eigenvalues(waveboard.along({"speed": [3.0]}))[0, 0].real > 2


@pytest.mark.parametrize("size", ["micrometre", "metre", "megametre"])
def test_the_metre_does_not_matter(size):
    """A pendulum of each length swings at √(g/l) or falls off at it, and the generated function
    answers at the start."""
    model = load(MODELS / "extremes" / f"scale_{size}.yaml")
    found = studied(f"extremes/scale_{size}")
    values = {p.name: p.value for p in model.parameters}
    squares = eigenvalues(found.along({}))[0] ** 2
    assert np.abs(squares) == pytest.approx(values["g"] / values["l"], rel=1e-9)
    chosen = with_linearization(equations(system(model)))
    function = next(
        request for request in chosen.requests if request.name == "linearization"
    ).function
    margins = [guard.value / guard.tolerance for guard in function.guards]
    start = initial_state(chosen.system)
    x = np.concatenate([start.q, [0.0]])
    at = ca.Function("margins", [a.symbols for a in chosen.arguments], [ca.vertcat(*margins)])
    assert np.min(np.abs(at(0.0, x, [], chosen.parameters).full())) > 1e3


TABLES = ("", ' class="stacked"')


def test_the_page_of_a_bicycle_gives_its_verdict_in_one_line(tmp_path):
    """Not with the 25 parameters; rounding is no real part, letters are those of the file, and the
    equation is in parts, each of which fits a narrow screen."""
    record = hamel.linearize(
        MODELS / "bicycle.yaml", sweep={"speed": "0:10:5"}, out=tmp_path / "bicycle.html"
    )
    page = record.page.read_text("utf-8")
    verdict = re.search(r"In one line</h2>\s*<p>(.*?)</p>", page, re.DOTALL)[1]
    assert "No mode grows at speed = 5." in verdict and "IRxx" not in verdict
    assert ">0 ± 3.43503 i</td>" in page and ">6.0242620154</td>" in page
    equation = re.search(r'<div class="equation">(.*?)</div>', page, re.DOTALL)[1]
    assert (
        equation.count("<math") == 3 and "&#x003D5;" not in equation and "φ" in unescape(equation)
    )
    titles = {how: re.findall(rf"<table{how}><thead><tr><th>(.*?)</th>", page) for how in TABLES}
    assert "what happens" in titles[' class="stacked"'], "rows as lines on a phone"
    assert "constant" in titles[""], "a narrow one stays a table"


@pytest.mark.parametrize(
    ("pair", "text"),
    [
        ((-2.0, 24.5), "-2+24.5i"),
        ((2.8e-17, -6.27279), "-6.27279i"),
        ((-5.5, 1e-14), "-5.5"),
        ((0.0, 0.0), "0"),
    ],
)
def test_what_rounding_leaves_of_a_part_is_not_shown(pair, text):
    assert linearized_text(pair) == text


SLEIGH_ON_ITS_EDGE = """
model: sleigh
coordinates: {x: m, y: m, th: rad}
parameters: {m: 2 kg, I: 0.1 kg*m^2, a: 0.1 m, F: 5 N}
kinetic: m/2*((der(x)-a*sin(th)*der(th))^2 + (der(y)+a*cos(th)*der(th))^2) + I/2*der(th)^2
forces: {x: -F*cos(th), y: -F*sin(th)}
constraints: {edge: {nonholonomic: der(y)*cos(th) - der(x)*sin(th)}}
initial: {der(th): 5 rad/s, th: 30 deg}
"""


def test_no_motion_is_steady_where_the_choice_is_singular():
    """y_dot = u sin θ rests where sin θ = 0, whatever u does. Along (u, θ̇) the sleigh spins at
    √(F/ma) = 5 rad/s, and swings by ±i θ̇ /√(1 + I/ma²) √2 about that."""
    model = load_text(SLEIGH_ON_ITS_EDGE)
    found = equations(system(model))
    with pytest.raises(AssumptionError, match="singular near the steady motion 'guess'"):
        study(found, motion_of(found, None))
    found = equations(system(model), choice="orthonormal")
    result = study(found, motion_of(found, None))
    size = 5 * np.sqrt(2 / (1 + 0.1 / (2 * 0.1**2)))
    assert eigenvalues(result.along({}))[0] == pytest.approx([size * 1j, -size * 1j], abs=1e-8)


DISK = """model: disk
gravity: [0, 0, -9.81 m/s^2]
parameters: {m: 0.4 kg, r: 37.5 mm}
bodies: {d: {mass: m, inertia: [m*r^2/4, m*r^2/4, m*r^2/2]}}
joints:
  j:
    type: free
    parent: ground
    child: d
    position: [x, y, z]
    orientation: {euler: zxz, angles: [psi, th, phi]}
constraints:
  c: {type: rolling, body: d, shape: {disk: {radius: r, axis: z}}, plane: {normal: z}}
quasi_velocities: {w: [der(th), der(psi), der(phi)]}
steady_motion:
  spin:
    th: tilt
    der(th): 0
    der(psi): 30 rad/s
    guess: {der(phi): -26 rad/s, z: 24 mm}
    sweep: {tilt: [20 deg, 80 deg, ROWS]}
initial: {th: 40 deg, der(psi): 20 rad/s, der(phi): -18 rad/s, guess: {z: 24 mm}}
"""


def test_a_coarse_sweep_goes_by_motions_between(tmp_path):
    """From 20° to 40° is too far at once; each row is the motion with that number in the file."""
    path = tmp_path / "disk.yaml"
    path.write_text(DISK.replace("ROWS", "4"), "utf-8")
    rows = hamel.linearize(path, out=tmp_path / "sweep.html").rows
    assert [round(np.degrees(row["tilt"])) for row in rows] == [20, 40, 60, 80]
    for row in rows:
        plain = re.sub(r" *sweep: .*\n", "", DISK).replace("th: tilt", f"th: {row['tilt']!r} rad")
        path.write_text(plain, "utf-8")
        alone = hamel.linearize(path, out=tmp_path / "alone.html")
        fastest = max(abs(complex(*x)) for x in row["eigenvalues"])
        assert fastest == pytest.approx(np.abs(np.linalg.eigvals(np.array(alone.A))).max(), 1e-9)


def test_what_was_held_is_said_where_there_is_no_steady_motion(tmp_path):
    path = tmp_path / "disk.yaml"
    none = DISK.replace("ROWS", "4").replace("der(th): 0\n", "der(th): 1 rad/s\n")
    path.write_text(none, "utf-8")
    with pytest.raises(AssumptionError, match=r"'spin' is no steady motion with tilt = \d"):
        hamel.linearize(path, out=tmp_path / "sweep.html")


ONE_WAY = """
model: one_way
plane: xy
bodies: {a: {mass: 1 kg}, b: {mass: 1 kg, inertia: 1}}
joints:
  A: {type: prismatic, parent: ground, child: a, axis: x, coordinate: s, spring: {stiffness: 1 N/m}, damper: 0.1 N*s/m}
  B: {type: revolute, parent: ground, child: b, coordinate: q, spring: {stiffness: 9 N*m/rad}, damper: 0.1 N*m*s/rad}
loads: {c: {type: expression, joint: A, expression: (1 N)*q}}
steady_motion: {rest: {s: 0 m, q: 0}}
"""


def test_what_is_rounding_does_not_move_in_a_mode(tmp_path):
    """s does not act on q, which is the only one with its unit."""
    file = tmp_path / "one_way.yaml"
    file.write_text(ONE_WAY)
    found = hamel.linearize(file, out=tmp_path / "page.html")
    assert [mode.shape for mode in found.modes] == ["s 1; q 1", "s 1"]


TOP = """
model: top
gravity: [0, 0, -9.81 m/s^2]
parameters: {m: 0.5 kg, l: 0.08 m, A: 0.002 kg*m^2, C: 0.0006 kg*m^2}
bodies: {g1: {mass: 0}, g2: {mass: 0}, top: {mass: m, com: [0, 0, l], inertia: [A, A, C]}}
joints:
  x: {type: revolute, parent: ground, child: g1, axis: x, coordinate: a}
  y: {type: revolute, parent: g1, child: g2, axis: y, coordinate: b}
  z: {type: revolute, parent: g2, child: top, axis: z, coordinate: c}
steady_motion:
  sleep: {a: 0, b: 0, der(a): 0, der(b): 0, der(c): spin, sweep: {spin: [10, 200 rad/s]}}
"""


@pytest.mark.parametrize("count", [20, 57])
def test_where_two_pairs_meet_on_the_imaginary_axis_the_digits_hold(tmp_path, count):
    """A sleeping top: C spin = 2 √(A m g l) with A about the point, and half of that precession."""
    file = tmp_path / "top.yaml"
    file.write_text(TOP)
    sweep = {"spin": f"10:200:{count}"}
    (critical,) = hamel.linearize(file, sweep=sweep, out=tmp_path / "page.html").critical
    about, weight = 0.002 + 0.5 * 0.08**2, 0.5 * 9.81 * 0.08
    speed = 2 * np.sqrt(about * weight) / 0.0006
    assert critical.kind == "hopf" and abs(critical.value - speed) < 1e-11 * speed
    turning = 0.5 * 0.0006 * speed / about
    assert abs(complex(*critical.eigenvalue) - 1j * turning) < 1e-9 * turning


def test_a_turning_quaternion_is_told_to_be_one(tmp_path):
    text = TOP.partition("joints:")[0].replace("g1: {mass: 0}, g2: {mass: 0}, ", "")
    text += "joints: {u: {type: ball, parent: ground, child: top}}\n"
    text += "steady_motion: {sleep: {u.wx: 0 rad/s, u.wy: 0 rad/s, u.wz: 9 rad/s}}\n"
    file = tmp_path / "top.yaml"
    file.write_text(text)
    with pytest.raises(AssumptionError, match="its quaternion turns along"):
        hamel.linearize(file, out=tmp_path / "page.html")


EULER_TOP = """
model: top
gravity: [0, 0, -9.81]
bodies: {top: {mass: 2 kg, com: [0, 0, 0.1], inertia: {tensor: [0.025, 0.025, 0.005], about: origin}}}
joints: {j: {type: ball, parent: ground, child: top, orientation: {euler: xyz, angles: [a, b, c]}}}
initial: {a: 0, j.wz: 60}
"""
HELD = "steady_motion: {sleep: {a: 0, b: 0, j.wx: 0, j.wy: 0, j.wz: 60}}\n"
SAID = "steady_motion: {sleep: {a: 0, b: 0, j.wz: 60, cyclic: [c]}}\n"
RATES = "quasi_velocities: {euler: [der(a), der(b), der(c)]}"


ROLLING = """
model: rolling_tyre
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 10 kg, J: 0.4 kg*m^2, r: 0.2 m, c: 3 N*s/m}
bodies: {wheel: {mass: m, inertia: J}}
joints: {sus: {type: planar, parent: ground, child: wheel, coordinates: [x, y, a]}}
loads:
  tyre: {type: contact, body: wheel, shape: {wheel: {radius: r}}, plane: {normal: [0, 1]},
         stiffness: 1e5 N/m, damping: 0.5 s/m, smoothing: 1 mm/s,
         tyre: {longitudinal: {pacejka: [10, 1.5, 1.0, 0.2]}}}
  air: {type: damper, coordinate: x, coefficient: c}
  drive: {type: torque, body: wheel, components: -T}
inputs: {T: {unit: N*m}}
initial: {x: 0 m, y: 0.199 m, sus.vx: 4 m/s, sus.w: -20 rad/s}
steady_motion: {roll: {der(x): 4 m/s, T: free, guess: {y: 0.199 m, sus.w: -20.1 rad/s}}}
"""


def test_axes_that_turn_with_a_wheel_are_told_with_what_to_declare(tmp_path):
    """Nothing depends on the angle but the axes of sus.vx and sus.vy; it was der(x) that missed."""
    path = tmp_path / "tyre.yaml"
    path.write_text(ROLLING)
    with pytest.raises(
        AssumptionError, match="sus_vx, sus_vy are along axes that turn with a"
    ) as e:
        hamel.linearize(path)
    declared = "quasi_velocities: {rates: [der(x), der(y), der(a)]}"
    assert declared in str(e.value)
    path.write_text(f"{ROLLING}{declared}\n")
    assert hamel.linearize(path).cyclic == ("x", "a")


BALL = """
model: ball_on_floor
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 0.3 kg, k: 2e4 N/m, d: 0.2 s/m}
bodies: {ball: {mass: m}}
joints: {fly: {type: point, parent: ground, child: ball, coordinates: [x, y]}}
loads: {floor: {type: contact, body: ball, plane: {normal: [0, 1]}, stiffness: k, damping: d}}
initial: {y: 1 m}
"""


def test_initial_values_that_are_set_are_where_the_search_starts(tmp_path):
    """From 1 m the ball never feels the floor; what the file holds cannot be set so."""
    path = tmp_path / "ball.yaml"
    path.write_text(BALL)
    with pytest.raises(AssumptionError, match="`initial:` of the file, or --set"):
        hamel.linearize(path)
    found = hamel.linearize(path, values={"y": "-0.1 mm", "m": 0.4})
    assert found.steady["y"] == pytest.approx(-0.4 * 9.81 / 2e4)
    path.write_text(f"{BALL}steady_motion: {{lie: {{x: 0 m}}}}\n")
    assert hamel.linearize(path, values={"y": -1e-4}).steady["y"] == pytest.approx(-1.4715e-4)
    with pytest.raises(ModelError, match="the steady motion 'lie' holds 'x'"):
        hamel.linearize(path, values={"x": 1.0})


def test_a_height_that_only_a_contact_knows_is_not_cyclic(tmp_path):
    """None of the random states touches the floor; the ball lies on it, and swings there."""
    path = tmp_path / "ball.yaml"
    path.write_text(BALL.replace("ball_on_floor", "ball_that_lies"))
    found = hamel.linearize(path, values={"y": -1e-4})
    assert found.cyclic == ("x",)
    assert abs(complex(*found.rows[0]["eigenvalues"][0])) == pytest.approx(np.sqrt(2e4 / 0.3))
    with pytest.raises(AssumptionError, match="'y' is not cyclic"):
        hamel.linearize(path, values={"y": -1e-4}, cyclic=["y"])


def test_a_wheel_at_rest_is_refused_for_what_it_misses(tmp_path):
    """No axis turns where the wheel does not: it cannot hang in the air."""
    path = tmp_path / "tyre.yaml"
    held = "steady_motion: {hang: {y: 1 m, guess: {sus.w: 0 rad/s}}}"
    path.write_text(ROLLING.replace("rolling_tyre", "hanging_tyre").partition("steady")[0] + held)
    with pytest.raises(AssumptionError) as told:
        hamel.linearize(path)
    assert "'hang' is no steady motion" in str(told.value) and "axes" not in str(told.value)


@pytest.mark.parametrize(
    ("steady", "problem"),
    [(HELD, "j_wx, j_wy are along axes that turn with c"), (SAID, "'c' is not cyclic")],
)
def test_a_body_that_turns_by_its_angles_wants_their_rates(steady, problem, tmp_path):
    path = tmp_path / "top.yaml"
    path.write_text(EULER_TOP + steady)
    with pytest.raises(AssumptionError, match=problem) as told:
        hamel.linearize(path)
    assert "[der(a), der(b), der(c)]}" in str(told.value)
    path.write_text(EULER_TOP + steady + RATES)
    assert "c" in hamel.linearize(path).cyclic
