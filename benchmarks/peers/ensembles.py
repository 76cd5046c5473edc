"""Peers that make thousands of motions at a time: heyoka's batch mode, diffrax under vmap, MuJoCo's
rollout; SciPy, one after the other. One core, whose processor time is counted: others may be at work
on it. Each gives the seconds that the motions take and where they end."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import hamel
from peers import pure_jax
from peers.contest import Unavailable
from peers.series import System, heyoka

TOLERANCES = tuple(k / 2 for k in range(-13, -29, -1))  # decimal exponents
STEPS = tuple(10.0 ** (-k / 4) for k in range(8, 18))  # s, of methods without error control


@dataclass(frozen=True)
class Ensemble:
    """`run(setting, x)`: seconds for the motions from the rows of x, and their last states."""

    peer: str
    run: Callable[[float, np.ndarray], tuple[float, np.ndarray]]
    settings: Sequence[float] = TOLERANCES
    compiled: list[float] = field(default_factory=list)  # seconds, each time that it was


def timed(
    call: Callable[[], np.ndarray], clock: Callable[[], float] = time.process_time
) -> tuple[float, np.ndarray]:
    """Seconds of the second of two calls, where all is compiled and in place."""
    call()
    begin = clock()
    result = call()
    return clock() - begin, result


def taylor(
    peer: str,
    system: System,
    span: float,
    into: Callable[[np.ndarray], np.ndarray],
    back: Callable[[np.ndarray], np.ndarray],
) -> Ensemble:
    """heyoka's batch mode, as many motions side by side as it recommends; `into` its states and
    `back` are maps of rows."""
    wide = heyoka.recommended_simd_size()
    motions: dict[float, Any] = {}
    compiled: list[float] = []

    def run(setting: float, x: np.ndarray) -> tuple[float, np.ndarray]:
        starts = np.ascontiguousarray(into(x).reshape(-1, wide, x.shape[1]).transpose(0, 2, 1))
        if setting not in motions:
            begin = time.perf_counter()
            motions[setting] = heyoka.taylor_adaptive_batch(system, starts[0], tol=10.0**setting)
            compiled.append(time.perf_counter() - begin)
        motion, ends = motions[setting], np.empty_like(starts)
        begin = time.process_time()
        for start, end in zip(starts, ends):
            motion.set_time(0.0)
            motion.state[:] = start
            motion.propagate_until(span)
            end[:] = motion.state
        seconds = time.process_time() - begin
        return seconds, back(ends.transpose(0, 2, 1).reshape(x.shape))

    return Ensemble(peer, run, compiled=compiled)


def vmapped(folder: Path, module: ModuleType, u: np.ndarray, span: float) -> Ensemble:
    """diffrax: Dopri8 with its own step control for each motion, in float64, on our equations in
    pure JAX."""
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    try:
        import diffrax
        import jax
    except ImportError as error:
        raise Unavailable(f"diffrax: {error}") from error
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_platforms", "cpu")
    dynamics, p = pure_jax.dynamics(folder, jax.numpy), jax.numpy.asarray(module.defaults)
    term = diffrax.ODETerm(lambda t, x, inputs: dynamics(x, inputs, p))
    held = jax.numpy.asarray(u)

    @jax.jit
    def ends(x: Any, tolerance: Any) -> Any:
        def one(start: Any) -> Any:
            found = diffrax.diffeqsolve(
                term,
                diffrax.Dopri8(),
                0.0,
                span,
                None,
                start,
                held,
                stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
                max_steps=100_000,
                throw=False,
            )
            return found.ys[0]

        return jax.vmap(one)(x)

    def run(setting: float, x: np.ndarray) -> tuple[float, np.ndarray]:
        device = jax.numpy.asarray(x)
        return timed(lambda: np.asarray(ends(device, 10.0**setting)))

    return Ensemble("diffrax, Dopri8, vmap", run)


@dataclass(frozen=True)
class OneByOne:
    """SciPy's DOP853 over the compiled `dynamics` of the module in `folder`; it can be sent to
    another process."""

    folder: Path
    u: np.ndarray
    span: float

    def __call__(self, setting: float, x: np.ndarray) -> tuple[float, np.ndarray]:
        from scipy.integrate import solve_ivp

        module, tolerance = hamel.load(self.folder), 10.0**setting
        out, p = np.empty(module.nx), module.defaults

        def rates(t: float, x: np.ndarray) -> np.ndarray:
            return module.dynamics(t, x, self.u, p, out=out).copy()

        how = {"method": "DOP853", "rtol": max(tolerance, 2.3e-14), "atol": tolerance}
        begin = time.process_time()
        ends = [solve_ivp(rates, (0.0, self.span), start, **how).y[:, -1] for start in x]
        return time.process_time() - begin, np.array(ends)


def one_by_one(folder: Path, u: np.ndarray, span: float) -> Ensemble:
    return Ensemble(
        "SciPy DOP853, compiled right-hand side", OneByOne(folder, u, span), TOLERANCES[::2]
    )


def by_processes(peer: Ensemble, processes: int) -> Ensemble:
    """The same with joblib, on so many processes."""
    try:
        from joblib import Parallel, delayed
    except ImportError as error:
        raise Unavailable(f"joblib: {error}") from error
    pool = Parallel(n_jobs=processes)

    def run(setting: float, x: np.ndarray) -> tuple[float, np.ndarray]:
        parts = np.array_split(x, processes)
        pool(delayed(peer.run)(setting, part[:1]) for part in parts)  # they import what they need
        begin = time.perf_counter()
        ends = pool(delayed(peer.run)(setting, part) for part in parts)
        return time.perf_counter() - begin, np.concatenate([end for _, end in ends])

    return Ensemble(f"joblib, {peer.peer}", run, peer.settings)


def rolled_out(links: int, span: float, threads: int = 1) -> Ensemble:
    """MuJoCo's rollout of the pendulum chain by its fourth-order method, in equal steps."""
    try:
        import mujoco
        from mujoco import rollout
    except ImportError as error:
        raise Unavailable(f"MuJoCo: {error}") from error
    model = mujoco.MjModel.from_xml_string(_chain(links))
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4

    def run(setting: float, x: np.ndarray) -> tuple[float, np.ndarray]:
        steps = round(span / setting)
        model.opt.timestep = span / steps
        data = [mujoco.MjData(model) for _ in range(threads)]
        state = np.hstack([np.zeros((len(x), 1)), x])
        begin = time.perf_counter()
        rows = rollout.rollout(model, data, state, nstep=steps)[0]
        return time.perf_counter() - begin, rows[:, -1, 1:]

    return Ensemble("MuJoCo rollout, RK4", run, STEPS)


def _chain(links: int) -> str:
    """Rods of 1 m and 1 kg, 0.08 kg m² about their middles, in the plane of x and y."""
    inside = ""
    for i in reversed(range(links)):
        inside = (
            f'<body pos="{float(i > 0)} 0 0"><joint type="hinge" axis="0 0 1"/>'
            '<inertial pos="0.5 0 0" mass="1" diaginertia="0.08 0.08 0.08"/>'
            f"{inside}</body>"
        )
    option = '<option gravity="0 -9.81 0"><flag contact="disable"/></option>'
    return f"<mujoco>{option}<worldbody>{inside}</worldbody></mujoco>"
