from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._events import Event as Event
from ._inputs import Table as Table
from ._simulation import Events as Events
from ._simulation import Simulation as Simulation
from ._simulation import Status as Status
from ._simulation import Stopped as Stopped

name: str
formulation: str
choice: str
nx: Literal[7]
nu: Literal[2]
np_: Literal[3]
states: tuple[str, ...]
inputs: tuple[str, ...]
parameters: tuple[str, ...]
units: dict[str, tuple[str, ...]]
defaults: NDArray[np.float64]
initial: NDArray[np.float64]
status: tuple[str, ...]
functions: tuple[str, ...]
event_names: tuple[str, ...]
integrators: tuple[str, ...]
enforcements: tuple[str, ...]
backend: Literal["extension", "ctypes", "numpy"]

def threaded(function: Callable[..., NDArray[np.float64]], threads: int) -> Callable[..., NDArray[np.float64]]:
    """The function for batches, their first axis divided among threads."""

def dynamics(
    t: ArrayLike, x: ArrayLike, u: ArrayLike, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """state derivative: q̇ = N v, ẇ from (Sᵀ M S) ẇ = Sᵀ (Q − h − M σ): shape (..., 7)."""

def mass(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """mass matrix M(q) of the generalized velocities v, nv × nv: shape (..., 5, 5)."""

def bias(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """bias h(q, v) of the generalized velocities: velocity products, gravity and what a potential given by formula makes, M v̇ + h = Q + Aᵀ λ; springs are in Q: shape (..., 5)."""

def inverse_dynamics(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """forces conjugate to v that give v̇: M v̇ + h − Q at u = 0, from (q, v, v̇): shape (..., 5)."""

def constraints(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """constraint violation: φ(q, t), then A v − c row by row: shape (..., 3)."""

def reactions(
    t: ArrayLike, x: ArrayLike, u: ArrayLike, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """multipliers λ of M v̇ + h = Q + Aᵀ λ: the force along each constraint row: shape (..., 3)."""

def energy(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """kinetic and potential energy T, V: shape (..., 2)."""

def power(
    t: ArrayLike, x: ArrayLike, u: ArrayLike, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """power of forces without potential: d(T + V)/dt: shape (..., 1)."""

def velocity(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """generalized velocities v = S w + R c: shape (..., 5)."""

def state(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """state x = (q, w) from (q, v): w = B v: shape (..., 7)."""

def qdot(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """rates q̇ = N(q) v of the coordinates, from (q, v): shape (..., 5)."""

def integrate(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """q ⊕ d: the configuration a displacement d over v away, from (q, d): shape (..., 5)."""

def difference(
    t: ArrayLike, x: ArrayLike, u: ArrayLike | None = None, p: ArrayLike | None = None, out: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """q₁ ⊖ q₀: the displacement over v from q₀ to q₁, from (q₀, q₁): shape (..., 5)."""

def simulate(
    t_span: ArrayLike,
    x: ArrayLike,
    u: ArrayLike | Table | Mapping[str, ArrayLike | Table] | Callable[[float, NDArray[np.float64]], ArrayLike] | None = None,
    p: ArrayLike | Mapping[str, ArrayLike] | None = None,
    *,
    rtol: float = 1e-9,
    atol: float = 1e-11,
    times: ArrayLike | None = None,
    max_steps: int = 1_000_000,
    progress: Callable[[float], object] | None = None,
    integrator: Literal["dop853", ] | None = None,
    enforcement: Literal["none", ] | None = None,
    step_size: float | None = None,
    sample: ArrayLike | None = None,
    events: Mapping[str, Event | Callable[[float, NDArray[np.float64]], float]] | Literal[False] | None = None,
    error: bool = False,
    threads: int = 1,
) -> Simulation:
    """The motion from state x at t_span[0] with inputs u, at the entries of t_span or at times."""
