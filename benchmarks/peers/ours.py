"""Our own functions as contenders: the C that `hamel build --constants all` writes, with the flags
it is compiled with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from codegen import compiler
from codegen.emit import emit
from codegen.passes import program
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model.records import Model
from derive.states import system
from derive.states.sampling import States, states
from peers.contest import BUILD, ROWS, Contender, compiled, put
from peers.peak import of_turn

SCALAR = """#include "{name}.h"
int bench_open(const char *argument) {{ return argument == 0; }}
void bench_loop(long n, const double *in, long in_size, double *out, long out_size)
{{
    for (long i = 0; i < n; i++, in += in_size, out += out_size)
        {name}_{function}(0.0, in, in + {x}, 0, out);
}}
"""
BATCH = """#include "{name}.h"
int bench_open(const char *argument) {{ return argument == 0; }}
void bench_loop(long n, const double *in, long in_size, double *out, long out_size)
{{
    const double t = 0.0;
    {name}_{function}_batch((size_t)n, &t, 0, in, in_size, in + {x}, in_size, &t, 0, out, out_size, 0);
}}
"""


@dataclass(frozen=True)
class Subject:
    """A model with all its numbers folded in, one choice, and ROWS random admissible states; w and
    x = (q, w) as arrays."""

    equations: Equations
    states: States
    x: np.ndarray

    @property
    def name(self) -> str:
        return self.equations.system.model.name

    @property
    def rates(self) -> np.ndarray:
        """q̇ at the states."""
        mechanics = self.equations.system
        function = ca.Function("qdot", [mechanics.q, mechanics.v], [ca.densify(mechanics.qdot)])
        return np.asarray(function(self.states.q.T, self.states.v.T)).T

    @property
    def quasi(self) -> ca.Function:
        """ẇ from q, q̇ and q̈, for peers that know coordinates only: w(q, v) along the motion, v
        from q̇ = N v."""
        mechanics = self.equations.system
        to = next(function for function in self.equations.functions if function.name == "state")
        assert to.x is not None
        w = ca.Function("w", [to.x.symbols], [ca.densify(to.result.value[mechanics.q.numel() :])])
        N = ca.Function("N", [mechanics.q], [ca.densify(mechanics.N)])
        q, qd, qdd = (ca.SX.sym(name, mechanics.q.numel()) for name in ("q", "qd", "qdd"))
        along = w(ca.vertcat(q, ca.solve(N(q), qd)))
        return ca.Function(
            "quasi", [q, qd, qdd], [ca.jtimes(along, ca.vertcat(q, qd), ca.vertcat(qd, qdd))]
        )


def subject(model: Model, choice: str | None = None, given: States | None = None) -> Subject:
    """`given`: states to use instead of random admissible ones."""
    mechanics = system(model, "all")
    derived = equations(mechanics, choice)
    found = given or states(mechanics, ROWS, seed=1)
    if len(found.q) < ROWS:
        raise RuntimeError(f"{model.name}: only {len(found.q)} admissible states")
    to = next(function for function in derived.functions if function.name == "state")
    assert to.x is not None
    function = ca.Function("state", [to.x.symbols], [ca.densify(to.result.value)])
    return Subject(derived, found, np.asarray(function(np.hstack([found.q, found.v]).T)).T)


def operations(of: Subject, function: str = "dynamics") -> dict[str, int]:
    """As the program counts them."""
    return program(of.equations, [function]).kernels[0].operations


def contender(
    of: Subject,
    function: str = "dynamics",
    batch: bool = False,
    rows: np.ndarray | None = None,
    read: Callable[[np.ndarray], np.ndarray] = lambda rows: rows,
) -> Contender:
    """`rows`: what goes into the x slot, the states unless given."""
    made = program(of.equations, [function])
    kernel = made.kernels[0]
    folder = BUILD / "ours" / f"{of.name}-{of.equations.choice}-{function}"
    folder.mkdir(parents=True, exist_ok=True)
    files = emit(made)
    for name, text in files.items():
        if name.endswith((".c", ".h")):
            put(folder / name, text)
    x = of.x if rows is None else rows
    kind = "batch" if batch else "scalar"
    loop = folder / f"loop_{kind}.c"
    put(loop, (BATCH if batch else SCALAR).format(name=made.name, function=function, x=x.shape[1]))
    apart = {
        "example.c",
        *(
            f"{made.name}_{part}.c"
            for part in ("cpu", "module", "simulate", *(() if batch else ("batch",)))
        ),
    }
    sources = {loop: ["-O2", f"-I{folder}"]}
    for path in (folder / name for name in files if name.endswith(".c") and name not in apart):
        sources[path] = [*compiler.FLAGS, *compiler.flags_of(["gcc"], made.name, path.stem)]
    library = compiled(f"{folder.name}-{kind}", sources)
    turning = folder / f"{made.name}{'_batch' if batch else ''}.c"
    return Contender(
        f"hamel, {kind}",
        library,
        np.hstack([x, of.states.u]),
        kernel.size,
        read=read,
        turn=of_turn(turning),
    )
