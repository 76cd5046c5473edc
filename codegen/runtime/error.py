"""How far a motion may be from the solution: what a coarser companion differs by.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.

Errors of a method of order p grow as h^p, so a companion whose steps are s times as long differs
by about s^p - 1 errors (L. F. Richardson, 1911). The companion's are to be 7/3 times as long, by a
tolerance (7/3)^p times as large, or twice as long where steps are equal; and it has every second
row, for steps end at rows. What they were is counted. Of the difference over s^(9p/10) - 1 a
multiple is taken that is at least the error in 99 of 100 motions, and some thirty times as large in
the middle.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .simulation import Simulation, Status

LONGER = 7.0 / 3.0  # steps of the companion
SAFETY, OF_EQUAL_STEPS = 5.5, 12.0
EXPONENT = 0.9  # of what the order promises
ALIKE = 1.2  # longer steps than this by a factor tell something
LOOSEST = 1e-2  # a tolerance means little above
BY_TOLERANCE = 8  # in place of an order that follows from the tolerance


def coarser(
    rtol: float, atol: float, step_size: float | None, order: float | None
) -> tuple[float, float, float | None]:
    """Tolerances and step size of the companion."""
    if step_size is not None:
        return rtol, atol, 2.0 * step_size
    factor = max(1.0, min(LONGER ** (order or BY_TOLERANCE), LOOSEST / rtol))
    return rtol * factor, atol * factor, None


def rows(times: np.ndarray) -> np.ndarray:
    """Every second time, the last one among them."""
    return np.ascontiguousarray(times[..., ::-1][..., ::2][..., ::-1])


def until_events(found: Simulation) -> np.ndarray:
    """The times of all rows; of many motions those that an event stopped have its time from there
    on, as they have its state."""
    stopped = np.flatnonzero(np.ravel(found.status) == Status.EVENT)
    events = found.events
    if np.ndim(found.status) == 0 or not stopped.size or events is None or events.row is None:
        return found.t
    ends = np.full(np.size(found.status), np.inf)
    ends[stopped] = events.t[np.searchsorted(events.row, stopped, "right") - 1]
    return np.minimum(found.t, ends.reshape(*np.shape(found.status), 1))


def estimate(
    found: Any, companion: Any, order: float | None, rtol: float, equal: bool
) -> np.ndarray:
    """Of every entry of x at every row, never falling along the motion; NaN where the companion did
    not arrive or took no longer steps where these are equal, and of those of many motions that
    could not go on: how many steps their companions took as far as there is not known. `equal` says
    that steps have a size that was asked for."""
    lean = found.x[..., ::-1, :][..., ::2, :][..., ::-1, :]
    reached = companion.x.shape[-2]
    apart = np.full(lean.shape, np.nan)
    apart[..., :reached, :] = np.abs(lean[..., :reached, :] - companion.x)
    if apart.ndim > 2:
        apart[~np.isin(found.status, (Status.OK, Status.EVENT))] = np.nan
    grown = _largest_until(np.where(np.isnan(apart), np.inf, apart))
    steps = _tried(found)
    longer = steps / np.maximum(_tried(companion), 1.0)
    looser = coarser(rtol, 1.0, None, order)[0] / rtol
    own = longer ** (EXPONENT * order) if order else np.full(longer.shape, looser**EXPONENT)
    # few steps may be much longer than the errors tell
    growth = own if equal else np.minimum(own, looser)
    gain = (OF_EQUAL_STEPS if equal else SAFETY) / np.maximum(growth - 1.0, 0.5)
    rounding = np.finfo(found.x.dtype).eps * np.sqrt(steps)  # adds up at random
    within = _largest_until(np.abs(found.x, dtype=float))
    within *= np.where(longer < ALIKE, rtol, rounding)
    grown *= gain
    for first in (0, 1):  # rows of the companion, and those between them
        part = within[..., ::-1, :][..., first::2, :]
        np.maximum(part, grown[..., ::-1, :][..., : part.shape[-2], :], out=part)
    within[np.isinf(within)] = np.nan
    if equal:  # steps as long as the motion: a companion cannot take longer ones
        within[np.broadcast_to(longer < ALIKE, within.shape)] = np.nan
    return within


def _largest_until(values: np.ndarray) -> np.ndarray:
    """The largest so far along the rows, in place; row by row where motions are more than rows."""
    count = values.shape[-2]
    if count > math.prod(values.shape[:-2]):
        return np.maximum.accumulate(values, axis=-2, out=values)
    for row in range(1, count):
        here = values[..., row, :]
        np.maximum(here, values[..., row - 1, :], out=here)
    return values


def _tried(found: Any) -> np.ndarray:
    """Steps of each motion, with room for its rows and entries."""
    attempts = np.asarray(found.steps, float) + np.asarray(found.rejected, float)
    return attempts[..., np.newaxis, np.newaxis]
