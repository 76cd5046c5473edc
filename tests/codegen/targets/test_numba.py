"""The numba target: values, loops without allocation, errors that are seen, arrays that do not
fit.

Of codegen.targets: numba.
Of hamel.verify.targets: numba.
"""

from dataclasses import replace

import numpy as np
import pytest

from codegen import compiler
from derive.diagnostics import ToolchainError
from hamel.verify.targets import numba as checked
from hamel.verify.targets.records import generated, tool
from tests.subjects import subject

needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def cart_pole(tmp_path_factory):
    pytest.importorskip("numba")
    base = tmp_path_factory.mktemp("numba")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "cart_pole", ["numba"])


def spoiled(given, tmp_path, before, after):
    """The file with another text, in a folder with the same library."""
    text = (given.folder / "cart_pole_numba.py").read_text("utf-8")
    (tmp_path / "cart_pole_numba.py").write_text(text.replace(before, after))
    library = compiler.shared_library("cart_pole")
    (tmp_path / library).symlink_to(given.folder / library)
    return replace(given, folder=tmp_path)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "after", "seen"),
    [
        ("return call(t, x.ctypes", "return call(t, x.copy().ctypes", "no allocation"),
        ("return call(t, x.ctypes", "return call(t, p.ctypes", "values"),
        ("too short", "too long", None),
    ],
)
def test_errors_are_seen(cart_pole, tmp_path, before, after, seen):
    results = checked.check(spoiled(cart_pole, tmp_path, before, after))
    assert [result.name for result in results if not result.passed] == ([seen] if seen else [])


@needs_compiler
@pytest.mark.slow
def test_a_compiled_loop_and_arrays_that_do_not_fit(cart_pole):
    numba = tool("numba")
    functions = generated(cart_pole, "numba")
    dynamics = functions.dynamics

    @numba.njit
    def rollout(x, u, p, h, steps):
        out = np.empty_like(x)
        for _ in range(steps):
            if dynamics(0.0, x, u, p, out) != 0:
                return False
            for i in range(x.size):
                x[i] += h * out[i]
        return True

    x = np.array([0.0, 0.1, 0.0, 0.0])
    expected = x.copy()
    for _ in range(10):
        expected += 1e-3 * cart_pole.module.dynamics(0.0, expected, [1.0])
    assert rollout(x, np.array([1.0]), functions.defaults, 1e-3, 10)
    assert x == pytest.approx(expected, rel=1e-14)
    with pytest.raises(ValueError, match="too short"):
        dynamics(0.0, x[:3], np.array([1.0]), functions.defaults, np.empty(4))
    with pytest.raises(TypeError):
        dynamics(0.0, np.zeros(8)[::2], np.array([1.0]), functions.defaults, np.empty(4))


def test_a_missing_tool_is_named_with_the_command_that_installs_it():
    with pytest.raises(ToolchainError, match=r"pip install 'hamel\[no_such_tool\]'"):
        tool("no_such_tool")
