"""Functions of trees as loops over their links: the same numbers as unrolled, code that does not
grow, and what does not fit says so.

Of codegen.passes.folding: roll.
Of codegen.targets: rolled.
Of derive.formulations.rolled: columns, factors, recursion, rows, ways.
Of derive.mechanics: templates.
Of derive.mechanics.loops: forward_dynamics, frames, inverse_dynamics, poses, products, records, sweeps.
"""

from __future__ import annotations

import importlib
import json
import platform
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import casadi as ca
import numpy as np
import pytest

import hamel
from codegen import loader, passes
from codegen.emit import emit
from codegen.passes import program
from codegen.passes.folding.roll import AUTO, FROM, FROM_FREE, is_sure
from codegen.passes.lanes import is_batched, most_lanes
from codegen.program import Program, Rolled
from derive.diagnostics import AssumptionError, VerificationError
from derive.formulations.limits import MOST_PARAMETRIC
from derive.formulations.records import Equations
from derive.formulations.rolled import recursion
from derive.formulations.rolled.factors import factored
from hamel.build import pipeline, reuse
from hamel.build.module import published
from hamel.build.options import BuildOptions
from hamel.build.stages import equations_of, program_for
from tests.scenes import MODELS
from tests.trees import (
    afloat,
    chain,
    equal_links,
    gait,
    on_the_floor,
    rod,
    rope,
    several,
    snake,
    strapped,
    tree,
    urdf,
)

DYNAMICS = ("dynamics",)
FUNCTIONS = (*DYNAMICS, "bias", "inverse_dynamics", "dynamics_forward", "dynamics_adjoint")
CLOSE = 1e-12  # relative; both ways differ by rounding

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")


def derived(base: Path, text: str) -> Equations:
    path = base / ("model.urdf" if text.startswith("<") else "model.yaml")
    path.write_text(text)
    return equations_of(path)


def loops(made: Program) -> Rolled:
    of = made.kernel("dynamics").rolled
    assert of is not None
    return of


def numpy_module(base: Path, made: Program, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module that runs without a compiler, under a name of its own."""
    package = f"{made.name}_{'rolled' if made.kernel('dynamics').rolled else 'straight'}"
    (base / package).mkdir()
    for name, content in emit(made).items():
        if name.startswith("_") and name.endswith(".py") and name != "__init__.py":
            (base / package / name).write_text(content)
    (base / package / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(base))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    return importlib.import_module(f"{package}._numpy")


def states(made: Program, many: int, function: str = "dynamics") -> tuple[np.ndarray, ...]:
    """What stands for x, with u and p at random, p around its defaults."""
    rng = np.random.default_rng(1)
    sizes = {a.name: len(a.names) for a in made.arguments}
    sizes["x"] = len(made.kernel(function).x.names)
    p = np.array(made.argument("p").defaults) * rng.uniform(0.8, 1.2, (many, sizes["p"]))
    return rng.normal(size=(many, sizes["x"])), rng.normal(size=(many, sizes["u"])), p


@pytest.mark.parametrize(
    "text",
    [
        *(chain(7), tree(), equal_links(6), rod(3), gait(4), strapped(3)),
        *(pytest.param(x, marks=pytest.mark.slow) for x in (several(), rope(4), snake(5))),
    ],
)
def test_loops_give_what_straight_code_gives(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    equations = derived(tmp_path, text)
    ways = {roll: program(equations, FUNCTIONS, roll=roll) for roll in ("always", "never")}
    modules = {roll: numpy_module(tmp_path, made, monkeypatch) for roll, made in ways.items()}
    for name in FUNCTIONS:
        assert ways["always"].kernel(name).rolled and not ways["never"].kernel(name).rolled
        row = states(ways["never"], 5, name)
        found, expected = (getattr(module, name)(0.3, *row) for module in modules.values())
        assert np.abs(found - expected).max() <= CLOSE * np.abs(expected).max(), name


PUSHED = {"afloat": afloat(), "on the floor": on_the_floor(6)}
OF_PUSHED = ("dynamics", "bias", "inverse_dynamics")


@pytest.mark.parametrize("name", PUSHED)
def test_what_acts_on_links_by_themselves_is_part_of_the_loops(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Contacts, drag and ties to the ground, over where the link is and how it moves."""
    equations = derived(tmp_path, PUSHED[name])
    ways = {roll: program(equations, OF_PUSHED, roll=roll) for roll in ("always", "never")}
    modules = {roll: numpy_module(tmp_path, made, monkeypatch) for roll, made in ways.items()}
    for function in OF_PUSHED:
        assert ways["always"].kernel(function).rolled, function
        row = states(ways["never"], 5, function)
        found, expected = (getattr(module, function)(0.3, *row) for module in modules.values())
        assert np.abs(found - expected).max() <= 10 * CLOSE * np.abs(expected).max(), function


def test_products_of_derivatives_know_nothing_of_what_acts_on_links(tmp_path: Path) -> None:
    with pytest.raises(AssumptionError, match="depends on other joints"):
        program(derived(tmp_path, on_the_floor(6)), ("dynamics_forward",), roll="always")


@pytest.mark.parametrize(
    ("load", "reason"),
    [
        ('{type: force, body: b4, components: ["(1 N)*sin(j0_qx)", 0 N, 0 N], frame: ground}', "depends on other"),
        ("{type: spring, between: [b0, b4], at: [[0, 0.1, 0], [0.1, 0, 0]], stiffness: 3, length: 0.1 m}", "depends on other joints"),
        ('{type: expression, velocity: j4.wx, expression: "(1 N)*position(b4, [0.1, 0, 0]).x"}', "depends on other joints|where a body is"),
    ],
)  # fmt: skip
def test_what_depends_on_more_than_a_link_is_refused(
    load: str, reason: str, tmp_path: Path
) -> None:
    text = rope(5) + f"loads:\n  l: {load}\n"
    with pytest.raises(AssumptionError, match=reason):
        program(derived(tmp_path, text), DYNAMICS, roll="always")


@pytest.mark.parametrize(
    "text", [tree(), pytest.param(several(), marks=pytest.mark.slow)], ids=["tree", "several"]
)
def test_products_of_derivatives_in_loops_are_slopes_of_the_dynamics(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By central differences, and both products of one another: yᵀ (J d) = (Jᵀ y)ᵀ d."""
    made = program(derived(tmp_path, text), FUNCTIONS, roll="always")
    module = numpy_module(tmp_path, made, monkeypatch)
    x, u, p = states(made, 1)
    rng, nx = np.random.default_rng(3), x.shape[1]
    dx, du, y = (rng.normal(size=(1, n)) for n in (nx, u.shape[1], nx))
    along = module.dynamics_forward(0.3, np.hstack([x, dx, du]), u, p)
    ahead, behind = (
        module.dynamics(0.3, x + side * dx, u + side * du, p) for side in (1e-6, -1e-6)
    )
    assert np.abs(along - (ahead - behind) / 2e-6).max() <= 1e-6 * np.abs(along).max()
    slopes = module.dynamics_adjoint(0.3, np.hstack([x, y]), u, p)
    across = float((slopes @ np.hstack([dx, du]).T)[0, 0])
    assert across == pytest.approx(float((y @ along.T)[0, 0]), rel=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        *(chain(50), tree(), equal_links(9), several(), rope(5), rod(5), snake(6), gait(6)),
        *PUSHED.values(),
    ],
)
def test_compiled_loops_one_by_one_and_in_lanes(text: str, tmp_path: Path) -> None:
    equations = derived(tmp_path, text)
    functions = OF_PUSHED if text in PUSHED.values() else FUNCTIONS
    straight = program(equations, functions, roll="never")
    plain = loader.load(published(straight, tmp_path / "straight").folder)
    rolled = loader.load(
        published(program(equations, functions, roll="always"), tmp_path / "rolled").folder
    )
    for name in functions:
        x, u, p = states(straight, 37, name)  # full groups of lanes, and some left over
        expected, call = getattr(plain, name)(0.3, x, u, p), getattr(rolled, name)
        alone = np.array([call(0.3, *row) for row in zip(x, u, p)])
        size = np.abs(expected).max()
        assert np.abs(alone - expected).max() <= CLOSE * size, name
        assert np.abs(call(0.3, x, u, p) - expected).max() <= CLOSE * size, name
        assert np.abs(call(0.3, x, u, p[0])[0] - expected[0]).max() <= CLOSE * size, name


@pytest.mark.slow
def test_sines_in_loops_of_angles_that_are_too_large_for_lanes(tmp_path: Path) -> None:
    """These states are computed alone."""
    made = program(derived(tmp_path, gait(6)), DYNAMICS, roll="always")
    assert is_batched(made.kernel("dynamics"))
    module = loader.load(published(made, tmp_path / "far").folder)
    x, u, p = states(made, 9)
    t = np.full(9, 0.3)
    t[4] = 1e9
    alone = np.array([module.dynamics(*row) for row in zip(t, x, u, p)])
    np.testing.assert_allclose(module.dynamics(t, x, u, p), alone, rtol=1e-11)


def test_long_mechanisms_go_in_fewer_lanes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two have room in the end; their rows are those of one state."""
    made = program(derived(tmp_path, chain(7)), DYNAMICS, roll="always")
    assert most_lanes(made) == 16
    numbers = loops(made).workspace + 3 * 14 - 7
    for lanes, found in ((9, 8), (5, 4), (2, 2)):
        monkeypatch.setattr(passes.lanes, "MOST_APART", lanes * numbers)
        assert most_lanes(made) == found and is_batched(made.kernel("dynamics"))
    module = loader.load(published(made, tmp_path / "two").folder)
    assert "LANES = 2 }" in (tmp_path / "two" / f"{made.name}_lanes.h").read_text()
    x, u, p = states(made, 9)
    alone = np.array([module.dynamics(0.3, *row) for row in zip(x, u, p)])
    assert np.abs(module.dynamics(0.3, x, u, p) - alone).max() <= CLOSE * np.abs(alone).max()
    monkeypatch.setattr(passes.lanes, "MOST_APART", numbers)
    assert not is_batched(made.kernel("dynamics"))


def test_what_is_too_long_for_the_stack_has_a_place_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many lanes as before; compilers that know of no such place take fewer."""
    made = program(derived(tmp_path, chain(7)), DYNAMICS, roll="always")
    assert not any("FAR " in text for name, text in emit(made).items() if "_batch" in name)
    numbers = loops(made).workspace + 3 * 14 - 7
    monkeypatch.setattr(passes.lanes, "MOST_ROLLED", 2 * numbers)
    texts = emit(made)
    places = re.findall("FAR ALIGNED double (work|lanes_x)", texts[f"{made.name}_batch.c"])
    assert {*places} == {"work", "lanes_x"}
    room = re.findall(r"LANES = (\d)", texts[f"{made.name}_lanes.h"])
    assert room == ["2", "8", "4"]
    module = loader.load(published(made, tmp_path / "apart").folder)
    x, u, p = states(made, 9)
    alone = np.array([module.dynamics(0.3, *row) for row in zip(x, u, p)])
    assert np.abs(module.dynamics(0.3, x, u, p) - alone).max() <= CLOSE * np.abs(alone).max()


def code_without_tables(made: Program) -> str:
    """The C of the loops; numbers of links and rows of tables taken out."""
    text = emit(made)[f"{made.name}_dynamics.c"]
    text = re.sub(r"= \{\n.*?\n\};", "", text, flags=re.DOTALL)
    return re.sub(r"\b\d+\b", "", text.lower().replace(made.name, ""))


@pytest.mark.skipif(
    platform.machine() != "x86_64" or shutil.which("gcc") is None, reason="gcc's report of loops"
)
@pytest.mark.parametrize(
    "text",
    [
        *(tree(), rod(6), gait(8)),
        *(pytest.param(x, marks=pytest.mark.slow) for x in (chain(40), rope(6), snake(8))),
    ],
    ids=["tree", "rod", "gait", "chain", "rope", "snake"],
)
def test_lanes_of_short_visits_are_vectors_too(text: str, tmp_path: Path) -> None:
    """gcc takes loops of few iterations and statements apart before it looks for vectors, and then
    finds none: the sweep of velocities was one state after the other."""
    made = program(derived(tmp_path, text), DYNAMICS, roll="always")
    for name, content in emit(made).items():
        if name.endswith((".c", ".h")):
            (tmp_path / name).write_text(content)
    code = f"{made.name}_batch.c"
    flags = ["-std=c99", "-O3", "-mavx2", "-mfma", "-fno-math-errno", "-fno-trapping-math"]
    command = ["gcc", *flags, "-fopt-info-vec-optimized", "-S", code, "-o", "batch.s"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stderr
    vectors = set(map(int, re.findall(rf"{code}:(\d+):\d+: optimized: loop vectorized", said)))
    lines = (tmp_path / code).read_text().splitlines()
    heads = {i + 1 for i, line in enumerate(lines, 1) if line.strip() == "WHOLE"}
    assert len(heads) > len(loops(made).sweeps)
    assert heads <= vectors


def test_parameters_may_be_called_like_what_loops_call_their_own(tmp_path: Path) -> None:
    """In C and in Python: a parameter `table0` became a number where a table of that name stood."""
    free = equal_links(12)
    for name, own in (("mm", "table0"), ("kk", "tables"), ("dd", "start"), ("l", "slots")):
        free = re.sub(rf"\b{name}\b", own, free)
    made = program(derived(tmp_path, free), DYNAMICS, roll="always")
    folder = tmp_path / "named"
    assert published(made, folder).compiled
    module = loader.load(folder)
    numpy = importlib.import_module(f"{module.__name__}._numpy")
    x, u = np.random.default_rng(3).normal(size=module.nx), np.ones(1)
    p = np.array(module.defaults) * 1.1
    once = module.dynamics(0.0, x, u, p)
    rows = np.tile(x, (9, 1)), np.ones((9, 1)), np.tile(p, (9, 1))
    np.testing.assert_allclose(numpy.dynamics(0.0, x, u, p), once, rtol=CLOSE)
    np.testing.assert_allclose(module.dynamics(np.zeros(9), *rows)[4], once, rtol=CLOSE)


def graded(n: int) -> str:
    """An oblique chain whose masses, lengths and springs fall from link to link; all are formulas
    of parameters, inertias of two at once."""
    return f"""
model: graded
repeat: {{i: 1..{n - 1}}}
parameters: {{mm: 1 kg, l: 0.5 m, kk: 3 N*m/rad, J: 0.01 kg*m^2}}
bodies:
  b0: {{mass: mm, com: [l/2, 0, 0], inertia: [J, mm*l^2/12 + J, mm*l^2/12 + J]}}
  b{{i}}:
    mass: mm/(i + 1)
    com: [l/2/(i + 1), 0, 0]
    inertia: [J/(i + 1), mm*l^2/12/(i + 1)^3 + J/(i + 1), mm*l^2/12/(i + 1)^3 + J/(i + 1)]
joints:
  j0: {{type: revolute, axis: y, parent: ground, child: b0, coordinate: q0}}
  j{{i}}:
    {{type: revolute, axis: [0.6, 0.8, 0], parent: "b{{i-1}}", child: "b{{i}}", at: [l/i, 0, 0],
     coordinate: "q{{i}}"}}
loads: {{"s{{i}}": {{type: spring, joint: "j{{i}}", stiffness: kk/i}}}}
inputs: {{tau: {{joint: j0}}}}
"""


def test_links_that_parameters_make_differ_are_loops_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each number of a link is one by link times formulas of parameters, computed once a call."""
    monkeypatch.setattr(recursion, "MOST_PARAMETRIC", 8)
    equations = derived(tmp_path, graded(14))
    ways = {roll: program(equations, DYNAMICS, roll=roll) for roll in ("always", "never")}
    of = loops(ways["always"])
    assert 4 <= len(of.factors) <= 12
    (long,) = (table.rows for table in of.tables if len(table.rows) > 8)
    assert all(isinstance(x, float) for row in long for x in row)
    modules = [numpy_module(tmp_path, made, monkeypatch) for made in ways.values()]
    x, u, p = states(ways["always"], 5)
    found, expected = (module.dynamics(0.3, 0.3 * x, u, p) for module in modules)
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.slow
def test_such_loops_in_c_and_in_lanes_are_what_the_reference_balances(tmp_path: Path) -> None:
    path = tmp_path / "graded.yaml"
    path.write_text(graded(MOST_PARAMETRIC + 6))
    functions = (*FUNCTIONS, "power")
    made = hamel.build(path, out=tmp_path / "made", functions=functions, roll="always")
    assert {name: how.split(":")[0] for name, how in made.rolling.items()} == dict.fromkeys(
        FUNCTIONS, "rolled"
    )
    module = loader.load(made.folder)
    x, u, p = states(program(equations_of(path), DYNAMICS), 19)
    many = module.dynamics(0.3, x, u, p)
    alone = np.array([module.dynamics(0.3, *row) for row in zip(x, u, p)])
    assert np.abs(many - alone).max() <= 1e-9 * np.abs(alone).max()


def test_a_parameter_for_each_link_is_in_no_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recursion, "MOST_PARAMETRIC", 8)
    text = graded(14).replace("mass: mm/(i + 1)", 'mass: "m{i}"')
    text = text.replace("parameters: {", 'parameters: {"m{i}": 1 kg, ')
    with pytest.raises(AssumptionError, match=r"parameters make .* links differ; `--constants`"):
        program(derived(tmp_path, text), ("bias",), roll="always")


def test_columns_are_split_into_numbers_and_formulas() -> None:
    """Products, sums of two formulas, numbers among them; and what is no combination of few."""
    p = ca.SX.sym("p", 3)
    m, l, J = ca.vertsplit(p)
    column = [m * l**2 / (i + 1) + J * i + 0.5 * (i % 3) for i in range(80)]
    made = factored([*column, 0.0, 7.0], p, (2.0, 0.3, 0.0))
    assert made is not None and len(made.formulas) == 3
    at = np.array([1.7, 0.9, 0.4])
    values = [float(ca.Function("f", [p], [ca.SX(x)])(at)) for x in made.formulas]
    for i, row in enumerate(made.numbers[:80]):
        wanted = at[0] * at[1] ** 2 / (i + 1) + at[2] * i + 0.5 * (i % 3)
        assert float(np.dot(row, values)) == pytest.approx(wanted, rel=1e-13)
    assert float(np.dot(made.numbers[81], values)) == pytest.approx(7.0, rel=1e-13)
    assert factored([m**i for i in range(80)], p, (2.0, 0.3, 0.1)) is None
    assert factored([ca.sqrt(l - i) for i in range(80)], p, (2.0, 0.3, 0.1)) is None


@pytest.mark.slow
def test_code_does_not_grow_with_the_number_of_links(tmp_path: Path) -> None:
    few, many = (program(derived(tmp_path, chain(n)), DYNAMICS, roll="always") for n in (9, 18))
    assert code_without_tables(few) == code_without_tables(many)
    total = [made.kernel("dynamics").operations["total"] for made in (few, many)]
    assert total[1] == 2 * total[0]
    assert loops(many).widths == loops(few).widths and max(loops(few).widths) <= 15


def test_equal_links_share_a_row_and_exact_zeros_are_kept(tmp_path: Path) -> None:
    made = program(derived(tmp_path, equal_links(20)), DYNAMICS, roll="always")
    assert sum(len(table.rows) for table in loops(made).tables) <= 3
    assert made.kernel("dynamics").operations["total"] <= 100 * 20


def test_a_rope_on_ball_joints_takes_one_body_of_code(tmp_path: Path) -> None:
    """No quaternion's entry needs a table: they stand at multiples of the link."""
    few, many = (program(derived(tmp_path, rope(n)), DYNAMICS, roll="always") for n in (4, 8))
    lines = [len(emit(made)[f"{made.name}_dynamics.c"].splitlines()) for made in (few, many)]
    assert abs(lines[1] - lines[0]) <= 1
    totals = [made.kernel("dynamics").operations["total"] for made in (few, many)]
    assert totals[1] <= 2.1 * totals[0] and totals[1] <= 450 * 8
    assert "coordinate" not in re.sub(r"/\*.*?\*/", "", emit(many)[f"{many.name}_dynamics.c"])


def test_what_ties_neighbours_is_a_force_of_the_joint_between_them(tmp_path: Path) -> None:
    """How far apart they are does not depend on what carries both. With points in ground axes a
    damper of every joint took operations by the square of the links, and no loops."""
    few, many = (program(derived(tmp_path, strapped(n)), DYNAMICS, roll="always") for n in (6, 12))
    totals = [made.kernel("dynamics").operations["total"] for made in (few, many)]
    assert totals[1] <= 2.3 * totals[0]


def test_forces_across_many_joints_are_refused_before_they_are_written_out(tmp_path: Path) -> None:
    """As a formula without shared parts a spring over nine oblique joints filled the memory."""
    points = "at: [[0, 0, 0.1], [0, 0, 0.2]]"
    spring = f"far: {{type: spring, between: [b1, b13], {points}, stiffness: 3}}"
    far = strapped(14).replace("loads:", f"loads:\n  {spring}")
    with pytest.raises(AssumptionError, match="depends on other joints, too"):
        program(derived(tmp_path, far), DYNAMICS, roll="always")


def test_a_force_of_one_joint_may_be_a_long_formula(tmp_path: Path) -> None:
    """Squares of squares double what is written out with each: 2¹⁰ is refused."""
    squares = "{a0: sin(q2), " + ", ".join(f"a{k + 1}: a{k}*a{k} + a{k}" for k in range(14)) + "}"
    long = (
        strapped(12)
        .replace("axis: y,\n", 'axis: y, coordinate: "q{i}",\n')
        .replace(
            "loads:",
            f"where: {squares}\nloads:\n  s: {{type: expression, joint: j2, expression: (1 N*m)*a14}}",
        )
    )
    with pytest.raises(AssumptionError, match="more than 2000 terms"):
        program(derived(tmp_path, long), DYNAMICS, roll="always")


def test_rows_are_as_long_as_their_kind_needs(tmp_path: Path) -> None:
    """A free base does not make those of all links longer."""
    of = loops(program(derived(tmp_path, several()), DYNAMICS, roll="always"))
    assert max(of.widths) > 30 and min(of.widths) < 16
    assert of.workspace < of.links * max(of.widths)
    assert of.starts[-1] + of.widths[of.kinds[-1]] == of.workspace - of.slots * of.received


def test_slots_are_used_again(tmp_path: Path) -> None:
    of = loops(program(derived(tmp_path, tree()), DYNAMICS, roll="always"))
    assert len([place for place in of.to if place >= 0]) > of.slots == 2


@pytest.mark.slow
def test_bytes_are_the_same_twice(tmp_path: Path) -> None:
    once, again = (program(derived(tmp_path, tree()), DYNAMICS, roll="always") for _ in range(2))
    assert emit(once) == emit(again) and once.fingerprint == again.fingerprint
    assert once.fingerprint != program(derived(tmp_path, tree()), DYNAMICS).fingerprint


@pytest.mark.parametrize(
    ("model", "reason"),
    [
        ("four_bar", "constraints"),
        ("gear_train", "constraints"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(model: str, reason: str) -> None:
    equations = equations_of(MODELS / f"{model}.yaml")
    with pytest.raises(AssumptionError, match=f"dynamics cannot be rolled: .*{reason}"):
        program(equations, DYNAMICS, roll="always")
    assert not program(equations, DYNAMICS).rolling


def test_euler_angles_are_refused_by_name(tmp_path: Path) -> None:
    angles = 'orientation: {euler: zxz, angles: ["a{i}", "b{i}", "c{i}"]}'
    text = rope(3).replace('"j{i}": {type: ball', f'"j{{i}}": {{type: ball, {angles}')
    with pytest.raises(AssumptionError, match="positions that it has to be guarded against"):
        program(derived(tmp_path, text), DYNAMICS, roll="always")


def test_a_force_between_joints_keeps_the_unrolled_way_and_says_so(tmp_path: Path) -> None:
    text = equal_links(FROM) + "  f: {joint: j2}\n"
    text = text.replace("inputs: {tau: {joint: j1}}\n  f: {joint: j2}\n", "")
    text += "  c: {type: expression, joint: j1, expression: kk*(q3 - q1)}\n"
    made = program(derived(tmp_path, text), DYNAMICS)
    assert made.kernel("dynamics").rolled is None
    (name, how), *_ = made.rolling
    assert name == "dynamics" and how.startswith("unrolled: a force at")
    assert json.loads(emit(made)["manifest.json"])["rolled"] == {name: how}


@pytest.mark.slow
def test_targets_of_straight_code_refuse_loops_or_get_straight_code(tmp_path: Path) -> None:
    equations = derived(tmp_path, tree())
    asked = BuildOptions(functions=DYNAMICS, targets=("casadi",), roll="always")
    with pytest.raises(AssumptionError, match="loop over links"):
        emit(program_for(equations, asked))
    assert program_for(equations, replace(asked, roll="auto")).kernel("dynamics").rolled is None
    with pytest.raises(AssumptionError, match="no recurrences"):
        program(equations, DYNAMICS, ("taylor",), roll="always")
    with pytest.raises(AssumptionError, match="header"):
        program_for(equations, BuildOptions(header=True, roll="always"))


def test_small_models_stay_as_they_are(tmp_path: Path) -> None:
    equations = derived(tmp_path, chain(3))
    assert program(equations, DYNAMICS) == program(equations, DYNAMICS, roll="never")
    assert "rolled" not in json.loads(emit(program(equations, DYNAMICS))["manifest.json"])


def test_what_is_too_long_for_lanes_is_loops(tmp_path: Path) -> None:
    """Also with more operations: of thirty links of eight kinds, not of twelve of six."""
    for n, rolled in ((12, False), (30, True)):
        parents = [(k - 1) // 2 for k in range(n)]
        kinds = ["prismatic" if k % 5 == 4 else "continuous" for k in range(n)]
        equations = derived(tmp_path, urdf("branched", parents, kinds))
        kernel = program(equations, DYNAMICS).kernel("dynamics")
        assert bool(kernel.rolled) is rolled and is_batched(kernel)


def spoiled(made: Program) -> Program:
    """One entry of one table, wrong in the sixth digit."""
    kernel = made.kernel("dynamics")
    of = loops(made)
    table = of.tables[0]
    row = tuple(x * 1.000001 if k == 7 else x for k, x in enumerate(table.rows[3]))  # type: ignore[operator]
    rows = (*table.rows[:3], row, *table.rows[4:])
    bad = replace(kernel, rolled=replace(of, tables=(replace(table, rows=rows), *of.tables[1:])))
    return replace(made, kernels=tuple(bad if k.name == "dynamics" else k for k in made.kernels))


@pytest.mark.slow
def test_a_wrong_entry_of_a_table_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the same build without it goes through, and simulates."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = tmp_path / "chain12.urdf"
    path.write_text(chain(12))
    asked = {"functions": ("dynamics", "power"), "roll": "always"}
    made = hamel.build(path, out=tmp_path / "made", **asked)
    module = loader.load(made.folder)
    x = np.zeros(24)
    motion = module.simulate(np.linspace(0.0, 0.1, 3), x, u=np.zeros(12))
    assert motion.status == 0
    usual = pipeline.program_for
    for where in (reuse, pipeline):
        monkeypatch.setattr(where, "file_key", lambda *given: None)
    monkeypatch.setattr(pipeline, "program_for", lambda *given: spoiled(usual(*given)))
    with pytest.raises(VerificationError, match="module"):
        hamel.build(path, out=tmp_path / "other", **asked)
    assert not (tmp_path / "other").exists()


def test_few_links_are_rolled_where_that_takes_no_more_operations(tmp_path: Path) -> None:
    """Oblique chains of a dozen links; planar ones have fewer operations written out."""
    for text, rolled in ((chain(12), True), (chain(8), False), (equal_links(12), False)):
        equations = derived(tmp_path, text.replace("<dynamics", "<nothing"))
        made, straight = program(equations, DYNAMICS), program(equations, DYNAMICS, roll="never")
        assert (made.kernel("dynamics").rolled is not None) == rolled
        assert bool(made.rolling) == rolled
        least, before = (x.kernel("dynamics").operations["total"] for x in (made, straight))
        assert least <= before


def test_robots_on_a_free_base_are_compared_for_longer(tmp_path: Path) -> None:
    """What is written out gains more where axes are along each other's."""
    for text, sure in ((chain(3), True), (snake(3), False)):
        function = derived(tmp_path, text).function("dynamics")
        assert is_sure(function, AUTO, FROM) is sure
        assert is_sure(function, AUTO, FROM_FREE)


def test_entries_of_a_mass_matrix_are_counted_by_velocities(tmp_path: Path) -> None:
    """Thirty ball joints have ninety: M over all pairs of them took half a minute to write out."""
    assert derived(tmp_path, rope(6)).system.written
    assert not derived(tmp_path, rope(30)).system.written


def test_a_jacobian_that_is_too_large_is_refused_before_it_is_derived(tmp_path: Path) -> None:
    """Of a rod of forty balls that took minutes."""
    equations = derived(tmp_path, rope(40))
    with pytest.raises(AssumptionError, match="jacobian has 78400 entries"):
        program(equations, DYNAMICS, integrators=("radau",))
    (request,) = [x for x in equations.requests if x.name == "jacobian"]
    assert "function" not in vars(request)
