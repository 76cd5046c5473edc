"""The wrench that gives a body its motion, in the writing that needs the fewest operations.

With U = [ω̇]× + [ω]× [ω]×, a the acceleration of the body's point less gravity and h the first
moment,

    f = m a + U h,   n = I ω̇ + ω × I ω + h × a.

The products of inertia meet entries of U that f needs anyway, or differences of squares:
n₁ = … + I₂₃ (ω₂² − ω₃²) − I₁₂ U₃₁ + I₁₃ U₂₁. The moments of inertia are written in one of two ways,

    n₁ = I₁₁ ω̇₁ + (I₃₃ − I₂₂) ω₂ ω₃ + …          or          n₁ = K₂₂ U₃₂ − K₃₃ U₂₃ + …,

K = ½ tr(I) 1 − I the second moments of mass. (The matrix U after Craig and Khalil & Dombre.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import cross, dot, is_zero, minus, plus, scaled, sum_of, times
from derive.mechanics.limits import NO_MOMENT
from derive.mechanics.records import Inertia

# What a number of the body is multiplied by: its kind and the axes it belongs to. "U": an entry of
# U; "product": ωᵢ ωⱼ; "squares": ωᵢ² − ωⱼ²; "rate": ω̇ᵢ.
Atom = tuple[str, int, int]
Terms = list[tuple[Scalar, Atom]]
Rows = tuple[Terms, Terms, Terms]


@dataclass(frozen=True)
class Body:
    """A rigid body about one point: its numbers, and n without h × a and f without m a, entry by
    entry."""

    own: Inertia
    moment: Rows
    force: Rows

    @property
    def cost(self) -> int:
        """Operations of n and f, what ω and ω̇ give counted once."""
        rows = [*self.moment, *self.force]
        atoms = {atom for row in rows for _, atom in row}
        shared = {part for atom in atoms for part in _parts(*atom)}
        sums = sum(2 * len(row) - 1 for row in rows if row)
        made = sum(not isinstance(x, float) for row in self.moment for x, _ in row)
        return len(shared) + sums + made + _arm_cost(self.own)


def body(own: Inertia) -> Body:
    """In the cheaper of the two ways."""
    ways = [
        _by_axis([_moment(own.tensor, i, second) for i in range(3)]) for second in (False, True)
    ]
    force = _over_entries(own.moment)
    return min((Body(own, moment, force) for moment in ways), key=lambda x: x.cost)


def _by_axis(rows: Sequence[Terms]) -> Rows:
    x, y, z = ([term for term in row if not is_zero(term[0])] for row in rows)
    return x, y, z


def _over_entries(r: Vector) -> Rows:
    """U r."""
    return _by_axis([[(x, ("U", i, j)) for j, x in enumerate(r)] for i in range(3)])


def _moment(I: Matrix, x: int, second: bool) -> Terms:
    """n₁ without h × a."""
    y, z = (x + 1) % 3, (x + 2) % 3
    if second:
        K = second_moments(I)
        own: Terms = [(K[y], ("U", z, y)), (minus(0.0, K[z]), ("U", y, z))]
    else:
        own = [(I[x][x], ("rate", x, x)), (minus(I[z][z], I[y][y]), ("product", *_sorted(y, z)))]
    return [
        *own,
        (I[y][z], ("squares", y, z)),
        (minus(0.0, I[x][y]), ("U", z, x)),
        (I[x][z], ("U", y, x)),
    ]


def second_moments(I: Matrix) -> Vector:
    """∫ x² dm, ∫ y² dm, ∫ z² dm; what rounding leaves of numbers is nothing."""
    found: Vector = []
    for x in range(3):
        y, z = (x + 1) % 3, (x + 2) % 3
        value = times(0.5, minus(plus(I[y][y], I[z][z]), I[x][x]))
        sizes = [I[k][k] for k in range(3)]
        found.append(without_rounding(value, sizes))
    return found


def without_rounding(value: Scalar, sizes: Vector) -> Scalar:
    """Zero, where a number is what rounding leaves of a sum of others."""
    numbers = [abs(x) for x in (value, *sizes) if isinstance(x, float)]
    if len(numbers) <= len(sizes):
        return value
    return 0.0 if numbers[0] <= NO_MOMENT * max(numbers) else value


def _sorted(i: int, j: int) -> tuple[int, int]:
    return (i, j) if i < j else (j, i)


def _parts(kind: str, i: int, j: int) -> Iterator[Atom]:
    """An atom and what it is made of, each one operation; ω̇ is given."""
    if kind == "rate":
        return
    if kind == "product":
        yield "product", i, j
        return
    others = (i, j) if kind == "squares" else tuple(k for k in range(3) if k != i)
    if kind == "U" and i != j:
        yield "product", *_sorted(i, j)
    else:
        yield from (("square", k, k) for k in others)
    yield kind, i, j


def _arm_cost(own: Inertia) -> int:
    """Of h × a and m a with what they are added to."""
    h = sum(not is_zero(x) for x in own.moment)
    return 4 * h + (0 if is_zero(own.mass) else 6)


@dataclass
class Spin:
    """ω and ω̇ of a body with what is made of them, each once."""

    omega: Vector
    alpha: Vector
    known: dict[Atom, Scalar] = field(default_factory=dict[Atom, Scalar])

    def at(self, atom: Atom) -> Scalar:
        if atom not in self.known:
            self.known[atom] = self._made(*atom)
        return self.known[atom]

    def _made(self, kind: str, i: int, j: int) -> Scalar:
        if kind == "rate":
            return self.alpha[i]
        if kind == "product":
            return dot([self.omega[i]], [self.omega[j]])
        if kind == "squares":
            return minus(self._square(i), self._square(j))
        if i == j:
            return minus(0.0, plus(self._square((i + 1) % 3), self._square((i + 2) % 3)))
        product = self.at(("product", *_sorted(i, j)))
        k = 3 - i - j
        forward = (i + 1) % 3 == j
        return minus(product, self.alpha[k]) if forward else plus(product, self.alpha[k])

    def _square(self, i: int) -> Scalar:
        return self.at(("product", i, i))

    def swung(self, r: Vector) -> Vector:
        """U r."""
        return [self.total(row) for row in _over_entries(r)]

    def total(self, terms: Terms) -> Scalar:
        return dot([x for x, _ in terms], [self.at(atom) for _, atom in terms])


def wrench(of: Body, spin: Spin, a: Vector) -> tuple[Vector, Vector]:
    """(n, f) about the body's point, in its axes, N m and N."""
    n = [spin.total(row) for row in of.moment]
    f = [spin.total(row) for row in of.force]
    own = of.own
    if not is_zero(own.mass):
        f = sum_of(f, scaled(own.mass, a))
    return sum_of(n, cross(own.moment, a)), f
