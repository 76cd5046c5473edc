"""The package that generated modules stand in once they were loaded by their folder. What is
pickled of them goes by its name, so their names say where they are: a process that gets one of
their functions imports it from here."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

from codegen import loader

__path__: list[str] = []  # a package without a folder


class Folders:
    """Finds modules by the folders in their names."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """That of a folder; ImportError where it holds other equations than it did."""
        del path, target
        return loader.named_spec(name) if name.rpartition(".")[0] == __name__ else None


sys.meta_path.append(Folders)
