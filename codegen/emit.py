"""emit: all text files of the generated folder of a Program, with their hashes in the manifest."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from codegen import text
from codegen.compiler import BINARIES, extension_suffix, shared_library
from codegen.program import Program
from codegen.seal import DERIVATION, MANIFEST, VERIFICATION, manifest_seal
from codegen.targets import ON_REQUEST, TARGETS, Target
from derive.diagnostics import AssumptionError, HamelError, ModelError, did_you_mean

README = "README.md"
UNCHECKED: Mapping[str, str] = MappingProxyType({})


def emit(program: Program, extra: Mapping[str, str] | None = None) -> dict[str, str]:
    """All text files of the generated folder: relative path → text.

    Raises ModelError for a model whose name makes two files of one name, AssumptionError where a
    target on request does not fit.
    """
    asked = on_request(program.targets)
    _check_fit(program, asked)
    usual = [target.files(program) for target in TARGETS]
    further = {target.name: target.files(program) for target in asked}
    readme = {README: _readme(program, asked)} if asked else {}
    parts = [*usual, *further.values(), readme]
    _check_names(program.name, [name for name, _ in {pair for x in parts for pair in x.items()}])
    files = {name: text for part in parts for name, text in part.items()}
    if asked:
        files[MANIFEST] = _with_targets(files[MANIFEST], further)
    return sealed(files, extra or {})


def on_request(names: Collection[str]) -> tuple[Target, ...]:
    """The targets of these names, in the order of the table. Raises HamelError for another name."""
    known = {target.name: target for target in ON_REQUEST}
    for name in names:
        if name not in known:
            near = did_you_mean(name, known) or f"there are: {', '.join(known) or 'none'}"
            raise HamelError(f"unknown target '{name}'", near)
    return tuple(target for name, target in known.items() if name in names)


def sealed(
    files: Mapping[str, str], extra: Mapping[str, str], checked: Mapping[str, str] = UNCHECKED
) -> dict[str, str]:
    """With `extra` among them, the hashes of all in the manifest, how targets on request were
    `checked`, and the manifest's own hash."""
    others = {name: text for name, text in sorted({**files, **extra}.items()) if name != MANIFEST}
    hashes = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in others.items()}
    manifest: dict[str, Any] = {**json.loads(files[MANIFEST]), "files": hashes}
    for name, how in checked.items():
        manifest["targets"][name]["verified"] = how
    if VERIFICATION in others:
        manifest["verification"] = json.loads(others[VERIFICATION])["summary"]
    manifest["seal"] = manifest_seal(manifest)
    return dict(sorted((others | {MANIFEST: json.dumps(manifest, indent=1) + "\n"}).items()))


def _check_fit(program: Program, asked: Sequence[Target]) -> None:
    for target in asked:
        reason = target.refusal(program)
        if reason:
            raise misfit(program.name, target, reason)


def misfit(model: str, target: Target, reason: str) -> AssumptionError:
    """A target on request does not fit a model."""
    return AssumptionError(f"{model}: the target {target.name} does not fit: {reason}")


def _readme(program: Program, asked: Sequence[Target]) -> str:
    """How to use each target, a section each."""
    head = text.render("readme.md.j2", program)
    names = {"prefix": program.name, "PREFIX": program.name.upper()}
    sections = (text.render(target.readme, program, **names) for target in asked if target.readme)
    return "\n".join([head, *sections])


def _with_targets(manifest: str, files: Mapping[str, Mapping[str, str]]) -> str:
    """What each target on request wrote; how it was verified is not known yet."""
    targets = {name: {"files": sorted(wrote), "verified": ""} for name, wrote in files.items()}
    return json.dumps({**json.loads(manifest), "targets": targets})


def _check_names(model: str, emitted: Iterable[str]) -> None:
    """Files and compiled modules as a set (two targets may share a file), also where a file system
    does not tell a from A.

    Python takes the compiled _NAME before a _NAME.py, so that these must differ, too.
    """
    compiled = [shared_library(model), f"_{model}{extension_suffix()}", BINARIES]
    later = [MANIFEST, VERIFICATION, DERIVATION]
    files = [name for name in emitted if name != MANIFEST]
    names = [name.lower() for name in (*files, *later, *compiled, f"_{model}.py")]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ModelError(
            f"a model cannot be called '{model}': two files of its module would be {twice[0]}",
            hint="give the model another name",
        )
