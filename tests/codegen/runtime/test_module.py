"""The CPython extension as far as it does not depend on a model: plain C that compiles on its own
without warnings, over a pendulum that is written by hand.

Of codegen.targets: extension.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import weakref
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from codegen.compiler import extension_suffix, headers
from codegen.targets.extension import RUNTIME

HERE = Path(__file__).parent
STRICT = ("-std=c99", "-O1", "-fPIC", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
pytestmark = pytest.mark.skipif(not headers(), reason="no headers of Python")


@pytest.fixture(scope="module", params=["gcc", "clang"])
def pendulum(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> ModuleType:
    if not shutil.which(request.param):
        pytest.skip(f"{request.param} is not installed: the runtime was not compiled with it")
    places = [f"-I{RUNTIME[0].parent}", *(f"-isystem{place}" for place in headers())]
    made = tmp_path_factory.mktemp(request.param) / f"_pendulum{extension_suffix()}"
    source = str(HERE / "pendulum_module.c")
    command = [request.param, *STRICT, *places, source, "-shared", "-lm", "-o", str(made)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    spec = importlib.util.spec_from_file_location("_pendulum", made)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_nothing_in_it_depends_on_a_model() -> None:
    assert len(RUNTIME) == 3
    for path in RUNTIME:
        text = path.read_text("utf-8")
        assert "{{" not in text and "{%" not in text, path.name


def rates(x: np.ndarray, u: float = 0.0, p: float = 9.81) -> np.ndarray:
    return np.stack([x[..., 1], u - p * np.sin(x[..., 0])], axis=-1)


def test_one_state_and_many(pendulum: ModuleType) -> None:
    x, u, p = np.array([0.3, 0.5]), np.array([2.0]), np.array([1.5])
    np.testing.assert_allclose(pendulum.dynamics(0.0, x, u), rates(x, 2.0), rtol=1e-15)
    np.testing.assert_allclose(pendulum.dynamics(0.0, x, u, p), rates(x, 2.0, 1.5), rtol=1e-15)
    np.testing.assert_allclose(pendulum.dynamics(0, [0.3, 0.5], u=[2]), rates(x, 2.0), rtol=1e-15)
    many = np.random.default_rng(0).normal(size=(3, 4, 2))
    for rows in (many, many[:, ::2], many[..., ::-1]):
        np.testing.assert_allclose(pendulum.dynamics(0.0, rows, u), rates(rows, 2.0), rtol=1e-14)
    out = np.empty((3, 4, 2))
    assert pendulum.dynamics(0.0, many, u, out=out) is out
    np.testing.assert_allclose(out, rates(many, 2.0), rtol=1e-14)


def test_results_that_nobody_holds_are_given_again(pendulum: ModuleType) -> None:
    x, u = np.array([0.3, 0.5]), np.array([2.0])
    assert len({id(pendulum.dynamics(0.0, x, u)) for _ in range(50)}) <= 8
    held = [pendulum.dynamics(0.0, x, u) for _ in range(50)]
    assert len({id(each) for each in held}) == 50
    seen = weakref.ref(pendulum.dynamics(0.0, x, u))
    others = [pendulum.dynamics(0.0, x, u) for _ in range(50)]
    assert seen() is None or all(seen() is not each for each in others)


def test_messages(pendulum: ModuleType) -> None:
    x, u = [0.0, 0.0], [0.0]
    with pytest.raises(FloatingPointError, match=r"pendulum.dynamics at t = 1\.5: too fast"):
        pendulum.dynamics(1.5, [0.0, 2000.0], u)
    with pytest.warns(RuntimeWarning, match="1 of 2 rows failed and are NaN; row 1: not finite"):
        found = pendulum.dynamics(0.0, [[0.0, 1.0], [np.nan, 0.0]], u)
    assert np.isnan(found[1]).all() and np.isfinite(found[0]).all()
    for given, message in (
        ((0.0, [1.0], u), r"needs 2 values along the last axis of 'x', got shape \(1,\)"),
        ((0.0, x), r"needs argument 'u' \(1 values\)"),
        ((0.0, x, ["a"]), "needs real numbers as 'u'"),
        ((0.0, x, u, None, None, 1), "takes t, x, u, p, out, but 6 arguments were given"),
        ((0.0, x, u, None, np.empty(2, "f")), "needs a float64 array as out"),
        ((0.0, x, u, None, np.empty(3)), r"needs out of shape \(2,\), got \(3,\)"),
    ):
        with pytest.raises((TypeError, ValueError), match=message):
            pendulum.dynamics(*given)
    with pytest.raises(TypeError, match="has no argument 'v'"):
        pendulum.dynamics(0.0, x, u, v=1)
    with pytest.raises(TypeError, match="got argument 't' twice"):
        pendulum.dynamics(0.0, x, u, t=1)


def test_motions(pendulum: ModuleType) -> None:
    state, times, u, p = np.zeros(1), np.array([1.0, 2.0]), np.array([0.5]), np.array([3.0])
    x, work = np.zeros((2, 2)), np.zeros(2)
    assert pendulum.advance(state, times, u, p, 0.25, 0.5, 10, x, work) == 5
    assert x.tolist() == [[1.5, 13.0], [2.5, 13.0]] and work.tolist() == [0.75, 0.75]
    assert state[0] == 7.0
    with pytest.raises(ValueError, match="wrong size"):
        pendulum.advance(state, times, u, p, 0.25, 0.5, 10, x, work[:1])
    with pytest.raises(TypeError, match="arrays of doubles without gaps"):
        pendulum.advance(state, times, u, p, 0.25, 0.5, 10, x.T, work)
    with pytest.raises(TypeError, match="argument"):
        pendulum.advance(state, times, u, p, 0.25, 0.5, 10, x)
    room = bytearray(3)
    assert pendulum.simulate_batch(b"abcd", room) == 0 and room[:1] == b"a"
    with pytest.raises(ValueError, match="wrong size"):
        pendulum.simulate_batch(b"abc", room)
