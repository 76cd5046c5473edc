"""Peers that bring their own loop over many states: numba, JAX, MuJoCo's rollout. One core; least
of many calls at N = 4,096."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from pathlib import Path
from queue import Empty
from typing import Any

import numpy as np

from peers.contest import Unavailable
from peers.lanes import python

MANY, CALLS = 4096, 40
PATIENCE = 100.0  # s until a compiler at run time has to be done
Timed = tuple[float, np.ndarray]  # ns per state, and the results at the given states


def _least(call: Callable[[], object], rows: int) -> float:
    least = np.inf
    for _ in range(CALLS):
        start = time.perf_counter()
        call()
        least = min(least, time.perf_counter() - start)
    return least / rows * 1e9


def _repeated(inputs: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.tile(inputs, (MANY // len(inputs), 1)))


def patiently(measure: Callable[..., Timed], *arguments: object) -> Timed:
    """In a process of its own, ended when it takes too long."""
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    process = context.Process(target=_answer, args=(queue, measure, arguments))
    process.start()
    try:
        answer = queue.get(timeout=PATIENCE)
    except Empty:
        raise Unavailable(f"not compiled within {PATIENCE:.0f} s") from None
    finally:
        process.terminate()
        process.join()
    if isinstance(answer, str):
        raise Unavailable(answer)
    return answer


def _answer(queue: Any, measure: Callable[..., Timed], arguments: tuple[object, ...]) -> None:
    try:
        queue.put(measure(*arguments))
    except Exception as error:  # the table says what is missing
        queue.put(f"{type(error).__name__}: {error}"[:200])


def numba(source: Path, inputs: np.ndarray, size: int) -> Timed:
    """CasADi's C of Pinocchio's recursion, line by line in Python, under numba's njit in a loop
    over states."""
    try:
        from numba import njit
    except ImportError as error:
        raise Unavailable(f"numba: {error}") from error
    names: dict[str, object] = {"math": __import__("math")}
    indented = "\n".join(
        f"    {line}" for line in python(source, "math.cos", "math.sin").splitlines()
    )
    exec(compile(f"def one(given, out):\n{indented}\n", str(source), "exec"), names)
    one = njit(names["one"])

    @njit
    def many(given: np.ndarray, out: np.ndarray) -> None:
        for i in range(len(given)):
            one(given[i], out[i])

    given = _repeated(inputs)
    out = np.empty((MANY, size))
    many(given, out)
    return _least(lambda: many(given, out), MANY), out[: len(inputs)]


def jax(source: Path, inputs: np.ndarray, size: int) -> Timed:
    """The same lines on arrays of all states, under jax.jit in float64.

    XLA does not fuse them here: its fusions repeat what is shared, and do not come to an end with a
    recursion of this length.
    """
    os.environ["XLA_FLAGS"] = "--xla_disable_hlo_passes=fusion"
    try:
        import jax as library
        import jax.numpy as jnp
    except ImportError as error:
        raise Unavailable(f"JAX: {error}") from error
    library.config.update("jax_enable_x64", True)
    library.config.update("jax_platforms", "cpu")
    text = compile(python(source, "jnp.cos", "jnp.sin"), str(source), "exec")

    def many(given: object) -> object:
        names = {"jnp": jnp, "given": given, "out": [None] * size}
        exec(text, names)
        return jnp.stack(names["out"])  # type: ignore[arg-type]

    compiled = library.jit(many)
    given = jnp.asarray(_repeated(inputs).T)
    out = np.asarray(compiled(given)).T
    return _least(lambda: compiled(given).block_until_ready(), MANY), out[: len(inputs)]


def rollout(file: Path, inputs: np.ndarray, size: int) -> Timed:
    """One step of one second each, so that the change of velocity is the acceleration."""
    try:
        import mujoco
        from mujoco import rollout as rolling
    except ImportError as error:
        raise Unavailable(f"MuJoCo: {error}") from error
    model = mujoco.MjModel.from_xml_path(str(file))
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= (
        off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_FRICTIONLOSS | off.mjDSBL_CONSTRAINT
    )
    model.opt.timestep = 1.0
    data, given = mujoco.MjData(model), _repeated(inputs)
    state = np.hstack([np.zeros((MANY, 1)), given[:, : model.nq + model.nv]])
    control = np.ascontiguousarray(given[:, None, model.nq + model.nv :])
    spec = mujoco.mjtState.mjSTATE_QFRC_APPLIED.value

    def call() -> np.ndarray:
        return rolling.rollout(model, data, state, control, control_spec=spec, nstep=1)[0]

    change = call()[:, 0, 1 + model.nq :][:, : model.nv] - given[:, model.nq : model.nq + model.nv]
    return _least(call, MANY), change[: len(inputs)]
