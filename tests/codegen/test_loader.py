"""Generated folders are loaded as often as one likes, and what was built again is new.

Of codegen: loaded, loader.
"""

import importlib
import importlib.util
import pickle
import subprocess
import sys
import warnings
from pathlib import Path
from types import ModuleType

import pytest

import hamel
from codegen import loader

SLIDE = """
model: slide
bodies: {b: {mass: 2 kg}}
joints: {j: {type: prismatic, parent: ground, child: b, axis: x, coordinate: x}}
inputs: {f: {joint: j}}
"""


def accelerations(folder: Path) -> float:
    return float(hamel.load(folder).dynamics(0.0, [0.0, 0.0], [6.0])[1])


def test_paths_do_not_grow_with_the_loads(tmp_path: Path) -> None:
    """The dynamic linker has its own idea of a path that it knows."""
    model, folder = tmp_path / "slide.yaml", tmp_path / "slide"
    model.write_text(SLIDE, encoding="utf-8")
    hamel.build(model, out=folder)
    first = [hamel.load(folder) for _ in range(30)]
    assert {Path(str(module.__file__)).parent for module in first} == {folder}
    assert len({str(module.__file__) for module in first}) == 1
    assert len({module.__name__ for module in first}) == 30
    found = [accelerations(folder)]
    for mass in (3, 2):
        model.write_text(SLIDE.replace("2 kg", f"{mass} kg"), encoding="utf-8")
        hamel.build(model, out=folder)
        found.append(accelerations(folder))
    assert found == [3.0, 2.0, 3.0]
    assert float(first[0].dynamics(0.0, [0.0, 0.0], [6.0])[1]) == 3.0


def test_functions_and_results_go_to_other_processes(tmp_path: Path) -> None:
    """Seen: workers died of "No module named 'hamel_generated_1_slide'"."""
    folder = built(tmp_path / "a.b", 2, "extension")
    module = hamel.load(folder)
    motion = module.simulate((0.0, 1.0), [0.0, 0.0], [6.0])
    assert elsewhere(pickle.dumps((module.dynamics, motion))) == "1.5 [0. 3.]"
    divided = module.threaded(module.dynamics, 2)
    assert elsewhere(pickle.dumps((divided, motion))) == "1.5 [0. 3.]"
    assert elsewhere(pickle.dumps((module.simulate, motion)), "type(f).__name__") == "1.5 function"
    built(tmp_path / "a.b", 3, "extension")
    with pytest.raises(AssertionError, match="no longer holds the equations that were loaded"):
        elsewhere(pickle.dumps((module.dynamics, motion)))
    module = hamel.load(folder)
    motion = module.simulate((0.0, 1.0), [0.0, 0.0], [6.0])
    assert elsewhere(pickle.dumps((module.dynamics, motion))) == "1.0 [0. 2.]"


def elsewhere(pickled: bytes, call: str = "f(0.0, [0.0, 0.0], [6.0])") -> str:
    """What a process that knows nothing of it makes of a function and a motion."""
    script = (
        "import pickle, sys; f, motion = pickle.loads(sys.stdin.buffer.read()); "
        f"print(round(motion.x[-1, 0], 9), {call})"
    )
    command = [sys.executable, "-c", script]
    run = subprocess.run(command, input=pickled, capture_output=True, check=False)
    assert not run.returncode, run.stderr.decode()
    return run.stdout.decode().strip()


@pytest.mark.slow
@pytest.mark.parametrize("way", ["extension", "ctypes", "numpy"])
def test_imports_after_another_build_are_of_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    """Seen: reloaded, the facts were new and the code was not; imported anew, one fell back to
    ctypes, then to NumPy, for want of code that fits."""
    warnings.filterwarnings("ignore", "slide: no compiled code")
    monkeypatch.syspath_prepend(tmp_path)
    found = []
    for mass in (2, 3, 4, 2):
        built(tmp_path, mass, way)
        if before := sys.modules.get("slide"):
            found.append(pushed(importlib.reload(before), way))
            purge("slide")
        found.append(pushed(importlib.import_module("slide"), way))
    purge("slide")
    assert found == [3.0, 2.0, 2.0, 1.5, 1.5, 3.0, 3.0]


def built(base: Path, mass: int, way: str, targets: tuple[str, ...] = ()) -> Path:
    """The folder, without what is better than the way that it is to go."""
    model, folder = base / "slide.yaml", base / "slide"
    base.mkdir(exist_ok=True)
    model.write_text(SLIDE.replace("2 kg", f"{mass} kg"), encoding="utf-8")
    hamel.build(model, out=folder, targets=targets)
    better = {"extension": "", "ctypes": "_slide.*", "numpy": "*slide*.so"}[way]
    for file in folder.glob(better) if better else ():
        file.unlink()
    return folder


def pushed(module: ModuleType, way: str) -> float:
    assert (module.backend, module.nx) == (way, 2)
    return float(module.dynamics(0.0, [0.0, 0.0], [6.0])[1])


def purge(name: str) -> None:
    for each in [each for each in sys.modules if each.split(".")[0] == name]:
        del sys.modules[each]


@pytest.mark.slow
@pytest.mark.parametrize("target", ["jax", "numba"])
def test_targets_open_the_library_of_the_last_build(tmp_path: Path, target: str) -> None:
    """Seen: "compiled from other equations: run build.py" in the process that had just done so."""
    pytest.importorskip(target)
    for mass in (2, 3, 4):
        folder = built(tmp_path, mass, "extension", (target,))
        spec = importlib.util.spec_from_file_location("opened", folder / f"slide_{target}.py")
        assert spec and spec.loader
        spec.loader.exec_module(importlib.util.module_from_spec(spec))


def test_what_was_needed_for_a_command_is_let_go(tmp_path: Path) -> None:
    model = tmp_path / "slide.yaml"
    model.write_text(SLIDE, encoding="utf-8")
    hamel.simulate(model, time=0.1)
    before = len(sys.modules)
    for _ in range(3):
        hamel.simulate(model, time=0.1)
    assert len(sys.modules) == before


def test_a_module_is_unloaded_with_its_files(tmp_path: Path) -> None:
    model, folder = tmp_path / "slide.yaml", tmp_path / "slide"
    model.write_text(SLIDE, encoding="utf-8")
    with warnings.catch_warnings(action="ignore"):
        hamel.build(model, out=folder)
    module = loader.load(folder)
    assert [name for name in sys.modules if name.startswith(module.__name__)]
    loader.unload(module)
    assert not [name for name in sys.modules if name.startswith(module.__name__)]
