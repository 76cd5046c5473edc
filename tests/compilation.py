"""How tests compile what they generate."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from codegen import compiler


@contextmanager
def unoptimised() -> Iterator[None]:
    """Compilers do not optimise: a third of their time, for code that runs shortly."""
    flags = {"FLAGS": tuple(x for x in compiler.FLAGS if x != "-O2"), "BATCH": (), "STEPS": ()}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in flags.items():
            patch.setattr(compiler, name, value)
        yield
