"""The FMU of FMI 2.0: all its functions are there and those of 3.0 are not, errors in it are seen,
its sources are those that it names.

Of codegen.targets: fmu2.
Of hamel.verify.targets: fmu2.
"""

import ctypes
import re
import shutil
import zipfile
from dataclasses import replace

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


@pytest.mark.parametrize(
    ("before", "after", "seen"),
    [
        ('fmiVersion="2.0" modelName', 'fmiVersion="2.0" modelNames', "description"),
        ('valueReference="1"', 'valueReference="2"', None),
        ("four_bar", "four_bar", ""),
    ],
)
def test_errors_are_seen(four_bar, tmp_path, before, after, seen):
    pytest.importorskip("fmpy")
    shutil.copytree(four_bar.folder, tmp_path / "four_bar")
    path = tmp_path / "four_bar" / "four_bar_fmi2.fmu"
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    text = parts["modelDescription.xml"].decode()
    assert before in text
    parts["modelDescription.xml"] = text.replace(before, after).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    spoiled = replace(four_bar, folder=tmp_path / "four_bar")
    if seen == "":
        assert all(result.passed for result in checked.check(spoiled))
        return
    try:
        results = checked.check(spoiled)
    except (VerificationError, Exception):  # what cannot even be read
        return
    assert any(not result.passed for result in results)
