"""Compiled templates: Jinja's byte code is stored beside Python's own.

To compile the templates of a module and its pages takes a third of a second, as long as to derive
a small mechanism. Python stores what it compiled in `__pycache__`; so do we, in the same folders
and by the same rules: nothing where Python is told not to (PYTHONDONTWRITEBYTECODE), nothing where
the folder cannot be written, and elsewhere where PYTHONPYCACHEPREFIX says so.
"""

from __future__ import annotations

import hashlib
import sys
from contextlib import suppress
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

from jinja2 import BaseLoader, Environment, FileSystemBytecodeCache, StrictUndefined
from jinja2.bccache import Bucket


def environment(loader: BaseLoader, folder: Path, **settings: bool) -> Environment:
    """Jinja's environment over the templates of `loader`, with the byte code in `folder`.

    An undefined name is an error; blocks leave no empty lines behind.
    """
    settings = {"trim_blocks": True, "lstrip_blocks": True, **settings}
    cache = _ByteCode(folder, settings)
    options: dict[str, Any] = {"undefined": StrictUndefined, "bytecode_cache": cache, **settings}
    return Environment(loader=loader, **options)


class _ByteCode(FileSystemBytecodeCache):
    """Byte code of templates in `__pycache__` of `folder`.

    Jinja compares a hash of the source; what else the byte code depends on stands in its name.
    """

    def __init__(self, folder: Path, settings: dict[str, bool]) -> None:
        said = hashlib.sha256(repr(sorted(settings.items())).encode()).hexdigest()[:8]
        place = Path(cache_from_source(str(folder / "template.py"))).parent
        super().__init__(str(place), f"template-{said}-%s.j2c")

    def load_bytecode(self, bucket: Bucket) -> None:
        """Read it where it can be read."""
        with suppress(OSError):
            super().load_bytecode(bucket)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Store it where that is allowed."""
        if sys.dont_write_bytecode:
            return
        with suppress(OSError):
            Path(self.directory).mkdir(parents=True, exist_ok=True)
            super().dump_bytecode(bucket)
