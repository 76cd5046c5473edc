"""What every choice needs to know of a system: sampled consistent states, the rank of A and which
of its rows are independent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product as cartesian

import casadi as ca
import numpy as np

from derive.choices.limits import (
    DEPENDENT,
    ENTRIES,
    FEWEST,
    MOST_WAYS,
    REGULAR,
    RESOLUTION_MANY,
    SAMPLES,
    STRETCHED,
)
from derive.choices.redundancy import (
    Group,
    Independent,
    combined,
    groups,
    keeps,
    selected,
    sentences,
)
from derive.choices.stretched import consistent_start, kantorovich
from derive.diagnostics import AssumptionError, ModelError
from derive.mechanics.records import RowForm, System
from derive.model.constraint_records import Holonomic
from derive.model.records import Model, Velocity
from derive.states.closing import Kinematics
from derive.states.independence import independent
from derive.states.initial import initial_state
from derive.states.sampling import States, no_states, row_lengths, states
from derive.states.sparse import Sparse, clearly_independent, lengths_over_states, squares, stacked

# of closures and constraints: each in several ways of writing its rows
Blocks = Sequence[Sequence[Sequence[RowForm]]]


@dataclass(frozen=True, eq=False)
class Survey:
    """The system with what every choice needs to know of it: sampled states and the rank of A.

    With `moving` frames of directions are data of the module that is to be generated.
    """

    system: System
    moving: bool = False

    @cached_property
    def solver(self) -> Kinematics:
        """φ, A, c and N of the system in numbers, set up once for all candidates."""
        return Kinematics(self.system)

    @cached_property
    def sampled(self) -> States:
        """Admissible states at which every candidate is judged. Fewer on large systems: the number
        of entries that are evaluated stays bounded, but never fewer than FEWEST states."""
        nv = max(1, self.system.v.numel())
        return states(self.system, max(FEWEST, min(SAMPLES, ENTRIES // nv)), solver=self.solver)

    @cached_property
    def many(self) -> States:
        """More states than are worked with: enough to see where pivots come near zero."""
        return states(
            self.system, RESOLUTION_MANY * len(self.sampled.t), seed=1, solver=self.solver
        )

    def sampled_for(self, B: ca.SX) -> States:
        """The sampled states, and the initial one where [A; B] is regular there.

        It is no random state: a pivot that is zero just there must not be taken where another is
        not.
        """
        start = self.initial
        if start is None or not len(self.sampled.t):
            return self.sampled
        return self.sampled if self._least_at(start, B) < REGULAR else self._with(start)

    def is_singular_at_start(self, B: ca.SX) -> bool:
        """Whether w cannot be the state where the motion begins, or hardly."""
        start = self.initial
        return start is not None and self._least_at(start, B) < REGULAR

    def depends_at_start(self, B: ca.SX) -> bool:
        """Whether w does not tell v where the motion begins, though the constraints do not depend
        on each other there."""
        start, none = self.initial, ca.SX(0, self.system.v.numel())
        if start is None or self._least_at(start, B) > DEPENDENT:
            return False
        return self._least_at(start, none) > DEPENDENT

    def _least_at(self, start: States, B: ca.SX) -> float:
        """The least singular value of [A; B] there, rows of length one at most."""
        if self.without_zeros is None:
            held = self.solver.rows(start.t, start.q, start.p)[0][:, list(self.kept)]
            speeds = self.solver.values(B, start.t, start.q, start.p)
            both = np.concatenate([even_rows(held), even_rows(speeds)], axis=1)[0]
            if not np.all(np.isfinite(both)):
                return 0.0
            return float(np.min(np.linalg.svd(both, compute_uv=False), initial=1.0))
        A = self.solver.velocity_rows(start.t, start.q, start.p)[0].of_rows(self.kept)
        own = self.solver.value_rows(B, start.t, start.q, start.p)
        Y = stacked(evened(A), evened(own))
        return float(squares(Y.pattern).extremes(Y)[0][0])

    def _with(self, start: States) -> States:
        pairs = (
            (getattr(self.sampled, name), getattr(start, name))
            for name in ("t", "q", "v", "u", "p")
        )
        return States(*(np.concatenate(pair) for pair in pairs))

    @cached_property
    def initial(self) -> States | None:
        """The consistent initial state of the model, where there is one."""
        try:
            start = initial_state(self.system)
        except ModelError:
            return None
        u, p = np.zeros((1, self.system.u.numel())), np.array([self.system.parameters], dtype=float)
        return States(np.zeros(1), start.q[None, :], start.v[None, :], u, p.reshape(1, -1))

    @cached_property
    def plain_rows(self) -> np.ndarray:
        """A at the sampled states, k × nc × nv, in SI: rows in m/s beside rows in rad/s."""
        s = self.sampled
        return self.solver.rows(s.t, s.q, s.p)[0]

    @cached_property
    def rows(self) -> np.ndarray:
        """The same, each row divided by its largest length over them, so that rows of all units
        compare and one that vanishes at a singular position is seen to."""
        return even_rows(self.plain_rows)

    @cached_property
    def masses(self) -> np.ndarray | None:
        """M at the sampled states, k × nv × nv; None where M is not written out, and where rows are
        too many for it."""
        s = self.sampled
        if self.system.long or not self.system.written or self.solver.many_rows:
            return None
        M = self.solver.values(self.system.M, s.t, s.q, s.p)
        return M if np.isfinite(M).all() else None

    @cached_property
    def without_zeros(self) -> Sparse | None:
        """`rows` without zeros where there are many and all of them are independent, clearly so at
        most of the sampled states; None elsewhere."""
        s = self.sampled
        if not self.solver.many_rows:
            return None
        A = evened(self.solver.velocity_rows(s.t, s.q, s.p)[0])
        return A if clearly_independent(A) else None

    @cached_property
    def sizes(self) -> list[float]:
        """The largest length of each row of A over the sampled states."""
        if self.without_zeros is not None:
            s = self.sampled
            A, _ = self.solver.velocity_rows(s.t, s.q, s.p)
            return lengths_over_states(A).tolist()
        return row_lengths(self.plain_rows).tolist()

    @property
    def rank(self) -> int:
        """The rank of A at most of the sampled states: that of regular positions."""
        return len(self.kept)

    @cached_property
    def kept(self) -> tuple[int, ...]:
        """Independent constraint rows, first come first kept where that serves everywhere."""
        if self.without_zeros is not None:
            return tuple(range(len(self.system.rows)))
        return independent(self.rows, range(len(self.system.rows)), self.closing)

    @cached_property
    def closing(self) -> tuple[int, ...]:
        """Independent rows among the holonomic ones alone: φ = 0 needs them even where a
        nonholonomic row repeats their rate."""
        holonomic = [i for i, row in enumerate(self.system.rows) if row.position >= 0]
        if self.without_zeros is not None:
            return tuple(holonomic)
        return independent(self.rows, holonomic)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Rows that depend on each other at the sampled states."""
        return groups(self.rows, self.kept) if self.without_zeros is None else ()

    @cached_property
    def repetitions(self) -> tuple[str, ...]:
        """One sentence for every closure or constraint with rows that repeat others."""
        return sentences(self.system, self.groups)

    @cached_property
    def independent_rows(self) -> Independent:
        """What stands for all rows, by the policy of the model: the kept ones, or all with those of
        a group combined."""
        if self.combines:
            return combined(self.system, self.kept, self.groups)
        return selected(self.system, self.kept)

    @cached_property
    def forms(self) -> list[list[RowForm]]:
        """The rows to eliminate, in every way of writing them."""
        if not self.combines:
            return ways_of(self.whole(self.system.blocks))
        rows = [row for block in self.system.blocks for row in block[0]]
        combined = [k for k, i in enumerate(self.kept) if i in self.grouped]
        return [
            [row for i, row in enumerate(rows) if i not in self.grouped]
            + [self.independent_rows.form(k) for k in combined]
        ]

    def whole(self, blocks: Blocks) -> Blocks:
        """Of a block of which not all rows are kept the first way alone: beside the constraints
        single rows of another way hold something else."""
        result: list[Sequence[Sequence[RowForm]]] = []
        first = 0
        for block in blocks:
            last = first + len(block[0])
            kept = sum(first <= i < last for i in self.kept)
            result.append(block if kept == last - first else block[:1])
            first = last
        return result

    @cached_property
    def form_sizes(self) -> list[float]:
        """Their magnitudes over the sampled states."""
        if not self.combines:
            return self.sizes
        combined = [k for k, i in enumerate(self.kept) if i in self.grouped]
        s, A = self.sampled, self.independent_rows.A
        single = [size for i, size in enumerate(self.sizes) if i not in self.grouped]
        if not combined:
            return single
        return [*single, *row_lengths(self.solver.values(A[combined, :], s.t, s.q, s.p)).tolist()]

    @cached_property
    def combines(self) -> bool:
        """Whether some rows repeat others and all are to be kept."""
        return keeps(self.system) and any(group.kept for group in self.groups)

    @cached_property
    def grouped(self) -> set[int]:
        """The rows that depend on others."""
        return {i for group in self.groups for i in (*group.kept, *group.others)}

    @cached_property
    def followers(self) -> frozenset[str]:
        """Names of the speeds that a coupling gives by another coordinate, as a mimic joint."""
        model = self.system.model
        named = {c.follower for c in model.constraints if isinstance(c, Holonomic) and c.follower}
        return self._speeds(lambda velocity: velocity.rate_of in named)

    @cached_property
    def driven(self) -> frozenset[str]:
        """Names of the speeds that an input acts on."""
        named = {given.velocity for given in self.system.model.inputs}
        return self._speeds(lambda velocity: velocity.name in named)

    def _speeds(self, wanted: Callable[[Velocity], bool]) -> frozenset[str]:
        velocities = enumerate(self.system.model.velocities)
        return frozenset(speed_name(self.system, j) for j, v in velocities if wanted(v))

    @property
    def freedom(self) -> int:
        """Degrees of freedom: nv less the rank of A, which is how many quasi-velocities a choice
        must name."""
        return self.system.v.numel() - self.rank


def even_rows(matrices: np.ndarray) -> np.ndarray:
    """Matrices (k, rows, columns) with rows of length at most one, divided alike in all."""
    return matrices / row_lengths(matrices)[:, None]


def evened(matrices: Sparse) -> Sparse:
    """The same of matrices without zeros."""
    return matrices.scaled(1 / lengths_over_states(matrices))


def survey_of(system: System, moving: bool = False) -> Survey:
    """The survey of a system. Raises HamelError where no consistent state can be found to look
    at: ranks and pivots are judged at admissible states alone, as off φ = 0 rows that repeat others
    look independent."""
    result = Survey(system, moving)
    if not len(result.sampled.t):
        _check_start(result)
        raise no_states(system)
    _check_regular(result)
    return result


def _check_start(survey: Survey) -> None:
    """Raises AssumptionError where there is no admissible state but a singular one, at which the
    walks that look for others begin."""
    rows = [i for i, row in enumerate(survey.system.rows) if row.position >= 0]
    if survey.solver.many_rows or not rows:
        return
    start = consistent_start(survey.system)
    if start is not None and kantorovich(survey.system, survey.solver, start, rows)[0] > STRETCHED:
        raise _stretched(survey.system.model)


def _check_regular(survey: Survey) -> None:
    """Raises AssumptionError where most of the sampled states are singular positions."""
    if survey.solver.many_rows or not survey.closing:
        return
    found = kantorovich(survey.system, survey.solver, survey.sampled, survey.closing)
    if np.median(found) > STRETCHED:
        raise _stretched(survey.system.model)


def _stretched(model: Model) -> AssumptionError:
    return AssumptionError(
        f"{model.name}: constraints depend on each other at every consistent state that was "
        "found: it fits together at singular positions alone, where no motion is determined",
        "other lengths: with these it is stretched, or folded, to fit",
    )


def ways_of(blocks: Blocks) -> list[list[RowForm]]:
    """The rows of all blocks in every way of writing them: all combinations while they are few,
    else the same way for all blocks."""
    return [
        [row for block, way in zip(blocks, ways) for row in block[way]] for ways in _ways(blocks)
    ]


def _ways(blocks: Blocks) -> list[tuple[int, ...]]:
    """Index of the way of writing per block."""
    counts = [len(block) for block in blocks]
    if np.prod(counts, dtype=float) <= MOST_WAYS:
        return list(cartesian(*[range(n) for n in counts]))
    return [tuple(min(k, n - 1) for n in counts) for k in range(max(counts))]


def speed_name(system: System, j: int) -> str:
    """What the quasi-velocity that is generalized velocity j is called: q_dot, base_vx; with _w
    behind it where something of the model has that name already."""
    velocity = system.model.velocities[j]
    natural = f"{velocity.rate_of}_dot" if velocity.rate_of else velocity.name.replace(".", "_")
    return _free(system, natural)


def direction_names(system: System, count: int) -> tuple[str, ...]:
    """What quasi-velocities along directions are called: w1, w2 …, in the same way."""
    return tuple(_free(system, f"w{k + 1}") for k in range(count))


def _free(system: System, name: str) -> str:
    while system.model.is_taken(name):
        name += "_w"
    return name
