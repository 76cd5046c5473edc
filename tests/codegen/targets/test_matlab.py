"""The MATLAB target: values by Octave, errors that are seen, names that are no identifiers there.

Of codegen.targets: matlab.
Of hamel.verify.targets: matlab.
"""

import shutil
import subprocess
from dataclasses import replace

import pytest

from codegen import compiler
from codegen.emit import emit
from codegen.passes import in_precision, program
from derive.diagnostics import AssumptionError
from hamel.verify.targets import matlab as checked
from tests.subjects import subject
from tests.toy import toy

needs_octave = pytest.mark.skipif(
    compiler.find_compiler() is None or not shutil.which("mkoctfile"), reason="no Octave"
)
MOTION = {"simulate in Octave", "steps in Octave"}
SCRIPT = """
addpath matlab
cart_pole.build();
function refused(call, identifier)
    try
        call();
    catch error
        assert(error.identifier, identifier);
        return
    end
    assert(false);
end
refused(@() cart_pole.dynamics(0, [NaN; 0; 0; 0]), 'cart_pole:notFinite');
refused(@() cart_pole.dynamics(0, [0; 0]), 'cart_pole:size');
refused(@() cart_pole.dynamics(0, int8([0; 0; 0; 0])), 'cart_pole:type');
refused(@() cart_pole.dynamics(0, zeros(4, 3), zeros(1, 2)), 'cart_pole:size');
refused(@() cart_pole.simulate([0 1], [0; 0.1; 0; 0], struct('tol', 1)), 'cart_pole:options');
many = cart_pole.dynamics(0, [zeros(4, 1), nan(4, 1)]);
assert(all(isfinite(many(:, 1))) && all(isnan(many(:, 2))));
two = cart_pole.simulate([0 0.1 0.2], [0 0; 0.1 0.2; 0 0; 0 0], struct('u', [1 2]));
one = cart_pole.simulate([0 0.1 0.2], [0; 0.2; 0; 0], struct('u', 2));
assert(two.x(:, :, 2), one.x, 1e-9);
assert(size(cart_pole.mass(0, zeros(4, 1))), [2 2]);
assert(size(cart_pole.dynamics(0, zeros(4, 0))), [4 0]);
assert(size(cart_pole.mass(0, zeros(4, 0))), [2 2 0]);
refused(@() cart_pole.dynamics(0, []), 'cart_pole:size');
"""


@pytest.fixture(scope="module")
def cart_pole(tmp_path_factory):
    base = tmp_path_factory.mktemp("matlab")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "cart_pole", ["matlab"])


@needs_octave
@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "before", "after", "seen"),
    [
        ("cart_pole.m", "[2 1 3]", "[1 2 3]", set()),  # of a symmetric matrix
        ("cart_pole.m", "cart_pole_mex(0, t", "cart_pole_mex(0, t + t", set()),  # nor of time
        ("cart_pole.m", "given.rtol, given.atol", "1, 1", MOTION),
        ("cart_pole.m", "given.rtol, given.atol", "1e-9, 1e-9", {"steps in Octave"}),
        ("cart_pole.m", "given.step_size, given.rtol", "1, given.rtol", MOTION),
        ("cart_pole.m", "given.step_size, given.rtol", "1e-3, given.rtol", {"steps in Octave"}),
        ("cart_pole_mex.c", "by_u, np", "0, np", {"many columns in Octave"}),
        ("cart_pole.m", "function build()", "function built()", {"built and run by Octave"}),
    ],
)
def test_errors_are_seen(cart_pole, tmp_path, file, before, after, seen):
    shutil.copytree(cart_pole.folder, tmp_path / "cart_pole")
    place = tmp_path / "cart_pole" / "matlab" / file
    text = place.read_text("utf-8")
    assert before in text
    place.write_text(text.replace(before, after))
    results = checked.check(replace(cart_pole, folder=tmp_path / "cart_pole"))
    assert {result.name for result in results if not result.passed} == seen


@needs_octave
@pytest.mark.slow
def test_calls_that_do_not_fit_say_so(cart_pole, tmp_path):
    shutil.copytree(cart_pole.folder, tmp_path / "cart_pole")
    (tmp_path / "cart_pole" / "use.m").write_text(SCRIPT)
    subprocess.run(["octave-cli", "--norc", "use.m"], check=True, cwd=tmp_path / "cart_pole")


@needs_octave
def test_a_script_without_an_end_has_failed(tmp_path):
    (tmp_path / "check.m").write_text("while true\nend\n")
    assert checked._said_by_octave(tmp_path, "check.m", 0.5) == "check.m did not end within 0.5 s"


@pytest.mark.parametrize("name", ["end", "classdef", "zeros", "_toy", "a" * 60])
def test_names_that_matlab_does_not_take_are_refused(name):
    made = replace(program(toy("toy")), name=name, targets=("matlab",))
    with pytest.raises(AssumptionError, match=f"'{name}'"):
        emit(made)
    assert emit(replace(made, targets=()))


def test_numbers_that_are_no_doubles_are_refused():
    made = replace(in_precision(program(toy()), "float32"), targets=("matlab",))
    with pytest.raises(AssumptionError, match="float64, not in float32"):
        emit(made)
