"""What `simulate` of a generated module gives back.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

import enum
from dataclasses import dataclass

import numpy as np


class Status(enum.IntEnum):
    """How a motion ended; the numbers are those of the C functions; HELD is known here alone."""

    OK = 0
    SINGULAR = 1
    NOT_CONVERGED = 2
    NOT_FINITE = 3
    STEP_TOO_SMALL = 4
    MORE = 5
    NO_METHOD = 6
    SINGULAR_POSITION = 7
    SINGULAR_CHOICE = 8
    NO_INPUT = 9
    NO_EVENT = 10
    EVENT = 11
    FULL = 12
    JUMP = 13
    HELD = 15  # 14 is that of inaccurate steps
    NOT_SOLVED = 16

    @property
    def cause(self) -> str:
        """In words."""
        return _CAUSES[self]


_CAUSES = {
    Status.OK: "ok",
    Status.SINGULAR: "singular",
    Status.NOT_CONVERGED: "the state could not be projected on the constraints",
    Status.NOT_FINITE: "not finite: an argument or a result is infinite or not a number",
    Status.STEP_TOO_SMALL: "the step became too small for the tolerance",
    Status.MORE: "too many steps",
    Status.NO_METHOD: "the integrator or the enforcement needs compiled code",
    Status.SINGULAR_POSITION: "the motion came to a singular position, or ways across it disagree: "
    "its branch cannot be told",
    Status.SINGULAR_CHOICE: "this choice of quasi-velocities is singular here, though the "
    "constraints are independent: another choice, or a module of several, goes on",
    Status.NO_INPUT: "an input could not be had: its function failed, or gave what is not finite",
    Status.NO_EVENT: "an event could not be looked for: its function failed, or gave what is not "
    "finite",
    Status.EVENT: "stopped by an event",
    Status.FULL: "too many events: a formula stays at zero or chatters about it, as where "
    "something sticks or bounces to rest",
    Status.JUMP: "a constraint jumps here, as where a rope comes off its pulley, an angle goes on "
    "by a turn or a prescribed velocity becomes another at once: the motion has no way on",
    Status.HELD: "forces jump here and hold the motion, as dry friction by sign does where it "
    "sticks: at the pace of its steps here the whole would take over 1e10 of them",
    Status.NOT_SOLVED: "the stages of an implicit step do not converge: the step is too long "
    "there, or forces jump, as dry friction by sign does where it holds",
}


@dataclass(frozen=True)
class Events:
    """What happened on the way, in the order of time: event k at t[k] in state x[k] is
    names[which[k]]. Of many motions `row` says whose it is, counted along their leading axes."""

    names: tuple[str, ...]
    t: np.ndarray
    x: np.ndarray
    which: np.ndarray
    row: np.ndarray | None = None

    def of(self, name: str) -> "Events":
        """Those of one name."""
        mine = self.which == self.names.index(name)
        row = None if self.row is None else self.row[mine]
        return Events(self.names, self.t[mine], self.x[mine], self.which[mine], row)

    @property
    def most(self) -> tuple[str, int]:
        """The name that happened most often, and how often."""
        counts = np.bincount(self.which, minlength=len(self.names))
        return self.names[int(counts.argmax())], int(counts.max())


@dataclass(frozen=True)
class Simulation:
    """A motion: one row of x and one entry of work per time. `work` is that of all forces without
    potential since the start.

    position_violation and velocity_violation are the largest that a constraint showed after any
    step; crossings counts the singular positions that were crossed, landings the steps that end
    where forces go on to another piece, charts those that an enforcement used. With several choices
    of quasi-velocities v are the generalized velocities, chart the number of the choice at each
    time, switches their changes. Where angles go round, reduced is x without whole turns, as it was
    integrated: the violations are of that. Where the directions that w is measured along are based
    anew on the way, `bases` times, p has the parameters of each row, with the frame in force behind
    them, which all functions take: velocity(t, x, u, p). Where inputs change, u has those of each
    row; at a jump the new ones. An event that stopped the motion is its last row, and its status
    EVENT; of many motions, whose rows are as many, it is all rows from there on. Where it was asked
    for, error estimates how far every entry of x may be from the solution. integrator is the one
    that stepped, also where "auto" was asked for.
    """

    t: np.ndarray
    x: np.ndarray
    work: np.ndarray
    steps: int
    rejected: int
    calls: int
    position_violation: float
    velocity_violation: float
    crossings: int = 0
    landings: int = 0
    charts: int = 0
    status: Status = Status.OK
    v: np.ndarray | None = None
    chart: np.ndarray | None = None
    switches: int = 0
    reduced: np.ndarray | None = None
    p: np.ndarray | None = None
    bases: int = 0
    u: np.ndarray | None = None
    events: Events | None = None
    error: np.ndarray | None = None
    integrator: str = ""


class Stopped(FloatingPointError):
    """A motion that could not go on: `partial` holds the rows up to there and the status."""

    def __init__(self, message: str, partial: Simulation) -> None:
        super().__init__(message)
        self.partial = partial

    def __reduce__(self) -> tuple[type, tuple[str, Simulation]]:
        """Both parts, so that it comes back from another process."""
        return type(self), (str(self), self.partial)
