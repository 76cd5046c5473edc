"""Packs a generated folder that was compiled into NAME.fmu, or NAME_fmi2.fmu: the library, its
sources and what describes them.

Standard library only. build.py runs this file in a generated folder. The same files give the same
bytes. No claim of licence is made on this file: 0BSD, see LICENSE.txt.
"""

from __future__ import annotations

import json
import pathlib
import platform
import sys
import zipfile
from typing import Any
from xml.sax.saxutils import quoteattr

NAME = ""
VERSION: int = 3  # of FMI
EPOCH = (1980, 1, 1, 0, 0, 0)  # the first time that a zip file can tell
ENDINGS = {"win32": ".dll", "darwin": ".dylib"}
SYSTEMS = {"win32": "windows", "darwin": "darwin", "linux": "linux"}
OLD_SYSTEMS = {"win32": "win", "darwin": "darwin", "linux": "linux"}
TARGETS = {2: "fmu2", 3: "fmu"}
FILES = {2: f"{NAME}_fmi2.fmu", 3: f"{NAME}.fmu"}
MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}


def main(folder: pathlib.Path) -> list[str]:
    """Writes the FMU into the folder; the names of the files made."""
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    texts = [name for name in sorted(manifest["files"]) if name.endswith((".c", ".h"))]
    others = left_out(manifest)
    sources = [name for name in texts if name not in others and "/" not in name]
    ending = ENDINGS.get(sys.platform, ".so")
    parts = {
        "modelDescription.xml": model_description(folder, sources).encode(),
        f"binaries/{tuple_here()}/{NAME}{ending}": (folder / f"lib{NAME}{ending}").read_bytes(),
        **({"sources/buildDescription.xml": description(sources).encode()} if VERSION > 2 else {}),
        **{f"sources/{name}": (folder / name).read_bytes() for name in sources},
        "documentation/licenses/license.txt": (folder / "LICENSE.txt").read_bytes(),
    }
    write(folder / FILES[VERSION], parts)
    return [FILES[VERSION]]


def left_out(manifest: dict[str, Any]) -> set[str]:
    """C that an FMU does not need: the module for Python, the example, other targets."""
    example = "example.c" if NAME.lower() != "example" else "example_program.c"
    others = {name: target["files"] for name, target in manifest["targets"].items()}
    own = others.pop(TARGETS[VERSION])
    rest = {file for files in others.values() for file in files} - set(own)
    bindings = {name for name in manifest["files"] if name.startswith("runtime_module")}
    return {f"{NAME}_module.c", example, *bindings, *rest}


def model_description(folder: pathlib.Path, sources: list[str]) -> str:
    """What describes the FMU; that of FMI 2.0 names the sources, too."""
    if VERSION > 2:
        return (folder / "modelDescription.xml").read_text(encoding="utf-8")
    text = (folder / "modelDescription2.xml").read_text(encoding="utf-8")
    names = [name for name in sources if name.endswith(".c")]
    files = "".join(f"\n      <File name={quoteattr(name)}/>" for name in names)
    inside = f">\n    <SourceFiles>{files}\n    </SourceFiles>\n  </"
    for kind in ("ModelExchange", "CoSimulation"):
        head, tail = text.split(f"  <{kind} ", 1)
        attributes, rest = tail.split("/>", 1)
        text = f"{head}  <{kind} {attributes}{inside}{kind}>{rest}"
    return text


def tuple_here() -> str:
    """This machine, as the standard spells it: x86_64-linux, or linux64."""
    if VERSION == 2:
        return f"{OLD_SYSTEMS.get(sys.platform, sys.platform)}{64 if sys.maxsize > 2**32 else 32}"
    machine = platform.machine().lower()
    return f"{MACHINES.get(machine, machine)}-{SYSTEMS.get(sys.platform, sys.platform)}"


def description(sources: list[str]) -> str:
    """buildDescription.xml: how the sources are compiled."""
    names = [name for name in sources if name.endswith(".c")]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            '<fmiBuildDescription fmiVersion="3.0">',
            f"  <BuildConfiguration modelIdentifier={quoteattr(NAME)}>",
            '    <SourceFileSet language="C99">',
            *(f"      <SourceFile name={quoteattr(name)}/>" for name in names),
            "    </SourceFileSet>",
            '    <Library name="m" external="true"/>',
            "  </BuildConfiguration>",
            "</fmiBuildDescription>",
            "",
        ]
    )


def write(path: pathlib.Path, parts: dict[str, bytes]) -> None:
    """A zip file without dates."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content)


if __name__ == "__main__":
    print("made " + ", ".join(main(pathlib.Path(__file__).resolve().parent)))
