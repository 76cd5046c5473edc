"""Long chains and large trees: never more operations than the graph has, and everything else in
proportion to them."""

from __future__ import annotations

import importlib
import random
import re
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.emit import emit
from codegen.passes import program
from codegen.passes.folding import split
from codegen.passes.pipeline import _roots
from codegen.program import Load, Section, Statement
from derive.expressions.counting import operations
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model import load
from derive.states import system
from hamel.build.module import published
from hamel.verify import verification
from tests.scenes import MODELS
from tests.toy import toy

LOOP = """
closures:
  loop: {type: revolute, between: [b4, b1], at: [[1.0, 0], [0.0, 0.5]]}
initial: {guess: {q2: 80 deg, q3: 80 deg, q4: 80 deg}}
"""  # of the last three links of a chain of five, on the one before them
needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


def chain(n: int) -> str:
    """A planar pendulum of n equal links."""
    lines = ["model: chain", "plane: xy", "gravity: [0, -9.81 m/s^2]", "bodies:"]
    lines += [f"  b{i}: {{mass: 1.0, com: [0.5, 0], inertia: 0.08}}" for i in range(n)]
    lines.append("joints:")
    for i in range(n):
        parent, at = (f"b{i - 1}", 1.0) if i else ("ground", 0.0)
        lines.append(
            f"  j{i}: {{type: revolute, parent: {parent}, child: b{i}, at: [{at}, 0], coordinate: q{i}}}"
        )
    return "\n".join(lines) + "\n"


def tree(n: int, seed: int) -> str:
    """A spatial tree with random numbers and axes."""
    draw = random.Random(seed)

    def vector(size: float) -> str:
        return "[" + ", ".join(f"{draw.uniform(-size, size):.3f}" for _ in range(3)) + "]"

    lines = ["model: tree", "gravity: [0, 0, -9.81 m/s^2]", "bodies:"]
    for i in range(n):
        inertia = ", ".join(f"{draw.uniform(0.5, 0.7):.3f}" for _ in range(3))
        lines.append(
            f"  b{i}: {{mass: {draw.uniform(1, 3):.3f}, com: {vector(0.3)}, inertia: [{inertia}]}}"
        )
    lines.append("joints:")
    for i in range(n):
        parent = f"b{draw.randrange(max(0, i - 4), i)}" if i else "ground"
        axis = draw.choice(["x", "y", "z"])
        lines.append(
            f"  j{i}: {{type: revolute, parent: {parent}, child: b{i}, at: {vector(0.5)}, axis: {axis}, coordinate: q{i}}}"
        )
    return "\n".join(lines) + "\n"


@cache
def derived(text: str, folder: Path) -> Equations:
    path = folder / "model.yaml"
    path.write_text(text)
    return equations(system(load(path), "all"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scale")


def assert_never_worse(found: Equations) -> None:
    made = program(found)
    reciprocals = {
        entry.function: entry.after - entry.before
        for entry in made.ledger
        if entry.step == "invert"
    }
    for kernel in made.kernels:
        asked = [request.function for request in found.requests if request.name == kernel.name]
        function = next(f for f in (*found.functions, *asked) if f.name == kernel.name)
        most = operations(*_roots(function))
        assert kernel.operations["total"] - reciprocals.get(kernel.name, 0) <= most, kernel.name


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda path: path.stem)
def test_models_need_no_more_than_their_graph(path: Path) -> None:
    assert_never_worse(equations(system(load(path), "all")))


@pytest.mark.parametrize(
    "text", [chain(10), chain(30), tree(8, 4)], ids=["chain of 10", "chain of 30", "tree of 8"]
)
def test_trees_need_no_more_than_their_graph(text: str, folder: Path) -> None:
    assert_never_worse(derived(text, folder))


def test_parts_share_slots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(split, "WHOLE", 3)
    monkeypatch.setattr(split, "LONGEST", 3)
    kernel = program(toy()).kernel("dynamics")
    parts = split.split(kernel)
    statements = [s for section in kernel.sections for s in section.statements]
    assert [
        s for part in parts.parts for section in part.sections for s in section.statements
    ] == statements
    assert len(parts.parts) == -(-len(statements) // 3)
    kept = [name for part in parts.parts for name, _ in part.kept]
    assert parts.size < len(kept) == len(set(kept))
    held: dict[int, str] = {}
    for part in parts.parts:
        assert all(held[slot] == name for name, slot in part.taken)
        held |= {slot: name for name, slot in part.kept}


def test_results_that_repeat_an_argument_are_copied_in_a_loop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A compiler's time grows faster than a list of thousands of them."""
    whole = split.split(program(toy()).kernel("dynamics"))
    monkeypatch.setattr(split, "COPIED", 2)
    own = program(toy())
    kernel, texts = own.kernel("dynamics"), emit(own)
    (part,) = split.split(kernel).parts
    assert part.copies == (split.Copy(0, "x", 2, 2),)
    assert [i for i, _ in part.outputs] == [2, 3] and not whole.parts[0].copies
    loop = "for (int i = 0; i < 2; i++) /* q1, rad to q2, rad */\n        out[i] = x[(2 + i)];"
    assert loop in texts["toy.c"] and "out[..., 0:2] = x[..., 2:4]" in texts["_numpy.py"]
    swapped = replace(kernel, outputs=(*reversed(kernel.outputs[:2]), *kernel.outputs[2:]))
    assert not split.split(swapped).parts[0].copies


def test_a_sum_of_very_many_entries_is_cut_by_what_it_loads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It has few statements, which are long."""
    for limit, value in {"WHOLE": 20, "READ": 20, "LONGEST": 10}.items():
        monkeypatch.setattr(split, limit, value)
    names = [f"a{i}" for i in range(30)]
    sums = tuple(Statement(f"s{k}", ("add", *names[6 * k : 6 * k + 6])) for k in range(5))
    kernel = replace(
        program(toy()).kernel("energy"),
        loads=tuple(Load(name, "x", i) for i, name in enumerate(names)),
        sections=(Section("sums", sums),),
        outputs=(("add", *(s.name for s in sums)),),
    )
    parts = split.split(kernel).parts
    assert split.is_long(kernel) and max(len(part.loads) for part in parts) <= 12
    assert not split.is_long(replace(kernel, loads=kernel.loads[:10]))


@needs_compiler
@pytest.mark.slow
def test_parts_compute_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To rounding (the compiler joins other products and sums), with guards, iterations, and both
    bindings."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    whole = loader.load(published(program(toy()), tmp_path / "whole").folder)
    monkeypatch.setattr(split, "WHOLE", 4)
    monkeypatch.setattr(split, "LONGEST", 4)
    monkeypatch.setattr(split, "COPIED", 2)
    built = published(program(toy()), tmp_path / "cut")
    cut = loader.load(built.folder)
    assert (
        "dynamics_part3" in (built.folder / "toy_dynamics.c").read_text()
        and cut.backend == "extension"
    )
    draw = np.random.default_rng(3)
    x, u = draw.normal(size=(50, 4)) * [0.3, 0.3, 1, 1], draw.normal(size=(50, 1))
    for name in whole.functions:
        expected = getattr(whole, name)(0.3, x, u)
        tame = (
            np.abs(expected).reshape(50, -1).max(axis=1) < 1e3
        )  # near a singular position rounding is amplified
        assert tame.sum() > 25
        for binding in (cut, importlib.import_module(f"{cut.__name__}._numpy")):
            np.testing.assert_allclose(
                getattr(binding, name)(0.3, x, u)[tame], expected[tame], rtol=1e-11, atol=1e-12
            )
    with pytest.raises(FloatingPointError, match="singular"):
        cut.dynamics(0.0, x[0], u[0], [0.0, 0.7, 1.3])
    command = compiler.find_compiler()
    assert command
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-fsyntax-only"]
    subprocess.run(
        [*command, *strict, "toy.c", "toy_dynamics.c", "toy_batch.c", "toy_cpu.c"],
        cwd=built.folder,
        check=True,
    )


@pytest.mark.parametrize("text", [chain(4), chain(5) + LOOP], ids=["chain", "with a loop"])
def test_what_does_without_the_mass_matrix_is_verified_too(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Long chains do not write M out; every term, λ among them, is held against the reference all
    the same."""
    monkeypatch.setattr(importlib.import_module("derive.mechanics.system"), "MOST_ENTRIES", 0)
    (tmp_path / "model.yaml").write_text(text)
    model = load(tmp_path / "model.yaml")
    found = equations(system(model, "all"))
    assert not found.system.written and found.system.M.is_zero()
    checks = {check.name: check for check in verification(model, found, states=5).checks}
    assert checks["M"].passed and ("λ" in checks) == (LOOP in text)
    assert all(check.passed for check in checks.values()), [
        c for c in checks.values() if not c.passed
    ]


def test_operations_and_text_grow_in_proportion(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counted, not timed."""
    monkeypatch.setattr(split, "WHOLE", 50)
    monkeypatch.setattr(split, "LONGEST", 50)
    sizes = []
    for n in (15, 30):
        found = program(derived(chain(n), folder), ["dynamics", "bias"])
        parts = split.split(found.kernel("dynamics")).parts
        assert (
            max(sum(len(section.statements) for section in part.sections) for part in parts) <= 51
        )
        text = sum(len(text) for name, text in emit(found).items() if name.endswith(".c"))
        sizes.append((found.kernel("dynamics").operations["total"], text))
    assert all(larger <= 2.3 * smaller for smaller, larger in zip(*sizes))


@pytest.mark.slow
def test_parts_are_bounded_and_load_near_the_use(folder: Path) -> None:
    """A compiler's time is linear in the number of links: parts are no longer for more links, and
    nothing in them waits long for its use, for gcc looks through all that stands between."""
    lengths, lines = {}, {}  # of a part at most; for each operation
    for n in (40, 80):
        found = program(derived(chain(n), folder), ["dynamics"], roll="never")
        files, operations = emit(found), found.kernel("dynamics").operations["total"]
        parts = _functions(files["chain_dynamics.c"], "PART chain_dynamics_part")
        lengths[n], lines[n] = max(map(len, parts)), sum(map(len, parts)) / operations
        waits = [wait for part in parts for wait in _waits(part)]
        assert len(waits) > 100 and max(waits) <= 12  # four angles and what becomes of them
        assert (
            files["chain_dynamics.c"].count("0x1.5d92ff36b5cd1p-33") == 1
            and "APART void chain_turns" in files["chain_dynamics.c"]
        )
    assert max(lengths.values()) <= 3 * split.LONGEST and lines[80] <= 1.3 * lines[40]


def _functions(text: str, start: str) -> list[list[str]]:
    """The lines of the functions whose head begins so."""
    return [body.split("\n}\n")[0].splitlines() for body in text.split(start)[1:]]


def _waits(part: list[str]) -> Iterator[int]:
    """Of every value from an argument or the workspace, the number of lines until it is read."""
    for i, line in enumerate(part):
        if found := re.fullmatch(r" *const double (\w+) = (?:x|u|p|work)\[\d+\];", line):
            yield next(
                k for k, later in enumerate(part[i + 1 :]) if re.search(rf"\b{found[1]}\b", later)
            )


def test_long_functions_name_their_files_and_their_stack(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(split, "WHOLE", 50)
    monkeypatch.setattr(split, "LONGEST", 50)
    files = emit(program(derived(chain(15), folder), ["dynamics"]))
    assert "uses" in files["chain.h"] and "doubles of stack" in files["chain.h"]
    assert "example.c chain.c chain_dynamics.c -lm" in files["example.c"]
    assert "malloc" not in files["chain_dynamics.c"]
