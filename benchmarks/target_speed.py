"""What targets cost beside what they stand for, as ratios of least times taken in turn: an FMU's
step and the module's `simulate`, the JAX custom call and the module's batch and the same equations
in pure JAX, the Jacobian of the CasADi external and CasADi's own C of the same expressions,
WebAssembly in Node and the native library.

`python benchmarks/target_speed.py [MODEL [CHOICE]]`; writes build/target_speed.json. Run by
`make target-speed`.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from peers import pure_jax

from codegen import compiler, loader
from hamel.build.module import published
from hamel.build.options import BuildOptions
from hamel.build.stages import equations_of, program_for
from hamel.verify.targets.records import generated

HOME = Path(__file__).parent.parent
TARGETS = ("casadi", "fmu", "jax", "wasm")
STATES, STEPS, LENGTH, TURNS, SHORT = 10_000, 200, 0.01, 15, 300
# what is compared, and the most that it may be
LIMITS: dict[str, float | None] = {
    "FMU step / simulate": 1.3,
    "JAX custom call / batch": 1.1,
    "JAX custom call / pure JAX": 0.1,
    "CasADi external Jacobian / CasADi's own C": None,  # of our own, short expressions
    "WASM in Node / native": 2.0,
}
DRIVER = """#include <stdbool.h>
typedef int (*step)(void *, double, double, bool, bool *, bool *, bool *, double *);
int drive(step f, void *instance, double h, int n)
{
    bool event, terminate, early;
    double reached;
    int k, status = 0;
    for (k = 0; k < n && !status; k++)
        status = f(instance, k * h, h, true, &event, &terminate, &early, &reached);
    return status;
}
typedef int (*function)(double, const double *, const double *, const double *, double *);
int repeat(function f, const double *x, const double *u, const double *p, double *out, int n)
{
    int status = 0;
    while (n--)
        status |= f(0.0, x, u, p, out);
    return status;
}
"""
NODE = """
import { load } from "./%(name)s.mjs";
const model = await load(), raw = model.raw;
const [x, u, p, out] = model._room(%(nx)d, %(nu)d, %(np)d, %(nx)d);
model._view(x, %(nx)d).set(%(x)s);
model._view(u, %(nu)d).fill(0);
model._view(p, %(np)d).set(%(p)s);
const run = (n) => { for (let k = 0; k < n; k++) raw.dynamics(0, x, u, p, out); };
let least = Infinity;
for (const end = performance.now() + %(patience)d; performance.now() < end; ) {
    const start = performance.now();
    run(%(calls)d);
    least = Math.min(least, (performance.now() - start) / %(calls)d);
}
console.log(least * 1e-3);
"""
# a burst is short, so that one of them is not interrupted; the engine optimizes while it runs
CALLS, PATIENCE = 200, 4_000  # ms


class Built:
    """The module with its targets, a state that it may have, and a C library that calls in loops."""

    def __init__(self, path: Path, choice: str | None, base: Path) -> None:
        options = BuildOptions(functions=("default",), targets=TARGETS)
        program = program_for(equations_of(path, choice), options)
        self.name = program.name
        self.folder = published(program, base / program.name).folder
        self.module: Any = loader.load(self.folder)
        self.x = np.array(program.nominal or [0.1] * self.module.nx)
        if hasattr(self.module, "project"):
            self.x = self.module.project(0.0, self.x)
        self.u = np.zeros(len(program.argument("u").names))
        self.p = np.array(self.module.defaults)
        self.native = ctypes.CDLL(str(self.folder / compiler.shared_library(self.name)))
        (base / "driver.c").write_text(DRIVER)
        asked = ["gcc", "-O2", "-shared", "-fPIC", "driver.c", "-o", "driver.so"]
        subprocess.run(asked, cwd=base, check=True)
        self.driver = ctypes.CDLL(str(base / "driver.so"))
        self.base = base


def least(*calls: Callable[[], Any], turns: int = TURNS) -> list[float]:
    """Least time of each, taken in turn."""
    found = [np.inf] * len(calls)
    for call in calls:
        call()
    for _ in range(turns):
        for k, call in enumerate(calls):
            start = time.perf_counter()
            call()
            found[k] = min(found[k], time.perf_counter() - start)
    return found


def fmu(built: Built) -> dict[str, float]:
    """As many communication steps from the start, without Python between them."""
    fmpy, fmi3 = importlib.import_module("fmpy"), importlib.import_module("fmpy.fmi3")
    path = built.folder / f"{built.name}.fmu"
    description = fmpy.read_model_description(str(path))
    folder = fmpy.extract(str(path), str(built.base / "fmu"))
    slave = fmi3.FMU3Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="instance",
    )
    slave.instantiate()
    step = ctypes.cast(slave.dll.fmi3DoStep, ctypes.c_void_p)
    times = LENGTH * np.arange(STEPS + 1)

    def stepped() -> float:
        slave.reset()
        slave.enterInitializationMode(startTime=0.0)
        slave.exitInitializationMode()
        start = time.perf_counter()
        instance = ctypes.c_void_p(slave.component)
        assert built.driver.drive(step, instance, ctypes.c_double(LENGTH), STEPS) == 0
        return time.perf_counter() - start

    def simulated() -> float:
        start = time.perf_counter()
        built.module.simulate((0.0, times[-1]), built.x, built.u, built.p, times=times)
        return time.perf_counter() - start

    pairs = [(stepped(), simulated()) for _ in range(TURNS)]
    ours, theirs = (min(column) for column in zip(*pairs))
    slave.freeInstance()
    return {"FMU step / simulate": ours / theirs}


def jax(built: Built) -> dict[str, float]:
    """10,000 states under jit and vmap; all arguments are JAX's already. Pure JAX takes its turns
    apart: its threads and memory would be in the way of what comes after it."""
    package = importlib.import_module("jax")
    package.config.update("jax_enable_x64", True)
    functions = generated(_subject(built), "jax")
    random = np.random.default_rng(0)
    states = built.x + 1e-3 * random.normal(size=(STATES, len(built.x)))
    call = package.jit(package.vmap(functions.dynamics, (None, 0, None, None)))
    pure = package.jit(pure_jax.dynamics(built.folder, package.numpy))
    given = (np.zeros(()), states, built.u, built.p)
    t, device, u, p = map(package.numpy.asarray, given)
    expected = built.module.dynamics(0.0, *given[1:])
    for found in (call(t, device, u, p), pure(device, u, p)):
        assert np.allclose(np.asarray(found), expected, rtol=1e-7, atol=1e-7)
    ours, batch = least(
        lambda: call(t, device, u, p).block_until_ready(),
        lambda: built.module.dynamics(0.0, *given[1:]),  # a result of its own, as JAX's
        turns=SHORT,
    )
    (theirs,) = least(lambda: pure(device, u, p).block_until_ready())
    return {"JAX custom call / batch": ours / batch, "JAX custom call / pure JAX": ours / theirs}


def casadi(built: Built) -> dict[str, float]:
    """ẋ, ∂ẋ/∂x and ∂ẋ/∂u of 1,000 states: the compiled function, and C that CasADi makes of the same
    expressions."""
    ca = importlib.import_module("casadi")
    symbols = generated(_subject(built), "casadi")
    library = built.folder / compiler.shared_library(built.name)
    fast = symbols.external("dynamics", library)
    given = [ca.MX.sym(name, fast.size1_in(k)) for k, name in enumerate(("t", "x", "u", "p"))]
    found = fast(*given)
    by = fast.jacobian().call([*given, found])
    ours = ca.Function("ours", given, [found, by[1], by[2]])
    f = symbols.function("dynamics")
    arguments = f.sx_in()
    value = f(*arguments)
    blocks = [ca.jacobian(value, arguments[k]) for k in (1, 2)]
    own = ca.Function("own", arguments, [value, *blocks])
    generator = ca.CodeGenerator("own.c")
    generator.add(own)
    (built.base / "own.c").write_text(generator.dump())
    flags = [*compiler.FLAGS, *compiler.probe(("gcc",))[0]]
    subprocess.run(
        ["gcc", *flags, "-shared", "own.c", "-lm", "-o", "own.so"], cwd=built.base, check=True
    )
    theirs = ca.external("own", str(built.base / "own.so"))
    count = 1000
    row = (0.0, built.x, built.u, built.p)
    wide = [ca.repmat(ca.DM(part), 1, count) for part in row]
    mapped, reference = ours.map(count), theirs.map(count)
    short, long = least(
        lambda: mapped.call(wide),
        lambda: reference.call(wide),
    )
    return {"CasADi external Jacobian / CasADi's own C": short / long}


def wasm(built: Built) -> dict[str, float]:
    """`dynamics` in a loop of JavaScript, and of C."""
    numbers = {"nx": len(built.x), "nu": len(built.u), "np": len(built.p)}
    texts = {"x": built.x.tolist(), "p": built.p.tolist()}
    numbers |= {"calls": CALLS, "patience": PATIENCE}
    script = NODE % {"name": built.name, **numbers, **texts}
    (built.folder / "wasm" / "speed.mjs").write_text(script)
    done = subprocess.run(
        ["node", "speed.mjs"], cwd=built.folder / "wasm", check=True, capture_output=True, text=True
    )
    out = np.empty(len(built.x))
    pointers = [ctypes.c_void_p(array.ctypes.data) for array in (built.x, built.u, built.p, out)]
    function = ctypes.cast(getattr(built.native, f"{built.name}_dynamics"), ctypes.c_void_p)
    once = lambda: built.driver.repeat(function, *pointers, CALLS)  # noqa: E731
    (native,) = least(once, turns=100 * TURNS)
    return {"WASM in Node / native": float(done.stdout) / (native / CALLS)}


def _subject(built: Built) -> Any:
    """What `generated` asks of a subject."""
    return type("Place", (), {"name": built.name, "folder": built.folder})


def main(model: str = "models/stanford_arm.yaml", choice: str | None = None) -> int:
    """0 where every ratio is within its limit."""
    with tempfile.TemporaryDirectory() as base:
        built = Built(HOME / model, choice, Path(base))
        found: dict[str, float] = {}
        for measure in (fmu, jax, casadi, wasm):
            found |= measure(built)
    rows = [
        {"what": what, "model": built.name, "ratio": ratio, "most": LIMITS[what]}
        for what, ratio in found.items()
    ]
    for row in rows:
        print(f"{row['what']:45} {row['ratio']:8.3g}  {_word(row)}")
    place = HOME / "build" / "target_speed.json"
    place.parent.mkdir(exist_ok=True)
    place.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    return 4 if any(_word(row).startswith("above") for row in rows) else 0


def _word(row: dict[str, Any]) -> str:
    if row["most"] is None:
        return ""
    return f"{'within' if row['ratio'] <= row['most'] else 'above'} {row['most']:g}"


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
