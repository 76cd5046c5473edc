"""Generated folders are loaded as often as one likes, and what was built again is new.

Of codegen: loader.
"""

import sys
import warnings
from pathlib import Path

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
    for mass in (3, 4, 2):
        model.write_text(SLIDE.replace("2 kg", f"{mass} kg"), encoding="utf-8")
        hamel.build(model, out=folder)
        found.append(accelerations(folder))
    assert found == [3.0, 2.0, 1.5, 3.0]
    assert float(first[0].dynamics(0.0, [0.0, 0.0], [6.0])[1]) == 3.0


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
