"""emit: all text files of the generated folder of a Program, with their hashes in the manifest."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping

from codegen.compiler import BINARIES, extension_suffix, shared_library
from codegen.program import Program
from codegen.seal import DERIVATION, MANIFEST, VERIFICATION, manifest_seal
from codegen.targets import TARGETS
from derive.diagnostics import ModelError


def emit(program: Program, extra: Mapping[str, str] | None = None) -> dict[str, str]:
    """All text files of the generated folder: relative path → text.

    Raises ModelError for a model whose name makes two files of one name.
    """
    parts = [target.files(program) for target in TARGETS]
    _check_names(program.name, [name for part in parts for name in part])
    files = {name: text for part in parts for name, text in part.items()}
    return sealed(files, extra or {})


def sealed(files: Mapping[str, str], extra: Mapping[str, str]) -> dict[str, str]:
    """With `extra` among them, the hashes of all in the manifest, and the manifest's own."""
    others = {name: text for name, text in sorted({**files, **extra}.items()) if name != MANIFEST}
    hashes = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in others.items()}
    manifest = {**json.loads(files[MANIFEST]), "files": hashes}
    if VERIFICATION in others:
        manifest["verification"] = json.loads(others[VERIFICATION])["summary"]
    manifest["seal"] = manifest_seal(manifest)
    return dict(sorted((others | {MANIFEST: json.dumps(manifest, indent=1) + "\n"}).items()))


def _check_names(model: str, emitted: Iterable[str]) -> None:
    """Files and compiled modules as a set, also where a file system does not tell a from A.

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
