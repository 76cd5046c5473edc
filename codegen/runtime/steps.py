"""Steps of a given length: the face of `step` and `step_sensitivity`, and, for machines without a
compiler, the steps themselves as runtime_step.h makes them.

The same file in every generated folder that has them. No claim of licence is made on it: 0BSD, see
LICENSE.txt.
"""

import math
import operator
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

import numpy as np

METHODS = ("rk4", "rosenbrock")
INACCURATE = 14  # the number that the C functions return
CAUSE = (
    "inaccurate: the estimate of the error leaves no digit of the step; take more substeps, or the "
    "method rosenbrock"
)
MEANINGLESS = 0.2  # of the largest that an entry is: from here on an error leaves no digit
NEGLIGIBLE = 0.01  # of the largest change of an entry of the same unit
MOST = 10_000_000  # substeps
Kernel = Callable[..., Any]
Array: TypeAlias = Any  # of NumPy, of any precision


# ---- the face


@dataclass(frozen=True)
class Face:
    """One function of a module: its name, `quick` for one step by rk4, `general` for the rest, and
    the shape of its result."""

    name: str
    prefix: str
    quick: Kernel
    general: Kernel
    shape: tuple[int, ...]
    states: tuple[str, ...]

    # those of every function of a module, and three of a step
    def __call__(  # noqa: PLR0913
        self,
        t: Any,
        x: Any,
        u: Any = None,
        p: Any = None,
        out: Any = None,
        substeps: int = 1,
        method: str = "rk4",
        error: bool = False,
    ) -> Any:
        """The result, and with `error` the estimate of the error beside it."""
        if substeps == 1 and method == "rk4" and not error:
            return self.quick(t, x, u, p, out)
        row = self._row(x, substeps, method)
        result = self.general(t, row, u, p)
        size = math.prod(self.shape)
        value = result[..., :size].reshape(*result.shape[:-1], *self.shape)
        apart, status = result[..., size:-1], result[..., -1]
        self._report(t, status, apart)
        if out is not None:
            self._check(out, value)
            out[...] = value
            value = out
        return (value, apart) if error else value

    def _row(self, x: Any, substeps: int, method: str) -> Array:
        """x and h with the number of the method and that of the substeps behind them."""
        if method not in METHODS:
            raise ValueError(f"{self.name}() has no method {method!r}; it has {', '.join(METHODS)}")
        if not hasattr(substeps, "__index__"):
            raise TypeError(f"{self.name}() needs a whole number of substeps, got {substeps!r}")
        many = operator.index(substeps)
        if not 1 <= many <= MOST:
            raise ValueError(f"{self.name}() needs substeps from 1 to {MOST}, got {many}")
        given: Array = np.asarray(x)
        length = len(self.states) + 1
        if not given.ndim or given.shape[-1] != length:
            raise ValueError(
                f"{self.name}() needs {length} values along the last axis of 'x', got shape "
                f"{given.shape}"
            )
        ways = np.empty((*given.shape[:-1], 2), given.dtype if given.dtype.kind == "f" else float)
        ways[...] = METHODS.index(method), many
        return np.concatenate([given, ways], axis=-1)

    def _check(self, out: Any, value: Array) -> None:
        if type(out) is not np.ndarray or cast(Any, out).dtype != value.dtype:
            raise TypeError(f"{self.name}() needs a {value.dtype} array as out")
        shape = cast(Any, out).shape
        if shape != value.shape:
            raise ValueError(f"{self.name}() needs out of shape {value.shape}, got {shape}")

    def _report(self, t: Any, status: Array, apart: Array) -> None:
        """Raise for one step that says nothing; warn for rows of a batch, which are NaN."""
        failed = np.flatnonzero(status == INACCURATE)
        if not failed.size:
            return
        first = apart.reshape(-1, len(self.states))[failed[0]]
        worst = int(np.argmax(np.nan_to_num(first, nan=np.inf)))
        cause = f"{CAUSE} (it is {first[worst]:.2g} in {self.states[worst]})"
        if not status.ndim:
            raise FloatingPointError(f"{self.prefix}.{self.name} at t = {float(t)!r}: {cause}")
        warnings.warn(
            f"{self.prefix}.{self.name}: {failed.size} of {status.size} rows failed and are NaN; "
            f"row {failed[0]}: {cause}",
            RuntimeWarning,
            stacklevel=4,
        )


# ---- the steps, in NumPy


@dataclass(frozen=True)
class Model:
    """The kernels f(t, x, u, p, out) → status of a module by name, its sizes, and the coefficients
    of the Rosenbrock method."""

    kernels: Mapping[str, Kernel]
    nx: int
    nu: int
    alike: Sequence[int]  # the first entry of x with the same unit as each
    rosenbrock: Mapping[str, Any]

    @property
    def senses(self) -> int:
        """Columns of a sensitivity."""
        return self.nx + self.nu


def kernel(model: Model, sensitive: bool, row: bool) -> Kernel:
    """(t, (x, h), u, p, out) → status, or (t, (x, h, method, substeps), u, p, out) → status."""
    size = model.nx * (model.senses if sensitive else 1)

    def one(t: Any, x: Any, u: Any, p: Any, out: Any) -> Any:
        ways = x[..., model.nx + 1 :].reshape(-1, 2)[:1] if row else [(0, 1)]
        method, substeps = (int(value) for value in ways[0]) if len(ways) else (0, 1)
        step = _stepped(model, sensitive, method, substeps, (t, x, u, p), out.shape[:-1])
        meaningless = step.meaningless() & (step.status == 0)
        value = step.D.swapaxes(-1, -2) if sensitive else step.z
        out[..., :size] = value.reshape(*out.shape[:-1], size)
        step.refuse(3, ~np.isfinite(out[..., :size]).all(axis=-1))
        if not row:
            return np.where(meaningless, INACCURATE, step.status)
        out[..., :size][meaningless] = np.nan
        out[..., size:-1] = step.error
        out[..., -1] = np.where(meaningless, INACCURATE, 0)
        return step.status

    return one


class _Step:
    """Where the steps of a batch are; `D` are the derivatives, column by column."""

    def __init__(
        self, model: Model, sensitive: bool, given: Sequence[Any], lead: tuple[int, ...]
    ) -> None:
        t, x, self.u, self.p = given
        whole = np.broadcast_to(x, (*lead, x.shape[-1]))
        self.model, self.sensitive = model, sensitive
        self.t, self.h = np.broadcast_to(t, lead), whole[..., model.nx]
        self.z = whole[..., : model.nx].copy()
        self.status = np.where(np.isfinite(self.h), 0, 3)
        self.start, self.error = self.z, np.zeros_like(self.z)
        self.size = np.abs(self.z)
        self.floor = 16 * np.finfo(self.z.dtype).eps * self.size.max(axis=-1, initial=0.0)
        self.D = np.zeros((*lead, model.senses, model.nx), self.z.dtype)
        self.D[..., : model.nx, :] = np.eye(model.nx)

    def call(self, name: str, t: Any, x: Array, shape: tuple[int, ...]) -> Array:
        """A function of the model; rows where it fails keep why."""
        out = np.empty((*self.t.shape, math.prod(shape)), self.z.dtype)
        result = self.model.kernels[name](t, x, self.u, self.p, out)
        self.status = np.where(self.status, self.status, result)
        return out.reshape(*self.t.shape, *shape)

    def rates(self, t: Any, x: Array) -> Array:
        """ẋ."""
        return self.call("dynamics", t, x, (self.model.nx,))

    def refuse(self, status: int, rows: Array) -> None:
        """Rows that fail, unless they did before."""
        self.status = np.where((self.status == 0) & rows, status, self.status)

    def slopes(self, t: Any, x: Array, G: Array) -> Array:
        """Derivatives of ẋ at x, where those of x are G."""
        nx, nu = self.model.nx, self.model.nu
        K = G @ self.call("jacobian", t, x, (nx, nx)).swapaxes(-1, -2)
        if nu:
            K[..., nx:, :] += self.call("jacobian_u", t, x, (nx, nu)).swapaxes(-1, -2)
        return K

    def arrive(self, z: Array, error: Array) -> None:
        """After a substep to z."""
        self.z = z
        self.error = self.error + error
        self.size = np.maximum(self.size, np.abs(z))

    def meaningless(self) -> Array:
        """Is there an entry of which its error leaves no digit?"""
        alike = np.array(self.model.alike)
        change = np.abs(self.z - self.start)
        most = np.stack([change[..., alike == i].max(axis=-1) for i in alike], axis=-1)
        limit = np.maximum(MEANINGLESS * self.size, NEGLIGIBLE * most)
        return ~(self.error <= np.maximum(limit, self.floor[..., np.newaxis])).all(axis=-1)


def _stepped(
    model: Model,
    sensitive: bool,
    method: int,
    substeps: int,
    given: Sequence[Any],
    lead: tuple[int, ...],
) -> _Step:
    step = _Step(model, sensitive, given, lead)
    part = step.h / substeps
    slope = step.rates(step.t, step.z)
    for n in range(substeps):
        t = step.t + n * part
        if method:
            _rosenbrock(step, t, part)
        else:
            slope = _rk4(step, t, part, slope)
    return step


def _part(d: Array, most: Array) -> Array:
    """d min(1, d / most)"""
    return d * np.divide(d, most, out=np.ones_like(d), where=d < most)


def _rk4(step: _Step, t: Array, h: Array, slope: Array) -> Array:
    """One substep; the slope at its end."""
    wide, deep = h[..., np.newaxis], h[..., np.newaxis, np.newaxis]
    k, y, z, D = [slope], step.z, step.z, step.D
    slopes = np.zeros_like(D)
    total = D
    for n, (place, weight) in enumerate(((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6))):
        if n:
            y = step.z + place * wide * k[-1]
            k.append(step.rates(t + place * h, y))
        z = z + weight * wide * k[-1]
        if step.sensitive:
            slopes = step.slopes(t + place * h, y, D + place * deep * slopes)
            total = total + weight * deep * slopes
    k.append(step.rates(t + h, z))
    step.D = total
    most = np.max(np.abs(k[:4]), axis=0)  # that at the end grows with an unstable step
    bend = np.maximum(np.abs(k[2] - k[1]), np.abs(k[0] - k[1] - k[2] + k[3]) / 2)
    late = np.abs(k[3] - k[4]) / 6
    size = np.abs(wide)
    step.arrive(z, size * np.maximum(late, _part(bend, most)))
    return k[4]


def _rosenbrock(step: _Step, t: Array, h: Array) -> None:
    """One substep; rows of length zero stay where they are."""
    m, nx = step.model.rosenbrock, step.model.nx
    still = h == 0
    h = cast(Array, np.where(still, np.ones_like(h), h))
    wide: Array = h[..., np.newaxis]
    eye: Array = np.eye(nx, dtype=step.z.dtype) / (m["gamma"] * h)[..., np.newaxis, np.newaxis]
    J = step.call("jacobian", t, step.z, (nx, nx))
    W: Array = eye - J
    rate = step.call("jacobian_t", t, step.z, (nx,))
    bad = ~np.isfinite(W).all(axis=(-1, -2)) | (np.linalg.slogdet(W)[0] == 0)
    step.refuse(1, bad)
    W[bad] = np.eye(nx)
    U: list[Array] = []
    points: list[Array] = []
    slopes: list[Array] = []
    y = step.z
    for n, alpha in enumerate(m["alpha"]):
        y = step.z + sum((a * V for a, V in zip(m["a"][n], U)), np.zeros_like(step.z))
        points.append(y)
        slopes.append(step.rates(t + alpha * h, y))
        right = slopes[n] + m["gammas"][n] * wide * rate
        right = right + sum((c / wide * V for c, V in zip(m["c"][n], U)), np.zeros_like(step.z))
        U.append(np.linalg.solve(W, right[..., np.newaxis])[..., 0])
    if step.sensitive:
        D = _rosenbrock_slopes(step, t, h, W, U, points)
        step.D = np.where(still[..., np.newaxis, np.newaxis], step.D, D)
    moving = ~still[..., np.newaxis]
    z = np.where(moving, y + U[-1], step.z)
    way = np.max(np.abs([*(point - step.z for point in points), z - step.z]), axis=0)

    def beyond(point: Array, slope: Array, alpha: float) -> Array:
        linear: Array = slopes[0] + np.einsum("...ij,...j", J, point - step.z) + alpha * wide * rate
        apart = cast(Any, np.linalg.solve(W, (slope - linear)[..., np.newaxis]))
        return apart[..., 0] / m["gamma"]

    end = beyond(z, step.rates(t + h, z), 1.0)
    bend = np.abs(end) / 3
    for point, slope, alpha in zip(points[1:], slopes[1:], m["alpha"][1:]):
        bend = np.maximum(bend, np.abs(beyond(point, slope, alpha) - alpha**2 * end))
    error = np.maximum(np.abs(U[-1]), _part(bend, np.maximum(way, np.abs(end))))
    step.arrive(z, np.where(moving, error, 0.0))


def _rosenbrock_slopes(
    step: _Step,
    t: Array,
    h: Array,
    W: Array,
    U: Sequence[Array],
    points: Sequence[Array],
) -> Array:
    """The equations of the stages, differentiated; W is the same."""
    m, nx = step.model.rosenbrock, step.model.nx
    deep = h[..., np.newaxis, np.newaxis]
    dU: list[Array] = []
    moved = step.D
    for n, alpha in enumerate(m["alpha"]):
        moved = step.D + sum((a * V for a, V in zip(m["a"][n], dU)), np.zeros_like(step.D))
        right = step.slopes(t + alpha * h, points[n], moved)
        right = right + sum((c / deep * V for c, V in zip(m["c"][n], dU)), np.zeros_like(moved))
        along = np.concatenate([step.z, U[n], (m["gammas"][n] * h)[..., np.newaxis]], axis=-1)
        H = step.call("jacobian_forward", t, along, (nx, step.model.senses)).swapaxes(-1, -2)
        right = right + step.D @ H[..., :nx, :]
        right[..., nx:, :] += H[..., nx:, :]
        dU.append(cast(Any, np.linalg.solve(W, right.swapaxes(-1, -2))).swapaxes(-1, -2))
    return moved + dU[-1]
