"""One set of rules for arguments, the same in the extension, through ctypes and in NumPy."""

from __future__ import annotations

import importlib
import mmap
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.passes import program
from hamel.build.module import published
from tests.toy import toy

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
BACKENDS = ("extension", "ctypes", "numpy")
X = np.array([0.3, 0.2, 0.1, 0.4])


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    base = tmp_path_factory.mktemp("arguments")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return loader.load(published(program(toy()), base / "toy").folder)


@pytest.fixture(params=BACKENDS)
def binding(request: pytest.FixtureRequest, module: ModuleType) -> Any:
    assert module.backend == "extension"
    files = {"ctypes": "_library", "numpy": "_numpy"}
    if request.param == "extension":
        return module._binding
    return importlib.import_module(f"{module.__name__}.{files[request.param]}")


def read_only_map(folder: Path, size: int) -> np.ndarray:
    """An array over a file that is mapped without leave to write."""
    place = folder / "map"
    place.write_bytes(bytes(8 * size))
    with place.open("rb") as file:
        return np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), dtype=float)


def test_a_read_only_result_is_refused_and_stays_as_it_is(binding: Any, tmp_path: Path) -> None:
    locked = np.full(4, 7.0)
    locked.flags.writeable = False
    for out in (locked, read_only_map(tmp_path, 4), np.broadcast_to(7.0, 4)):
        before = out.copy()
        with pytest.raises(ValueError, match=r"dynamics\(\) got a read-only array as out"):
            binding.dynamics(0.0, X, [0.0], out=out)
        np.testing.assert_array_equal(out, before)
    many = np.zeros((3, 4))
    many.flags.writeable = False
    with pytest.raises(ValueError, match="read-only"):
        binding.dynamics(0.0, np.tile(X, (3, 1)), [0.0], out=many)


@pytest.mark.parametrize(
    ("letter", "said"),
    [
        ("p", "3 .* as 'p', not a dict: "),
        ("u", "1 .* as 'u', not a dict: "),
        ("x", "4 .* as 'x', not a dict$"),
    ],
)
def test_a_dict_is_no_array(module: ModuleType, binding: Any, letter: str, said: str) -> None:
    given: dict[str, Any] = {"t": 0.0, "x": X, "u": [0.0], "p": None, letter: {"a": 1.0}}
    with pytest.raises(TypeError, match=rf"^dynamics\(\) needs an array of {said}") as error:
        binding.dynamics(**given)
    names = {"p": module.parameters, "u": module.inputs}.get(letter, ())
    assert str(error.value).endswith(", ".join(names))


NOT_REAL = {
    "complex": 1.0 + 2.0j,
    "complex without an imaginary part": 1.0 + 0.0j,
    "text": "1.0",
    "objects": object(),
    "None": None,
    "dates": np.datetime64("NaT"),
}


@pytest.mark.parametrize("kind", NOT_REAL)
@pytest.mark.parametrize("letter", ["t", "x", "u", "p"])
def test_what_is_not_real_is_refused_by_name(binding: Any, letter: str, kind: str) -> None:
    given: dict[str, Any] = {"t": 0.0, "x": X, "u": [0.0], "p": [0.5, 0.7, 1.3]}
    given[letter] = [NOT_REAL[kind]] * len(np.atleast_1d(given[letter]))
    with pytest.raises(TypeError, match=rf"needs real numbers as '{letter}', got \S+"):
        binding.dynamics(**given)


def test_numbers_of_other_precisions_are_rounded(binding: Any) -> None:
    expected = binding.dynamics(0.0, [1.0, 2.0, 0.0, 1.0], [1.0])
    for kind in (np.int8, np.uint64, np.float32, np.longdouble, ">f8"):
        x = np.array([1, 2, 0, 1], dtype=kind)
        np.testing.assert_array_equal(binding.dynamics(0, x, np.array([1], kind)), expected)
    whole = binding.dynamics(False, [True, 2, False, True], [1])
    np.testing.assert_array_equal(whole, expected)


def test_values_that_are_not_aligned_are_taken(binding: Any) -> None:
    room = np.zeros(4 * 8 + 1, dtype=np.uint8)
    x, out = (room[1:].view(np.float64), np.zeros(33, dtype=np.uint8)[1:].view(np.float64))
    x[:] = X
    np.testing.assert_array_equal(binding.dynamics(0.0, x, [0.5]), binding.dynamics(0.0, X, [0.5]))
    binding.dynamics(0.0, X, [0.5], out=out)
    np.testing.assert_array_equal(out, binding.dynamics(0.0, X, [0.5]))


@pytest.mark.parametrize("out", [[0.0] * 4, np.zeros(4, np.float32), np.zeros(4, ">f8"), 1.0])
def test_a_result_of_another_type_is_refused(binding: Any, out: Any) -> None:
    with pytest.raises(TypeError, match=r"dynamics\(\) needs a float64 array as out"):
        binding.dynamics(0.0, X, [0.0], out=out)


@pytest.mark.parametrize(
    ("lead", "shape"), [((), (5,)), ((), (1, 4)), ((3,), (4,)), ((3,), (2, 3, 4)), ((3,), (1, 4))]
)
def test_a_result_of_another_shape_is_refused(
    binding: Any, lead: tuple[int, ...], shape: tuple[int, ...]
) -> None:
    said = re.escape(f"dynamics() needs out of shape {(*lead, 4)}, got {shape}")
    with pytest.raises(ValueError, match=said):
        binding.dynamics(0.0, np.broadcast_to(X, (*lead, 4)), [0.0], out=np.zeros(shape))


def test_rows_that_do_not_fit_together_are_counted(module: ModuleType) -> None:
    for given, counts in (
        ((0.0, np.zeros((3, 4)), np.zeros((5, 1))), "3 and 5"),
        ((np.zeros(2), np.zeros((3, 4)), np.zeros(1)), "2 and 3"),
    ):
        with pytest.raises(ValueError, match=rf"dynamics\(\) got {counts} rows: leading axes"):
            module.dynamics(*given)


def test_missing_arguments_are_told_by_name(binding: Any) -> None:
    for given in ({"t": None, "x": X}, {"t": 0.0, "x": None}, {"t": 0.0, "x": X, "u": None}):
        with pytest.raises(TypeError, match=r"needs argument '[txu]' \(\d values\)"):
            binding.dynamics(**given)
