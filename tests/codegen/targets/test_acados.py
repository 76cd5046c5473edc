"""The acados target: the C with BLASFEO, errors in it that are seen, the
AcadosModel that is filled, what is refused.

Of codegen.targets: acados.
Of hamel.verify.targets: acados.
"""

import importlib.util
import shutil
import sys
import types
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import hamel
from codegen import compiler
from codegen.emit import emit
from codegen.passes import in_precision, program
from derive.diagnostics import AssumptionError, VerificationError
from hamel.verify.targets import acados as checked
from tests.scenes import MODELS
from tests.subjects import subject
from tests.toy import toy

FIELDS = """name x xdot u z p f_impl_expr f_expl_expr disc_dyn_expr dyn_ext_fun_type
dyn_generic_source dyn_disc_fun dyn_disc_fun_jac dyn_disc_fun_jac_hess"""
needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def cart_pole(tmp_path_factory):
    base = tmp_path_factory.mktemp("acados")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "cart_pole", ["acados", "casadi"], ("dynamics",))


@needs_compiler
def test_code_that_does_not_compile_or_link_is_no_missing_tool(cart_pole, tmp_path):
    folder = tmp_path / "cart_pole"
    shutil.copytree(cart_pole.folder, folder)
    source = folder / "acados" / "cart_pole_acados.c"
    text = source.read_text("utf-8")
    for wrong, said in ((text + "int;;(", "does not compile"), (absent(text), "is not whole")):
        source.write_text(wrong)
        with pytest.raises(VerificationError, match=said):
            list(checked.check(replace(cart_pole, folder=folder)))


def absent(text: str) -> str:
    """Calling what is in no file."""
    return text.replace("static int model(", "int nowhere(void);\nstatic int model(").replace(
        "take(in[0], NX, x);", "take(in[0], nowhere(), x);"
    )


MASSES = """
model: masses
bodies: {{{bodies}}}
joints: {{{joints}}}
inputs: {{{inputs}}}
"""


@needs_compiler
def test_functions_of_many_results_have_files_of_their_own(tmp_path, monkeypatch):
    """Fifteen states and inputs: 225 second derivatives, which are a function of a file that the C
    for acados, and the program to copy from, have to name."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    model = tmp_path / "masses.yaml"
    model.write_text(
        MASSES.format(
            bodies=", ".join(f"b{k}: {{mass: 1}}" for k in range(5)),
            joints=", ".join(
                f"j{k}: {{type: prismatic, parent: ground, child: b{k}, axis: x, spring: {{stiffness: 3}}}}"
                for k in range(5)
            ),
            inputs=", ".join(f"u{k}: {{joint: j{k}}}" for k in range(5)),
        )
    )
    built = hamel.build(model, out=tmp_path / "masses", targets=["acados"])
    assert (tmp_path / "masses" / "masses_dynamics_hessian.c").is_file()
    assert "steps" in built.targets["acados"]
    example = (tmp_path / "masses" / "example.c").read_text("utf-8")
    assert "masses_dynamics_hessian.c" in example


@needs_compiler
@pytest.mark.slow
def test_several_files_with_the_same_helpers(tmp_path, monkeypatch):
    """Sines, zeros and sums of several functions in one C file."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    built = hamel.build(MODELS / "stanford_arm.yaml", out=tmp_path / "arm", targets=["acados"])
    assert "steps" in built.targets["acados"]


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "seen"),
    [
        ("weight[n] * h * k[i]", "weight[n] * h * k[0]", "steps"),
        ("i < NX ? NU + i : i - NX", "i", "Jacobian"),
        ("vector->xi + i", "i", "steps"),
        ("place[n + 1] * h * next[i]", "h * next[i]", "Hessian"),
        ("p[NP] + (s / 4", "p[NP] + (0", None),  # nothing depends on time
    ],
)
def test_errors_are_seen(cart_pole, tmp_path, before, after, seen):
    shutil.copytree(cart_pole.folder, tmp_path / "cart_pole")
    source = tmp_path / "cart_pole" / "acados" / "cart_pole_acados.c"
    text = source.read_text("utf-8")
    assert before in text
    source.write_text(text.replace(before, after))
    results = checked.check(replace(cart_pole, folder=tmp_path / "cart_pole"))
    failed = [result.name for result in results if not result.passed]
    assert (seen in failed) if seen else not failed


@needs_compiler
@pytest.mark.slow
def test_a_model_of_acados_is_filled(cart_pole, tmp_path, monkeypatch):
    """Into an object with the fields of an AcadosModel, which is not here; nothing else is set."""

    class AcadosModel:
        __slots__ = tuple(FIELDS.split())

    stand_in = types.ModuleType("acados_template")
    stand_in.AcadosModel = AcadosModel
    monkeypatch.setitem(sys.modules, "acados_template", stand_in)
    monkeypatch.syspath_prepend(str(cart_pole.folder))
    spec = importlib.util.spec_from_file_location(
        "cart_pole_acados", cart_pole.folder / "cart_pole_acados.py"
    )
    functions = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(functions)
    model = functions.discrete(substeps=3, folder=tmp_path)
    assert (tmp_path / model.dyn_generic_source).read_text().startswith("#define SUBSTEPS 3\n")
    stage = functions.stage(0.02, t=1.0)
    assert model.p.shape == (len(stage), 1) and stage[-2:].tolist() == [1.0, 0.02]
    for wrong in (0, -2, 1.5):
        with pytest.raises(ValueError, match="one substep or more"):
            functions.discrete(substeps=wrong, folder=tmp_path)
    with pytest.raises(ValueError, match=r"needs \d parameters, got an array of shape \(1,\)"):
        functions.stage(0.02, p=[1.0])
    with pytest.raises(ValueError, match="a stage of length -1"):
        functions.stage(-1)
    smooth = functions.expressions()
    f = ca.Function("f", [smooth.x, smooth.u, smooth.p], [smooth.f_expl_expr])
    _, x, u, p = cart_pole.row("dynamics", 0)
    expected = cart_pole.module.dynamics(0.0, x, u, p)
    assert np.asarray(f(x, u, p)).ravel() == pytest.approx(expected, rel=1e-10)


def test_what_does_not_fit_is_refused():
    made = replace(in_precision(program(toy()), "float32"), targets=("acados",))
    with pytest.raises(AssumptionError, match="float64, not in float32"):
        emit(made)
    with pytest.raises(AssumptionError, match="too many for dense Hessians"):
        emit(replace(program(toy()), targets=("acados",)))  # made without its matrices
