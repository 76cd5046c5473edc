"""The FMU of FMI 2.0: all its functions are there and those of 3.0 are not, errors in it are seen,
its sources are those that it names.

Of codegen.targets: fmu2.
Of hamel.verify.targets: fmu2.
"""

import ctypes
import re
import shutil
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from codegen import compiler
from derive.diagnostics import VerificationError
from hamel.verify.targets import fmu2 as checked
from tests.subjects import subject

SYMBOLS = """
GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment
EnterInitializationMode ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean
GetString SetReal SetInteger SetBoolean SetString GetFMUstate SetFMUstate FreeFMUstate
SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative EnterEventMode
NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime SetContinuousStates
GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates
SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus GetRealStatus
GetIntegerStatus GetBooleanStatus GetStringStatus
"""
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler"),
]


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    base = tmp_path_factory.mktemp("fmi2")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        return subject(base, "four_bar", ["fmu2"], ("default",))


def test_all_functions_are_there(four_bar):
    library = ctypes.CDLL(str(four_bar.folder / compiler.shared_library("four_bar")))
    assert all(hasattr(library, f"fmi2{name}") for name in SYMBOLS.split())
    assert not hasattr(library, "fmi3DoStep")


def test_its_sources_are_in_it(four_bar):
    with zipfile.ZipFile(four_bar.folder / "four_bar_fmi2.fmu") as archive:
        said = archive.read("modelDescription.xml").decode()
        names = {name for name in archive.namelist() if name.endswith(".c")}
    listed = re.findall(r'File name="([^"]+)"', said)
    assert {f"sources/{name}" for name in listed} == names
    assert "sources/four_bar_fmi2.c" in names and "sources/four_bar_module.c" not in names


DESCRIPTION, HEADER = "modelDescription.xml", "runtime_fmi2.h"
RATES = "return STATUS(fmi3GetContinuousStateDerivatives(OF(component), rates_out, n));"
HALF = """{
    const fmi2Status status = STATUS(fmi3GetContinuousStateDerivatives(OF(component), rates_out, n));
    rates_out[0] *= 0.5;
    return status;
    }"""


def replaced(fmu, parts, file, texts):
    """Texts of a file of the FMU replaced, and its sources compiled again where it is one of them."""
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(parts)
    place = next(parts.rglob(file))
    text = place.read_text("utf-8")
    assert texts[0] in text
    place.write_text(text.replace(*texts))
    if place.parent.name == "sources":
        command = [*(compiler.find_compiler() or []), "-std=gnu99", "-O0", "-fPIC", "-shared"]
        files = sorted(path.name for path in place.parent.glob("*.c"))
        library = next(parts.rglob(f"four_bar{compiler.SUFFIX}"))
        subprocess.run([*command, *files, "-lm", "-o", library], cwd=place.parent, check=True)
    with zipfile.ZipFile(fmu, "w") as archive:
        for path in filter(Path.is_file, parts.rglob("*")):
            archive.write(path, path.relative_to(parts))


@pytest.mark.parametrize(
    ("file", "before", "after", "seen"),
    [
        (DESCRIPTION, "modelName=", "modelNames=", {"description"}),
        (DESCRIPTION, 'variability="tunable"', 'variability="changing"', {"description"}),
        (HEADER, "from, length", "from, length", set()),
        (HEADER, RATES, HALF, {"values", "ModelExchange with CVODE"}),
        (HEADER, "n_knowns, seed, n_knowns,", "n_knowns, seed + 1, n_knowns,", {"derivatives"}),
        (HEADER, "c->tolerance = tolerance;", "c->tolerance = 1e-3;", {"CoSimulation"}),
        (HEADER, "c->instance, from, length", "c->instance, from, 0.5 * length", "DoStep"),
    ],
)
def test_errors_are_seen(four_bar, tmp_path, file, before, after, seen):
    """In the description, and in the C of the older standard, compiled again."""
    pytest.importorskip("fmpy")
    folder = tmp_path / "four_bar"
    shutil.copytree(four_bar.folder, folder)
    replaced(folder / "four_bar_fmi2.fmu", tmp_path / "parts", file, (before, after))
    if isinstance(seen, str):  # a call that is refused, since the one before did something else
        with pytest.raises(VerificationError, match=f"fmi2{seen} failed"):
            checked.check(replace(four_bar, folder=folder))
        return
    results = checked.check(replace(four_bar, folder=folder))
    assert {result.name for result in results if not result.passed} == seen
