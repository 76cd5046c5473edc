"""A long file is read without looking for cycles.

Of derive.model: memory.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator

import pytest

from derive.diagnostics import ModelError
from derive.model import load_text

LINKS = 400


def chain(links: int) -> str:
    bodies = "\n".join(f"  b{i}: {{mass: 1 kg, inertia: 0.1}}" for i in range(links))
    joints = "\n".join(
        f"  j{i}: {{type: revolute, parent: {f'b{i - 1}' if i else 'ground'}, child: b{i}}}"
        for i in range(links)
    )
    return f"model: chain\nplane: xy\nbodies:\n{bodies}\njoints:\n{joints}\n"


@pytest.fixture
def collections() -> Iterator[list[str]]:
    """The collections of garbage that begin."""
    begun: list[str] = []

    def note(phase: str, info: dict[str, int]) -> None:
        if phase == "start":
            begun.append(phase)

    gc.callbacks.append(note)
    yield begun
    gc.callbacks.remove(note)


def test_reading_does_not_collect(collections: list[str]) -> None:
    model = load_text(chain(LINKS))
    count = len(collections)
    assert len(model.bodies) == LINKS
    assert count <= 1, "one may come before or after"
    assert gc.isenabled()


@pytest.mark.parametrize("restore", [gc.enable, gc.disable])
def test_collecting_is_as_before(restore: Callable[[], None]) -> None:
    restore()
    before = gc.isenabled()
    try:
        with pytest.raises(ModelError):
            load_text("model: [")
        assert gc.isenabled() == before
    finally:
        gc.enable()
