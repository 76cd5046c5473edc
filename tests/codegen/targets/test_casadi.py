"""The casadi target: what it writes agrees with the module, errors in it are seen, what does not
fit is refused, nothing of it is there unless it was asked for.

Of codegen.targets: casadi.
Of hamel.verify.targets: casadi.
"""

import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.emit import emit, on_request
from codegen.passes import in_precision, program
from derive.diagnostics import AssumptionError, HamelError
from hamel.build.module import published
from hamel.build.targets import subject_of
from hamel.verify.targets.casadi import check
from hamel.verify.targets.records import generated
from tests.subjects import subject
from tests.toy import toy

STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-fsyntax-only")
needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def cart_pole(tmp_path_factory):
    """The module with its target, and states to compare it at."""
    if compiler.find_compiler() is None:
        pytest.skip("no C compiler")
    base = tmp_path_factory.mktemp("casadi")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "cart_pole", ["casadi"])


def test_the_folder_says_how_to_use_it_and_the_manifest_what_was_written(cart_pole):
    said = json.loads((cart_pole.folder / "manifest.json").read_text("utf-8"))["targets"]["casadi"]
    assert said["files"] == ["cart_pole_casadi.py", "cart_pole_external.c"]
    assert "## CasADi" in (cart_pole.folder / "README.md").read_text("utf-8")


def test_external_functions_have_names_and_sparse_jacobians(cart_pole):
    symbols = generated(cart_pole, "casadi")
    dynamics = symbols.external("dynamics", cart_pole.folder / compiler.shared_library("cart_pole"))
    assert (dynamics.name_in(), dynamics.name_out()) == (["t", "x", "u", "p"], ["xdot"])
    by_x = dynamics.jacobian().sparsity_out(1)
    assert by_x.nnz() < by_x.numel()
    assert by_x == symbols.function("dynamics").jacobian().sparsity_out(1)


@pytest.mark.parametrize("x", [np.zeros(5), np.zeros((4, 2)), np.zeros((1, 4)), [0.0] * 3])
def test_arguments_of_another_size_are_refused(cart_pole, x):
    """Seen: more entries were left out, and of a matrix all but its first column."""
    symbols = generated(cart_pole, "casadi")
    with pytest.raises(ValueError, match=r"x is .* and should be 4 × 1"):
        symbols.dynamics(0.0, x)
    with pytest.raises(ValueError, match="u is 2, and should be 1 × 1"):
        symbols.dynamics(0.0, [0.0] * 4, [1.0, 2.0])
    assert symbols.dynamics(0.0, np.zeros((4, 1)), [1.0]).shape == (4, 1)


def test_a_number_does_where_one_value_is_wanted(cart_pole):
    symbols = generated(cart_pole, "casadi")
    x, expected = [0.1, 0.2, 0.3, 0.4], cart_pole.module.dynamics(0.0, [0.1, 0.2, 0.3, 0.4], [2.0])
    for u in (2, 2.0, np.float64(2.0), np.array(2.0), symbols._ca.SX(2), [2.0]):
        found = symbols._ca.evalf(symbols.dynamics(0, x, u)).full()
        np.testing.assert_allclose(found.ravel(), expected, rtol=1e-12)
    with pytest.raises(ValueError, match="x is 1 × 1, and should be 4 × 1"):
        symbols.dynamics(0.0, 1.0)


def test_a_library_of_other_equations_is_refused(cart_pole, tmp_path):
    """Seen: that of another folder, and what the linker kept of an earlier build, gave numbers."""
    file, library = "cart_pole_casadi.py", compiler.shared_library("cart_pole")
    text = (cart_pole.folder / file).read_text("utf-8")
    program = json.loads((cart_pole.folder / "manifest.json").read_text("utf-8"))["program"]
    (tmp_path / file).write_text(text.replace(program, program[::-1]), "utf-8")
    symbols = generated(replace(cart_pole, folder=tmp_path), "casadi")
    with pytest.raises(ImportError, match=r"compiled from other equations: run build\.py"):
        symbols.external("dynamics", cart_pole.folder / library)


def test_what_was_built_passes_again(cart_pole):
    assert all(result.passed for result in check(cart_pole))


@pytest.mark.parametrize(
    ("before", "after", "seen"),
    [
        ("_ca.cos(", "_ca.sin(", "symbols: values"),
        ("_columns, _rows).T", "_rows, _columns)", "symbols: values"),
        ("out = 1", "out = 2", None),
    ],
)
def test_errors_in_the_symbols_are_seen(cart_pole, tmp_path, before, after, seen):
    text = (cart_pole.folder / "cart_pole_casadi.py").read_text("utf-8")
    (tmp_path / "cart_pole_casadi.py").write_text(text.replace(before, after))
    spoiled = replace(cart_pole, folder=tmp_path)
    failed = [result.name for result in check(spoiled) if not result.passed]
    assert (seen in failed) if seen else not failed


@pytest.mark.parametrize(
    ("before", "after", "seen"),
    [
        ("[k] = w[places[k]]", "[k] = w[places[0]]", "external: Jacobians"),
        ("res[0][2 * column + row]", "res[0][2 * column]", "external: values"),
        ("places[k]", "places[ k ]", None),
    ],
)
def test_errors_in_the_external_functions_are_seen(cart_pole, tmp_path, before, after, seen):
    text = (cart_pole.folder / "cart_pole_external.c").read_text("utf-8")
    library = compiler.shared_library("cart_pole")
    shutil.copy(cart_pole.folder / "cart_pole_casadi.py", tmp_path)
    shutil.copy(cart_pole.folder / library, tmp_path / f"plain_{library}")
    (tmp_path / "spoiled.c").write_text(text.replace(before, after))
    command = [
        *(compiler.find_compiler() or ()),
        *compiler.shared(),
        "-fPIC",
        f"-I{cart_pole.folder}",
    ]
    linked = ["spoiled.c", f"plain_{library}", f"-Wl,-rpath,{tmp_path}", "-o", library]
    subprocess.run([*command, *linked], cwd=tmp_path, check=True)
    spoiled = replace(cart_pole, folder=tmp_path)
    failed = [result.name for result in check(spoiled) if not result.passed]
    assert (seen in failed) if seen else not failed


@pytest.mark.slow
@needs_compiler
def test_functions_seldom_met_have_the_same_values(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = replace(program(toy()), targets=("casadi",))
    module = loader.load(published(made, tmp_path / "toy").folder)
    x = np.random.default_rng(3).uniform(0.1, 0.9, (5, 4)).tolist()
    row = {"t": [0.3] * 5, "x": x, "u": [[0.2]] * 5, "p": [[0.5, 0.7, 1.3]] * 5, "size": [1.0] * 5}
    rows = {name: row for name in module.functions if name != "project"}
    results = check(subject_of(made, module, rows))
    assert [result.name for result in results if "values" in result.name and result.passed] == [
        "symbols: values",
        "external: values",
    ]


def test_what_does_not_fit_is_refused_before_anything_is_written():
    made = replace(in_precision(program(toy()), "float32"), targets=("casadi",))
    with pytest.raises(AssumptionError, match="float64, not in float32"):
        emit(made)
    with pytest.raises(HamelError, match="casadi"):
        on_request(["casady"])


def test_without_the_target_nothing_of_it_is_there():
    plain = emit(program(toy()))
    assert not any("casadi" in name or "external" in name for name in plain)
    assert "README.md" not in plain and "targets" not in json.loads(plain["manifest.json"])


@pytest.mark.parametrize("language", [("c", "c99"), ("c++", "c++11"), ("c++", "c++20")])
@pytest.mark.parametrize("command", ["gcc", "clang"])
def test_external_functions_compile_without_a_warning(cart_pole, command, language):
    if shutil.which(command) is None:
        pytest.skip(f"no {command}")
    name, standard = language
    flags = [*STRICT, "-x", name, f"-std={standard}"]
    subprocess.run([command, *flags, str(cart_pole.folder / "cart_pole_external.c")], check=True)
