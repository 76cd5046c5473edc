"""The C of an FMU, called as an importer calls it: values, modes, states, derivatives, two instances
at once, and calls that the standard does not allow; and NAME.fmu, compiled again from its sources.

Of codegen.runtime: build_fmu.
Of codegen.targets: fmu.
Of hamel.verify.targets: fmu.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
import sys
import warnings
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from codegen import compiler
from codegen.emit import emit
from codegen.loader import load
from derive.diagnostics import AssumptionError
from hamel.build.options import BuildOptions
from hamel.build.stages import equations_of, program_for

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

ROOT = Path(__file__).parents[3]
OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3
RTOL = 1e-11
SYMBOLS = """
GetVersion SetDebugLogging InstantiateModelExchange InstantiateCoSimulation
InstantiateScheduledExecution FreeInstance EnterInitializationMode ExitInitializationMode
EnterEventMode Terminate Reset GetFloat32 GetFloat64 GetInt8 GetUInt8 GetInt16 GetUInt16 GetInt32
GetUInt32 GetInt64 GetUInt64 GetBoolean GetString GetBinary GetClock SetFloat32 SetFloat64 SetInt8
SetUInt8 SetInt16 SetUInt16 SetInt32 SetUInt32 SetInt64 SetUInt64 SetBoolean SetString SetBinary
SetClock GetNumberOfVariableDependencies GetVariableDependencies GetFMUState SetFMUState
FreeFMUState SerializedFMUStateSize SerializeFMUState DeserializeFMUState GetDirectionalDerivative
GetAdjointDerivative EnterConfigurationMode ExitConfigurationMode GetIntervalDecimal
GetIntervalFraction GetShiftDecimal GetShiftFraction SetIntervalDecimal SetIntervalFraction
SetShiftDecimal SetShiftFraction EvaluateDiscreteStates UpdateDiscreteStates
EnterContinuousTimeMode CompletedIntegratorStep SetTime SetContinuousStates
GetContinuousStateDerivatives GetEventIndicators GetContinuousStates
GetNominalsOfContinuousStates GetNumberOfEventIndicators GetNumberOfContinuousStates EnterStepMode
GetOutputDerivatives DoStep ActivateModelPartition
"""
# A tree, with a name that XML has to escape and events, one of which ends the motion.
SWING = """
model: swing
description: A rod & its "hinge" <driven>.
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 1 kg, l: 0.5 m, rate: 0.3 N*m}
bodies:
  rod: {mass: m, com: [l/2, 0], inertia: m*l**2/12}
joints:
  A: {type: revolute, parent: ground, child: rod, coordinate: q}
inputs:
  tau: {joint: A}
loads:
  drive: {type: expression, joint: A, expression: rate*sin(3 rad/s*t)}
initial: {q: 0.2 rad, der(q): 0 rad/s}
outputs:
  tip: "position(rod, [l, 0])"
events:
  fast: der(q) + 2 rad/s
  down: {formula: q + 1.2 rad, direction: falling, stop: true}
"""


class Fmu:
    """The library of an FMU and its variables by name."""

    def __init__(self, library: Path, description: ElementTree.Element) -> None:
        self.library = ctypes.CDLL(str(library))
        self.token = description.attrib["instantiationToken"].encode()
        self.references = {
            v.attrib["name"]: int(v.attrib["valueReference"])
            for v in description.iterfind("ModelVariables/Float64")
        }
        self.messages: list[tuple[int, str]] = []
        kind = ctypes.CFUNCTYPE(
            None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
        )
        self._log = kind(lambda _, status, __, text: self.messages.append((status, text.decode())))

    @contextmanager
    def instance(
        self, kind: str = "CoSimulation", token: bytes | None = None, early: bool = False
    ) -> Iterator[Instance]:
        head = (b"one", token or self.token, None, False, True)
        more = (False, early, None, ctypes.c_size_t(0)) if kind == "CoSimulation" else ()
        make = getattr(self.library, f"fmi3Instantiate{kind}")
        make.restype = ctypes.c_void_p
        pointer = make(*head, *more, None, self._log, *((None,) if more else ()))
        instance = Instance(self, pointer)
        yield instance
        if pointer:
            instance.free()


class Instance:
    """An instance: `call("SetTime", …)` is fmi3SetTime; floats go as double, ints as size_t."""

    def __init__(self, fmu: Fmu, pointer: int | None) -> None:
        self.fmu, self.pointer = fmu, pointer
        self.early = False  # whether the last step returned early

    def free(self) -> None:
        self.fmu.library.fmi3FreeInstance(ctypes.c_void_p(self.pointer))

    def call(self, name: str, *given: Any) -> int:
        return getattr(self.fmu.library, f"fmi3{name}")(ctypes.c_void_p(self.pointer), *given)

    def vrs(self, names: Sequence[str]) -> tuple[Any, ctypes.c_size_t]:
        known = self.fmu.references
        numbers = [known[name] if isinstance(name, str) else name for name in names]
        return (ctypes.c_uint32 * len(names))(*numbers), ctypes.c_size_t(len(names))

    def get(self, *names: str) -> np.ndarray:
        values = (ctypes.c_double * len(names))()
        vrs, n = self.vrs(names)
        assert self.call("GetFloat64", vrs, n, values, n) == OK, self.fmu.messages
        return np.array(values)

    def set(self, **values: float) -> int:
        return self.put(list(values), list(values.values()))

    def put(self, names: Sequence[str], values: Sequence[float]) -> int:
        vrs, n = self.vrs(names)
        return self.call("SetFloat64", vrs, n, (ctypes.c_double * len(values))(*values), n)

    def enter(self, tolerance: float = RTOL, start: float = 0.0) -> int:
        numbers = (ctypes.c_double(tolerance), ctypes.c_double(start))
        return self.call("EnterInitializationMode", True, *numbers, False, ctypes.c_double(0.0))

    def begin(self, **values: float) -> Instance:
        assert self.set(**values) == OK
        assert self.enter() == OK
        assert self.call("ExitInitializationMode") == OK
        return self

    def step(self, start: float, length: float) -> tuple[int, bool, float]:
        flags = [ctypes.c_bool() for _ in range(3)]
        reached = ctypes.c_double()
        numbers = ctypes.c_double(start), ctypes.c_double(length)
        pointers = [ctypes.byref(item) for item in (*flags, reached)]
        status = self.call("DoStep", *numbers, False, *pointers)
        self.early = flags[2].value
        return status, flags[1].value, reached.value

    def derivative(
        self, kind: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
    ) -> np.ndarray:
        count = len(unknowns) if kind == "Directional" else len(knowns)
        out = (ctypes.c_double * count)()
        given = (ctypes.c_double * len(seed))(*seed)
        sizes = ctypes.c_size_t(len(seed)), ctypes.c_size_t(count)
        lists = (*self.vrs(unknowns), *self.vrs(knowns))
        status = self.call(f"Get{kind}Derivative", *lists, given, sizes[0], out, sizes[1])
        assert status == OK, self.fmu.messages
        return np.array(out)

    def update(self) -> tuple[int, bool, bool]:
        """Status; whether the motion is to end; whether states changed."""
        flags = [ctypes.c_bool() for _ in range(5)]
        pointers = [ctypes.byref(flag) for flag in flags]
        status = self.call("UpdateDiscreteStates", *pointers, ctypes.byref(ctypes.c_double()))
        return status, flags[1].value, flags[3].value

    def states(self, x: Sequence[float]) -> int:
        values = (ctypes.c_double * len(x))(*x)
        return self.call("SetContinuousStates", values, ctypes.c_size_t(len(x)))


def built(model: Path, folder: Path) -> tuple[ModuleType, Fmu, Path]:
    """Texts, the library without optimisation, the FMU of it."""
    program = program_for(equations_of(model), BuildOptions(targets=("fmu",)))
    for name, text in emit(program).items():
        (folder / name).write_text(text, encoding="utf-8")
    stems = compiler.sources(folder, program.name)
    compiled(folder, [f"{stem}.c" for stem in stems], compiler.shared_library(program.name))
    assert compiler.packed(folder) == [f"{program.name}.fmu"]
    description = ElementTree.parse(folder / "modelDescription.xml").getroot()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        module = load(folder)
    return module, Fmu(folder / compiler.shared_library(program.name), description), folder


def compiled(folder: Path, files: Sequence[str], made: str, language: str = "c99") -> None:
    command = compiler.find_compiler() or []
    subprocess.run(
        [*command, f"-std={language}", "-O0", "-fPIC", "-shared", *files, "-lm", "-o", made],
        cwd=folder,
        check=True,
    )


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> tuple[ModuleType, Fmu, Path]:
    folder = tmp_path_factory.mktemp("loop") / "four_bar"
    folder.mkdir()
    return built(ROOT / "models" / "four_bar.yaml", folder)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> tuple[ModuleType, Fmu, Path]:
    base = tmp_path_factory.mktemp("tree")
    (base / "swing.yaml").write_text(SWING, encoding="utf-8")
    (base / "swing").mkdir()
    return built(base / "swing.yaml", base / "swing")


LOOP = ("q1", "q2", "q3", "q1_dot")


def test_all_functions_of_the_standard_are_there(tree: Any) -> None:
    assert [name for name in SYMBOLS.split() if not hasattr(tree[1].library, f"fmi3{name}")] == []
    version = tree[1].library.fmi3GetVersion
    version.restype = ctypes.c_char_p
    assert version() == b"3.0"


def test_the_description_is_complete(tree: Any) -> None:
    """Names are unique and escaped, units have exponents, angles count."""
    root = ElementTree.parse(tree[2] / "modelDescription.xml").getroot()
    assert root.attrib["description"] == 'A rod & its "hinge" <driven>.'
    variables = root.findall("ModelVariables/Float64")
    assert [int(v.attrib["valueReference"]) for v in variables] == list(range(len(variables)))
    assert len({v.attrib["name"] for v in variables}) == len(variables)
    units = {u.attrib["name"]: u.find("BaseUnit") for u in root.iterfind("UnitDefinitions/Unit")}
    assert {v.attrib["unit"] for v in variables if "unit" in v.attrib} <= units.keys()
    assert units["rad/s"].attrib == {"s": "-1", "rad": "1"}  # pyright: ignore
    assert units["N*m"].attrib == {"m": "2", "kg": "1", "s": "-2"}  # pyright: ignore
    rate = next(v for v in variables if v.attrib["name"] == "der(q)")
    assert rate.attrib["causality"] == "local" or "derivative" not in rate.attrib
    assert len(root.findall("ModelStructure/EventIndicator")) == 2
    assert len(root.findall("ModelStructure/ContinuousStateDerivative")) == 2


def test_co_simulation_is_the_simulation_of_the_module(loop: Any) -> None:
    """Step after step with inputs that change between them."""
    module, fmu, _ = loop
    with fmu.instance() as i:
        i.begin(tau=0.5)
        start = i.get(*LOOP)
        for k in range(4):
            if k == 2:
                assert i.set(tau=-1.0) == OK
            assert i.step(0.05 * k, 0.05) == (OK, False, 0.05 * k + 0.05)
        found = i.get(*LOOP)
    tight = {"rtol": RTOL, "atol": RTOL / 100}
    half = module.simulate((0.0, 0.1), start, [0.5], times=[0.1], **tight).x[-1]
    whole = module.simulate((0.1, 0.2), half, [-1.0], times=[0.2], **tight).x[-1]
    np.testing.assert_allclose(found, whole, rtol=1e-9, atol=1e-9)


def test_variables_are_results_of_the_module(loop: Any) -> None:
    module, fmu, _ = loop
    with fmu.instance("ModelExchange") as i:
        i.begin(tau=0.7)
        x = i.get(*LOOP)
        rates = [f"der({name})" for name in LOOP]
        np.testing.assert_allclose(i.get(*rates), module.dynamics(0.0, x, [0.7]), rtol=1e-13)
        energy = i.get("kinetic_energy", "potential_energy")
        np.testing.assert_allclose(energy, module.energy(0.0, x), rtol=1e-13)
        forces = i.get("reaction C.x", "reaction C.y")
        np.testing.assert_allclose(forces, module.reactions(0.0, x, [0.7]), rtol=1e-13)
        assert np.array_equal(i.get("tip[0]", "tip[1]"), module.outputs(0.0, x))


def test_start_values_of_a_loop_are_guesses(loop: Any) -> None:
    """They move to the nearest position that closes the loop, and only before the initialization."""
    module, fmu, _ = loop
    with fmu.instance() as i:
        i.begin(q1=1.0, q2=0.3, q3=1.5)
        x = i.get(*LOOP)
        assert np.max(np.abs(module.constraints(0.0, x))) < 1e-12
        assert i.set(q1=1.0) == ERROR
    with fmu.instance() as i:
        assert i.set(l1=10.0) == OK and i.enter() == OK
        assert i.call("ExitInitializationMode") == ERROR
        assert "no consistent state near the start values" in fmu.messages[-1][1]


def test_parameters_are_tuned_between_steps(loop: Any) -> None:
    """Another length closes the loop elsewhere."""
    module, fmu, _ = loop
    with fmu.instance() as i:
        i.begin()
        i.step(0.0, 0.01)
        assert i.set(l2=0.51) == OK
        assert i.step(0.01, 0.01)[0] == OK
        p = np.array(module.defaults) if hasattr(module, "defaults") else module._shared.DEFAULTS
        p = np.array(p, dtype=float)
        p[1] = 0.51
        assert np.max(np.abs(module.constraints(0.02, i.get(*LOOP), p=p))) < 1e-9


def test_instances_do_not_know_each_other(loop: Any) -> None:
    """Two, step by step in turns, go as each alone."""
    _, fmu, _ = loop

    def alone(tau: float) -> np.ndarray:
        with fmu.instance() as i:
            i.begin(tau=tau)
            for k in range(5):
                i.step(0.02 * k, 0.02)
            return i.get(*LOOP)

    with fmu.instance() as a, fmu.instance() as b:
        a.begin(tau=1.0)
        b.begin(tau=-2.0)
        for k in range(5):
            a.step(0.02 * k, 0.02)
            b.step(0.02 * k, 0.02)
        assert np.array_equal(a.get(*LOOP), alone(1.0))
        assert np.array_equal(b.get(*LOOP), alone(-2.0))


def test_a_state_goes_on_as_if_nothing_had_happened(loop: Any) -> None:
    """Taken and set in one instance, and through bytes in another."""
    _, fmu, _ = loop
    with fmu.instance() as i, fmu.instance() as other, fmu.instance("ModelExchange") as exchange:
        i.begin(tau=1.0)
        i.step(0.0, 0.05)
        state, size = ctypes.c_void_p(), ctypes.c_size_t()
        assert i.call("GetFMUState", ctypes.byref(state)) == OK
        i.step(0.05, 0.05)
        first = i.get(*LOOP)
        i.set(tau=9.0)
        i.step(0.1, 0.05)
        assert i.call("SetFMUState", state) == OK
        assert i.step(0.05, 0.05)[0] == OK
        assert np.array_equal(i.get(*LOOP), first)
        assert i.call("SerializedFMUStateSize", state, ctypes.byref(size)) == OK
        data = (ctypes.c_uint8 * size.value)()
        assert i.call("SerializeFMUState", state, data, size) == OK
        again = ctypes.c_void_p()
        assert other.call("DeserializeFMUState", data, size, ctypes.byref(again)) == OK
        assert other.call("SetFMUState", again) == OK
        assert other.step(0.05, 0.05)[0] == OK
        assert np.array_equal(other.get(*LOOP), first)
        assert exchange.call("SetFMUState", again) == ERROR
        short = ctypes.c_size_t(size.value - 1)
        assert other.call("DeserializeFMUState", data, short, ctypes.byref(again)) == ERROR
        data[0] ^= 1
        assert other.call("DeserializeFMUState", data, size, ctypes.byref(again)) == ERROR
        for owner, kept in ((i, state), (other, again)):
            assert owner.call("FreeFMUState", ctypes.byref(kept)) == OK and not kept.value


@pytest.mark.parametrize("name", ["loop", "tree"])
def test_derivatives_are_exact(name: str, request: pytest.FixtureRequest) -> None:
    """Directional ones are differences, adjoint ones their transpose; outputs and states among
    the unknowns."""
    _, fmu, folder = request.getfixturevalue(name)
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    names = {vr: variable for variable, vr in fmu.references.items()}
    structure = root.find("ModelStructure")
    assert structure is not None
    rates = [names[int(e.attrib["valueReference"])] for e in structure if "Cont" in e.tag]
    outputs = [names[int(e.attrib["valueReference"])] for e in structure if e.tag == "Output"]
    states, knowns = outputs[: len(rates)], [*outputs[: len(rates)], "tau"]
    random = np.random.default_rng(3)
    with fmu.instance("ModelExchange") as i:
        i.begin(tau=0.4)
        i.call("EnterContinuousTimeMode")
        x, unknowns = i.get(*states), [*rates, *outputs]
        seed, left = random.normal(size=len(knowns)), random.normal(size=len(unknowns))
        along = i.derivative("Directional", unknowns, knowns, seed)
        adjoint = i.derivative("Adjoint", unknowns, knowns, left)
        assert left @ along == pytest.approx(adjoint @ seed, rel=1e-12)
        ends = []
        for h in (-1e-6, 1e-6):
            i.states(x + h * seed[:-1])
            i.set(tau=0.4 + h * seed[-1])
            ends.append(i.get(*unknowns))
        np.testing.assert_allclose(along, (ends[1] - ends[0]) / 2e-6, rtol=1e-6, atol=1e-6)


def test_drift_is_taken_back_at_an_event(loop: Any) -> None:
    """Model Exchange: a state off its constraints asks for an event, where it is projected."""
    module, fmu, _ = loop
    with fmu.instance("ModelExchange") as i:
        i.begin()
        assert i.update() == (OK, False, False)
        i.call("EnterContinuousTimeMode")
        event, end = ctypes.c_bool(), ctypes.c_bool()
        flags = ctypes.byref(event), ctypes.byref(end)
        assert i.call("CompletedIntegratorStep", True, *flags) == OK
        assert not event
        i.states(i.get(*LOOP) + 1e-6)
        assert i.call("CompletedIntegratorStep", True, *flags) == OK
        assert event and not end
        i.call("EnterEventMode")
        assert i.update() == (OK, False, True)
        assert np.max(np.abs(module.constraints(0.0, i.get(*LOOP)))) < 1e-12


def test_an_event_that_stops_ends_the_simulation(tree: Any) -> None:
    """Co-Simulation returns at its time; Model Exchange sees the sign of its indicator change."""
    module, fmu, _ = tree
    x = ("q", next(n for n, vr in fmu.references.items() if vr == 2))
    with fmu.instance() as i:
        i.begin()
        start = i.get(*x)
        status, ended, reached = i.step(0.0, 5.0)
        assert (status, ended) == (OK, True)
        motion = module.simulate((0.0, 5.0), start, [0.0], rtol=RTOL, atol=RTOL / 100)
        assert reached == pytest.approx(motion.t[-1], abs=1e-9)
        assert i.get("q")[0] == pytest.approx(-1.2, abs=1e-9)
    with fmu.instance("ModelExchange") as i:
        i.begin()
        assert i.update() == (OK, False, False)
        for q, ends in ((-1.0, False), (-1.3, True)):
            i.call("EnterContinuousTimeMode")
            i.states([q, -1.0])
            indicators = (ctypes.c_double * 2)()
            assert i.call("GetEventIndicators", indicators, ctypes.c_size_t(2)) == OK
            assert list(indicators) == pytest.approx([1.0, q + 1.2])
            i.call("EnterEventMode")
            assert i.update()[:2] == (OK, ends)


@pytest.mark.parametrize(("left", "ends"), [(3e-13, True), (1e-6, False)])
def test_the_near_side_of_a_stop_is_the_stop(tree: Any, left: float, ends: bool) -> None:
    """Importers may hand out a time just before the indicator changes its sign, and ask for no
    event until the motion comes back."""
    _, fmu, _ = tree
    with fmu.instance("ModelExchange") as i:
        i.begin()
        assert i.update() == (OK, False, False)
        i.call("EnterContinuousTimeMode")
        event, end = ctypes.c_bool(), ctypes.c_bool()
        flags = ctypes.byref(event), ctypes.byref(end)
        i.call("SetTime", ctypes.c_double(0.5))
        i.states([-1.2 + left, -1.0])
        assert i.call("CompletedIntegratorStep", True, *flags) == OK and not event
        i.call("EnterEventMode")
        assert i.update()[:2] == (OK, ends)
        i.call("EnterContinuousTimeMode")
        i.call("SetTime", ctypes.c_double(0.6))
        i.states([-1.3, -1.0])
        assert i.call("CompletedIntegratorStep", True, *flags) == OK and event
        i.call("EnterEventMode")
        assert i.update()[:2] == (OK, True)


def test_a_step_returns_early_where_that_is_allowed(tree: Any) -> None:
    _, fmu, _ = tree
    for allowed in (False, True):
        with fmu.instance(early=allowed) as i:
            i.begin()
            status, terminates, reached = i.step(0.0, 5.0)
            assert (status, terminates, i.early) == (OK, True, allowed)
            assert 0.0 < reached < 5.0  # importers that do not look at it: docs/targets/fmu.md


def test_an_instance_needs_the_right_token(tree: Any) -> None:
    _, fmu, _ = tree
    with fmu.instance(token=b"{another}") as i:
        assert i.pointer is None
    assert "token" in fmu.messages[-1][1]
    scheduled = fmu.library.fmi3InstantiateScheduledExecution
    scheduled.restype = ctypes.c_void_p
    assert scheduled(b"a", fmu.token, None, False, False, *(None,) * 5) is None


def test_calls_in_the_wrong_mode_are_refused(tree: Any) -> None:
    """With fmi3Error, a message, and no change."""
    _, fmu, _ = tree
    one, two = ctypes.c_double(), (ctypes.c_double * 2)()
    size = ctypes.c_size_t(2)
    exchange = [
        ("Instantiated", ["ExitInitializationMode", "EnterEventMode", "Terminate"]),
        ("Initialization Mode", ["EnterContinuousTimeMode", "EnterEventMode", "Terminate"]),
        ("Event Mode", ["ExitInitializationMode", "EnterEventMode", "EnterStepMode"]),
        ("Continuous-Time Mode", ["EnterContinuousTimeMode", "ExitInitializationMode"]),
        ("Terminated", ["Terminate", "EnterEventMode", "ExitInitializationMode"]),
    ]
    ways = [
        lambda i: OK,
        lambda i: i.enter(),
        lambda i: i.call("ExitInitializationMode"),
        lambda i: i.call("EnterContinuousTimeMode"),
        lambda i: i.call("Terminate"),
    ]
    with fmu.instance("ModelExchange") as i:
        for (mode, calls), way in zip(exchange, ways):
            assert way(i) == OK
            for call in [*calls, "EnterConfigurationMode", "EvaluateDiscreteStates"]:
                before = len(fmu.messages)
                assert i.call(call) == ERROR, (mode, call)
                assert len(fmu.messages) == before + 1
            assert i.step(0.0, 0.1)[0] == ERROR
            if mode == "Instantiated":
                assert i.call("GetFloat64", *i.vrs(["q"]), ctypes.byref(one), 1) == ERROR
            if mode != "Continuous-Time Mode":
                assert i.call("SetContinuousStates", two, size) == ERROR
        assert i.call("Reset") == OK and i.enter() == OK
    with fmu.instance() as i:
        i.begin()
        for call in ("EnterEventMode", "EnterContinuousTimeMode", "EnterStepMode"):
            assert i.call(call) == ERROR
        assert i.call("GetContinuousStates", two, size) == ERROR
        assert i.call("SetTime", one) == ERROR


def test_wrong_values_are_refused(tree: Any) -> None:
    """None is taken over where one is wrong."""
    _, fmu, _ = tree
    with fmu.instance() as i:
        assert i.put(["m", 999], [3.0, 1.0]) == ERROR
        assert i.set(m=3.0, tau=float("nan")) == ERROR
        assert i.put(["kinetic_energy"], [1.0]) == ERROR and i.put(["time"], [1.0]) == ERROR
        assert i.enter(tolerance=-1.0) == ERROR and i.enter(start=float("inf")) == ERROR
        i.begin()
        assert i.get("m")[0] == 1.0
        for start, length in ((0.0, 0.0), (0.0, -1.0), (0.0, float("nan")), (1.0, 0.1)):
            assert i.step(start, length)[0] == ERROR
        assert i.step(0.0, 0.1)[0] == OK
        assert i.call("GetInt32", *i.vrs(["q"]), None, ctypes.c_size_t(1)) == ERROR
        assert i.call("GetInt32", *i.vrs([]), None, ctypes.c_size_t(0)) == OK


def test_the_sources_make_the_same_fmu(tree: Any, tmp_path: Path) -> None:
    """What buildDescription.xml lists is all there is to compile, and needs nothing else."""
    _, fmu, folder = tree
    with zipfile.ZipFile(folder / "swing.fmu") as archive:
        archive.extractall(tmp_path)
    root = ElementTree.parse(tmp_path / "sources" / "buildDescription.xml").getroot()
    files = [e.attrib["name"] for e in root.iter("SourceFile")]
    compiled(tmp_path / "sources", files, "again.so", "gnu99")  # as CMake understands C99
    description = ElementTree.parse(tmp_path / "modelDescription.xml").getroot()
    again = Fmu(tmp_path / "sources" / "again.so", description)
    with fmu.instance() as a, again.instance() as b:
        for i in (a, b):
            i.begin(tau=0.1)
            i.step(0.0, 0.1)
        assert np.array_equal(a.get("q", "power"), b.get("q", "power"))


def test_packing_again_gives_the_same_bytes(tree: Any) -> None:
    path = tree[2] / "swing.fmu"
    first = path.read_bytes()
    compiler.packed(tree[2])
    assert path.read_bytes() == first


@pytest.mark.parametrize("language", ["c99", "gnu99", "c17"])
@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_the_c_has_no_warnings(name: str, language: str, tree: Any) -> None:
    if shutil.which(name) is None:
        pytest.skip(f"no {name}")
    flags = [
        f"-std={language}",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Wshadow",
        "-Werror",
        "-fsyntax-only",
    ]
    subprocess.run([name, *flags, "swing_fmi.c"], cwd=tree[2], check=True)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"choice": "swing+tangent"}, "from one of the charts swing, tangent"),
        ({"real": "float32"}, "float64"),
        ({"integrators": ("rk4",)}, "step control"),
    ],
)
def test_what_fits_no_fmu_is_refused_by_name(options: Any, reason: str) -> None:
    options = BuildOptions(targets=("fmu",), **options)
    equations = equations_of(ROOT / "models" / "pendulum.yaml", options.choice)
    with pytest.raises(AssumptionError, match=re.escape(reason)):
        emit(program_for(equations, options))


def test_a_state_of_several_meanings_is_refused_before_the_passes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They may take minutes."""
    monkeypatch.setattr(sys.modules["hamel.build.stages"], "program", None)
    equations = equations_of(ROOT / "models" / "pendulum.yaml", "swing+tangent")
    for target in ("fmu", "fmu2", "acados"):
        with pytest.raises(AssumptionError, match="from one of the charts swing, tangent"):
            program_for(equations, BuildOptions(targets=(target,)))
