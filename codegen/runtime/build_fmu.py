"""Packs a generated folder that was compiled into NAME.fmu: the library, its sources and what
describes them.

Standard library only. build.py runs this file in a generated folder. The same files give the same
bytes. No claim of licence is made on this file: 0BSD, see LICENSE.txt.
"""

from __future__ import annotations

import json
import pathlib
import platform
import sys
import zipfile
from xml.sax.saxutils import quoteattr

NAME = ""
EPOCH = (1980, 1, 1, 0, 0, 0)  # the first time that a zip file can tell
ENDINGS = {"win32": ".dll", "darwin": ".dylib"}
SYSTEMS = {"win32": "windows", "darwin": "darwin", "linux": "linux"}
MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}


def main(folder: pathlib.Path) -> list[str]:
    """Writes NAME.fmu into the folder; the names of the files made."""
    listed = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["files"]
    ours = [name for name in sorted(listed) if name.endswith((".c", ".h"))]
    sources = [name for name in ours if name not in left_out(folder)]
    ending = ENDINGS.get(sys.platform, ".so")
    parts = {
        "modelDescription.xml": (folder / "modelDescription.xml").read_bytes(),
        f"binaries/{tuple_here()}/{NAME}{ending}": (folder / f"lib{NAME}{ending}").read_bytes(),
        "sources/buildDescription.xml": description(sources).encode(),
        **{f"sources/{name}": (folder / name).read_bytes() for name in sources},
        "documentation/licenses/license.txt": (folder / "LICENSE.txt").read_bytes(),
    }
    write(folder / f"{NAME}.fmu", parts)
    return [f"{NAME}.fmu"]


def left_out(folder: pathlib.Path) -> set[str]:
    """C that is no part of the library: the module for Python and the example."""
    example = "example.c" if NAME.lower() != "example" else "example_program.c"
    return {f"{NAME}_module.c", example}


def tuple_here() -> str:
    """This machine, as the standard spells it: x86_64-linux."""
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
