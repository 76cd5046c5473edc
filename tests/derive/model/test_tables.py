"""Functions in pieces and tables: they are what the formulas by hand are, the reference has its own
spline, and what is no table is refused where it stands.

Of derive.expressions: pieces, tables.
Of derive.model: kinks, tables.
Of hamel.simulate: kinks.
Of hamel.verify.reference: tables.
"""

import math
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hamel
from derive.diagnostics import ModelError
from derive.expressions.evaluate import casadi_tables, float_functions, float_tables
from derive.expressions.tables import Table
from derive.mechanics.records import System
from derive.model import load_text
from derive.model.kinks import pieces, switches
from hamel.build.stages import mechanics_of
from hamel.verify.checks.motion import sides
from hamel.verify.reference.outcome import evaluate, reference, state_of
from hamel.verify.reference.tables import numeric, symbolic

GALLERY = Path(__file__).parents[3] / "models" / "gallery"
BEAD = """model: bead
coordinates: {{x: m}}
parameters: {{m: 2 kg, w: 0.1 m}}
tables: {{f: {{points: [[0, 0], [1, 2], [2, 3], [4, -1]], units: [m, N], smooth: {smooth}}}}}
kinetic: m/2*der(x)^2
forces: {{x: "{force}"}}
"""


def bead(force: str, smooth: str = "C2") -> System:
    return mechanics_of(load_text(BEAD.format(force=force, smooth=smooth)))


def forces(system: System, at: np.ndarray) -> np.ndarray:
    function = ca.Function("Q", [system.t, system.q, system.v, system.u, system.p], [system.Q])
    p = list(system.parameters)
    return np.array([float(function(0.0, x, 0.5, [], p)) for x in at])


STATES = np.random.default_rng(1).uniform(-3.0, 5.0, 200)
BY_HAND = [
    ("(1 N)*step(x - 1 m)", lambda x: float(x >= 1)),
    ("(1 N/m)*ramp(x - 1 m)", lambda x: max(x - 1, 0.0)),
    ("(1 N/m)*clip(x, -1 m, 2 m)", lambda x: min(max(x, -1.0), 2.0)),
    ("(1 N)*step(x - 1 m, w)", lambda x: 0.5 + 0.5 * math.tanh((x - 1) / 0.1)),
    ("(1 N/m)*ramp(x, w)", lambda x: (x + math.hypot(x, 0.1)) / 2),
    (
        "(1 N/m)*clip(x, -1 m, 2 m, w)",
        lambda x: 0.5 + (math.hypot(x + 1, 0.1) - math.hypot(x - 2, 0.1)) / 2,
    ),
    (
        "piecewise(x, 1 N, 0 m, (2 N/m)*x, 1.5 m, (3 N/m^2)*x^2)",
        lambda x: 1.0 if x < 0 else 2 * x if x < 1.5 else 3 * x**2,
    ),
    ("(1 N/m)*(x - ramp(x - w))", lambda x: min(x, 0.1)),
]


@pytest.mark.parametrize("formula, by_hand", BY_HAND)
def test_pieces_are_the_formulas_by_hand(formula: str, by_hand) -> None:
    wanted = [by_hand(x) for x in STATES]
    assert forces(bead(formula), STATES) == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("formula", [formula for formula, _ in BY_HAND])
def test_the_reference_reads_pieces_on_its_own(formula: str) -> None:
    system = bead(formula)
    ref = reference(system.model)
    found = [
        evaluate(ref, state_of(ref, 0.0, np.array([x]), np.array([0.5]))).vdot[0]
        for x in STATES[:20]
    ]
    assert forces(system, STATES[:20]) / 2.0 == pytest.approx(found, abs=1e-12)


@pytest.mark.parametrize("smooth", ["C1", "C2"])
@pytest.mark.parametrize("points", [2, 3, 12])
def test_splines_go_through_their_points_and_agree_with_the_reference(
    smooth: str, points: int
) -> None:
    random = np.random.default_rng(points)
    x = np.cumsum(random.uniform(0.1, 2.0, points))
    table = Table("f", tuple(x), tuple(random.normal(size=points)), ("", ""), smooth)
    own = float_tables([table])["f"]
    other = numeric([table])
    places = np.concatenate([x, random.uniform(x[0] - 1.0, x[-1] + 1.0, 200)])
    assert [own(at) for at in x] == pytest.approx(table.y, abs=1e-13)
    assert [own(at) for at in places] == pytest.approx([other["f"](at) for at in places], abs=1e-12)
    at = ca.SX.sym("x")
    slope = ca.Function("d", [at], [ca.jacobian(casadi_tables([table])["f"](at), at)])
    inside = places[points:]
    assert [float(slope(z)) for z in inside] == pytest.approx(
        [other["f__1"](z) for z in inside], abs=1e-11
    )
    if smooth == "C1":
        fine = [own(z) for z in np.linspace(x[0], x[-1], 400)]
        assert min(table.y) - 1e-12 <= min(fine) and max(fine) <= max(table.y) + 1e-12


def test_the_natural_spline_is_that_of_a_library() -> None:
    interpolate = pytest.importorskip("scipy.interpolate")
    table = Table("f", (0.0, 1.0, 2.5, 3.0, 7.0), (1.0, -1.0, 2.0, 0.0, 4.0), ("", ""), "C2")
    wanted = interpolate.CubicSpline(table.x, table.y, bc_type="natural")
    places = np.linspace(0.0, 7.0, 50)
    own = float_tables([table])["f"]
    assert [own(at) for at in places] == pytest.approx(wanted(places), abs=1e-12)


def test_derivatives_of_tables_by_sympy_end() -> None:
    import sympy

    f = symbolic([Table("f", (0.0, 1.0), (0.0, 1.0), ("", ""), "C2")])["f"]
    x = sympy.Symbol("x")
    assert str(sympy.diff(f(x**2), x)) == "2*x*f__1(x**2)"
    assert sympy.diff(f(x), x, 5) == 0


def test_a_wrong_table_is_seen_by_the_reference() -> None:
    system = bead("f(x)")
    model = system.model
    wrong = replace(model.tables[0], y=(0.0, 2.001, 3.0, -1.0))
    ref = reference(replace(model, tables=(wrong,)))
    found = evaluate(ref, state_of(ref, 0.0, np.array([1.2]), np.array([0.5]))).vdot[0]
    own = forces(system, np.array([1.2]))[0] / 2.0
    assert abs(found - own) > 1e-5


def test_a_number_of_pieces_has_no_value_where_it_is_not_chosen() -> None:
    functions = float_functions()
    assert functions["piecewise"](0.5, 1.0, 1.0, 2.0, 2.0, 3.0) == 1.0
    assert functions["piecewise"](1.0, 1.0, 1.0, 2.0, 2.0, 3.0) == 2.0
    assert functions["piecewise"](9.0, 1.0, 1.0, 2.0, 2.0, 3.0) == 3.0


HEAD = "model: a\ncoordinates: {x: m}\nkinetic: (1 kg)*der(x)^2\n"
WRONG = [
    ("tables: {f: {points: [[0, 1], [0, 2]]}}", "4:31: error: x = 0 after x = 0", "increasing"),
    ("tables: {f: {points: [[0, 1]]}}", "4:10: error: the table 'f' of 1 points", "2 to 500"),
    ("tables: {f: {points: [[0, 1, 2], [1, 2]]}}", "4:23: error: a point of a table", "[x, y]"),
    ("tables: {f: {points: [[0, 1 m], [1, 2]]}}", "4:27: error: an entry of a table", "units:"),
    ("tables: {f: {units: [m, N]}}", "4:10: error: the table 'f' needs file: or points:", "one"),
    ("tables: {f: {points: [[0, 1], [1, 2]], smooth: C3}}", "4:48: error: unknown", "C1, C2"),
    ("tables: {f: {points: [[0, 1], [1, 2]], units: [m]}}", "1 units", "two"),
    ("tables: {f: {points: [[0, 1], [1, 2]], units: [m, q]}}", "unknown unit 'q'", ""),
    ("tables: {sin: {points: [[0, 1], [1, 2]]}}", "'sin' is a word of the model language", ""),
    ("tables: {f: {file: ../x.csv}}", "is not beside the model", ""),
    ("tables: {f: {file: none.csv}}", "4:20: error: 'none.csv' cannot be read", ""),
    ("tables: {f: {file: bad.csv}}", "bad.csv:3:1: error: x = 1 after x = 2", "f is used at"),
    ("tables: {f: {file: words.csv}}", "words.csv:2:4: error: 'b' in a table", "a number"),
    ("tables: {f: {file: three.csv}}", "three.csv:1:1: error: 3 columns", "two: x and y"),
    (
        "tables: {f: {points: [[0, 1], [1, 2]], units: [m, N]}}\nforces: {x: f(2 kg)}",
        "f() of kg",
        "m",
    ),
    (
        "tables: {f: {points: [[0, 1], [1, 2]], units: [m, kg]}}\nforces: {x: f(x)}",
        "in kg",
        "N",
    ),
    (
        "tables: {f: {points: [[0, 1], [1, 2]]}}\nbodies: {b: {mass: f(1)}}\n"
        "joints: {j: {type: prismatic, axis: x, parent: ground, child: b}}",
        "5:20: error: the table 'f' in a mass",
        "a formula without tables",
    ),
    (
        "tables: {f: {points: [[0, 1], [1, 2]]}}\nbodies: {b: {mass: 1 kg}}\n"
        "joints: {j: {type: free, parent: ground, child: b}}\n"
        "constraints: {c: {type: point_on_surface, body: b, surface: z - (1 m)*f(x/(1 m))}}",
        "the table 'f' in a surface",
        "a formula without tables",
    ),
    ("forces: {x: 'piecewise(x, 1 N, 1 m, 2 N, 2 m)'}", "5 arguments", "pairs"),
    ("forces: {x: 'piecewise(x, 1 N, 1 s, 2 N)'}", "cannot compare", "m"),
    ("forces: {x: '(1 N)*step(x, 1 s)'}", "cannot compare", "m"),
]


@pytest.mark.parametrize("text, message, expected", WRONG)
def test_what_is_no_table_is_refused(
    tmp_path: Path, text: str, message: str, expected: str
) -> None:
    (tmp_path / "bad.csv").write_text("x;y\n2;1\n1;2\n")
    (tmp_path / "words.csv").write_text("0, 1\n1, b\n")
    (tmp_path / "three.csv").write_text("0 1 2\n")
    with pytest.raises(ModelError) as caught:
        load_text(f"{HEAD}{text}\n", str(tmp_path / "whole.yaml"), tmp_path)
    shown = str(caught.value)
    assert message in shown, shown
    assert expected in shown, shown


def test_files_are_read_with_heads_comments_and_units(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("angle, lift\n# measured\n0, 0\n 90\t10 # here\n\n180;30\n")
    text = f"{HEAD}tables: {{f: {{file: t.csv, units: [deg, mm]}}}}\n"
    model = load_text(text, str(tmp_path / "whole.yaml"), tmp_path)
    assert model.tables[0].x == pytest.approx((0.0, math.pi / 2, math.pi))
    assert model.tables[0].y == pytest.approx((0.0, 0.01, 0.03))
    assert "measured" in model.content()


def test_tables_of_submodels_and_in_repetitions(tmp_path: Path) -> None:
    part = (
        "model: part\nplane: xy\ntables: {f: {points: [[0, 1], [1, 2]]}}\n"
        "bodies: {b: {mass: 1 kg}}\njoints: {j: {type: prismatic, parent: ground, child: b, axis: x}}\n"
        "loads: {l: {type: expression, joint: j, expression: (1 N)*f(j/(1 m))}}\n"
    )
    (tmp_path / "part.yaml").write_text(part)
    whole = (
        "model: whole\nplane: xy\nrepeat: {i: 1..2}\nsubmodels: {'p{i}': {use: part.yaml}}\n"
        "tables: {g: {points: [[0, 1], [1, 2]]}}\noutputs: {'o{i}': g(i*p1_j/(1 m))}\n"
    )
    model = load_text(whole, str(tmp_path / "whole.yaml"), tmp_path)
    assert [table.name for table in model.tables] == ["g", "p1_f", "p2_f"]
    mechanics_of(model)


def test_a_width_makes_a_piece_smooth() -> None:
    model = load_text(BEAD.format(force="(1 N/m)*ramp(x)", smooth="C1"))
    assert len(pieces(model)) == len(switches(model)) == 1
    smooth = load_text(BEAD.format(force="(1 N/m)*ramp(x, w)", smooth="C1"))
    assert switches(smooth) == ()


@pytest.mark.slow
def test_a_cam_by_a_table_is_verified() -> None:
    assert hamel.verify(GALLERY / "cam.yaml", states=20).passed


TOWED = """model: towed
plane: xy
tables: {{course: {{points: [[0, 0], [1, 0.01], [2, 0]], units: {units}, smooth: C1}}}}
bodies: {{box: {{mass: 2 kg}}}}
joints: {{rail: {{type: prismatic, parent: ground, child: box, axis: x, coordinate: x}}}}
inputs: {{{input}, push: {{joint: rail}}}}
{more}
"""


def towed(
    units: str = "[s, kN]",
    entry: str = "pull: {joint: rail, gear: 2, table: course}",
    more: str = "",
) -> str:
    return TOWED.format(units=units, input=entry, more=more)


def test_an_input_follows_a_table() -> None:
    """It is the force gear · table(t), a name of formulas, and no argument any more."""
    system = mechanics_of(load_text(towed(more="outputs: {power: pull*der(x)}")))
    assert [x.name for x in system.model.inputs] == ["push"]
    forces = ca.Function("Q", [system.t, system.v, system.u], [system.Q, system.outputs[0][1]])
    Q, power = forces(0.5, 3.0, 7.0)
    assert float(Q) == pytest.approx(2 * 6.25 + 7, abs=1e-12)  # between 0 and 10 N by slopes 10, 0
    assert float(power) == pytest.approx(3 * 6.25, abs=1e-12)
    model = load_text(towed(entry="pull: {table: course}", more="outputs: {twice: 2*pull}"))
    twice = mechanics_of(model).outputs[0]
    assert twice[2] == "N"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (towed(entry="pull: {joint: rail, table: coarse}"), "unknown table 'coarse'"),
        (towed(units="[m, kN]"), "table 'course' over m for an input"),
        (towed(units="[s, N*m]"), r"table 'course' of N\*m for an input in N"),
        (towed(more="steady_motion: {rest: {x: 0, pull: 0 N}}"), "'rest' holds 'pull'"),
        (towed(entry="pull: {unit: V, table: course}"), "of N for an input in V"),
    ],
)
def test_a_table_that_no_input_can_follow(given: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        load_text(given)


def test_a_reaction_is_no_side_that_a_state_tells():
    """abs(reaction.NAME) is what friction is written with; other pieces are still looked at."""
    text = (
        "model: m\nplane: xy\nbodies: {c: {mass: 1 kg}}\n"
        "joints: {C: {type: point, parent: ground, child: c, coordinates: [x, y]}}\n"
        "constraints:\n"
        "  road: {holonomic: y, nonideal: {x: -0.1*abs(reaction.road)*tanh(der(x)/(1 cm/s))}}\n"
        "loads: {stop: {type: expression, coordinate: x, expression: (-4 N/m)*ramp(x - 1 m)}}\n"
    )
    model = load_text(text)
    assert len(switches(model)) == 2
    assert len(sides(model)) == 1


def test_the_largest_of_three_turns_between_any_two():
    text = BEAD.format(smooth="C2", force="max(1 N, (1 N/s)*t, (1 N/m)*x + 2 N)")
    assert len(switches(load_text(text))) == 3
