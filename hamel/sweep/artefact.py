"""A verified module on its way: its files, what was compiled of them here, and the states that it
was verified at. A machine that cannot use what was compiled compiles the sources once; one without
a compiler runs them on NumPy, and says so. Nothing runs before it gave the stored values."""

from __future__ import annotations

import contextlib
import json
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from codegen.emit import emit
from codegen.seal import VERIFICATION
from derive.diagnostics import VerificationError
from derive.formulations.records import Equations
from hamel.build import store
from hamel.build.module import Compiled, compiled, loaded
from hamel.build.scratch import workspace
from hamel.build.stages import program_of
from hamel.verify.shipped import shipped, shipped_checks


@dataclass(frozen=True)
class Artefact:
    """`texts` are the sources with the verification states, `binaries` what a compiler made of them
    where the artefact is from; `key` names the sources by their content."""

    name: str
    key: str
    texts: Mapping[str, str]
    binaries: Mapping[str, bytes]


@contextlib.contextmanager
def packed(
    equations: Equations, integrators: tuple[str, ...], enforcements: tuple[str, ...], real: str
) -> Iterator[tuple[Artefact, ModuleType]]:
    """Equations → artefact, and the module in it for whoever verifies it."""
    program = program_of(equations, None, integrators, enforcements, real)
    texts = dict(emit(program))
    emitted = {kernel.name for kernel in program.kernels}
    states = shipped(equations, emitted, 0, real=program.real)
    texts[VERIFICATION] = json.dumps({"functions": states})
    with compiled(program.name, texts) as folder:
        if folder.message:
            warnings.warn(folder.message, RuntimeWarning, stacklevel=3)
        yield of_folder(program.name, texts, folder), folder.module


def of_folder(name: str, texts: Mapping[str, str], folder: Compiled) -> Artefact:
    """Texts and what was compiled of them."""
    binaries = {name: data for name, data in folder.files.items() if name not in texts}
    key = store.digest(*(part for name in sorted(texts) for part in (name, texts[name])))
    return Artefact(name, key, texts, binaries)


def unpacked(artefact: Artefact) -> tuple[ModuleType, str]:
    """The module of an artefact, on this machine, and what is worth saying about it.

    Raises VerificationError where it does not give the stored values, ToolchainError where it can
    be neither loaded nor compiled.
    """
    with workspace() as place:
        folder = place / artefact.name
        folder.mkdir()
        for name, content in artefact.binaries.items():
            (folder / name).write_bytes(content)
        for name, text in artefact.texts.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        module = loaded(folder)
        if module.backend != "numpy":
            _check(folder, module)
            return module, ""
    with compiled(artefact.name, artefact.texts) as result:
        _check(Path(str(result.module.__file__)).parent, result.module)
        return result.module, result.message or "compiled from its sources"


def _check(folder: Path, module: ModuleType) -> None:
    failed = [check for check in shipped_checks(folder, module) if not check.passed]
    if failed:
        raise VerificationError(
            f"{module.name} does not give the stored values here: {failed[0].failure}"
        )
