"""The tolerances and limits of choosing and eliminating, with unit and reason; relative where
nothing else is said."""

# assessment
LEAST_VIOLATION = 1e-16  # below it violations are all alike
MOST_VIOLATION = 1e16  # above it, too: where a step meets a singular position it is infinite
SHORT_TIME = 1e-6  # s: a difference over it shows accelerations
STEP = 0.1  # by which the fastest coordinate moves at most, with its velocity and its acceleration
ROUNDOFF = 2.0**-52  # of a float64: what a violation is told apart from

# elimination
SHORT = 3  # a twist component with at most so many terms is cheaper from its form than by recursion

CHAINED = 120  # rows from which forms are replaced by what they come to, once for all

# explicit
EXPLICIT_MANY = 12  # with more quasi-velocities than this, not every combination is solved

# orthonormal
MINORS = 3  # with more rows than this the cross product costs more than Gram–Schmidt
ROWS = 12  # with more than this a projection by A Aᵀ, which stays sparse, costs less

# pivots
# the guard of a pivot that is quadratic in the rows of A: they may come within 1e-6 of each other
SQUARED = 1e-12

# reduction
# guard: smallest |pivot| relative to the largest over the sampled states. Errors of v̇ grow with the
# square of what it is divided by: here three digits are left, at 1e-8 none
SINGULAR = 1e-6

# redundancy
TAKES_PART = 1e-8  # smaller weights in a dependency are roundoff
LOOKED_AT = 10  # states
DEPENDENT = 1e-9  # smaller singular values of rows of length one are zero
ALMOST = 1e-5  # … at a singular position, which is found to half the digits alone
SHORT_ROW = 1e-6  # of the longest row: a shorter one may be rounding and is not made as long

# resolution
FEW = 12  # with more links than this, twists are written in one way
WORTHWHILE = 0.97  # an estimate of operations tells no smaller differences
NAMED = 1e-6  # the least weight with which a row is named among those that depend on each other
# smaller singular values of the scaled [A; B] are those of a singular position, or nearly
REGULAR = 1e-3
SAMPLES = 40  # states that choices are judged at: few enough to look at each, enough to rank
RESOLUTION_MANY = 5  # times as many states where a look at pivots is all there is to do
MOST_SUBSETS = 60  # more partitions than this are not enumerated: the greedy one stands for them
MOST_WAYS = 16  # combinations of the ways to write constraint rows that are tried
TELLING = 100  # of more rows only so many tell which way of writing them is the shortest
# decades between the eigenvalues of Sᵀ M S, scaled, which any choice may have: digits of v̇ are lost
HEAVY = 4.0
LIGHT = 2.0  # decades more that are a reason to prefer another choice
FINALISTS = 5  # the best by pivots and condition, for which the equations are formed and counted
RANK = 1e-9  # singular values of rows of length one below this are zero
# of large systems fewer states are looked at: about so many velocities, at least so many states
ENTRIES = 2_000
FEWEST = 10

# embedded
# quasi-velocities and rows from which ẇ is looked for by constraint embedding, where so much of S
# is full
EMBEDDED, FULL = 4, 0.3
ALONE = (
    12  # more quasi-velocities than this go that way without being compared: twice as short there
)

# survey
STRETCHED = 0.03  # of Kantorovich's quantity: about 1/2 at singular positions, rounding at others

# few rows
# velocities from which ẇ is looked for by Gauss's principle and the recursion, with rows of so many
# of them at most
MANY, FEW_ROWS = 10, 0.4
# more quasi-velocities than this, held by at most so many rows, go that way without being compared:
# with 22, of a chain held at its end, Sᵀ M S takes twice the operations, with 46 five times
CUBIC, FEWEST_ROWS = 24, 6
# rows that are solved by reflections at most: more take more operations than they save
REFLECTED = 6

# walk
NO_PIVOT = 1e-13  # of the size of its row: an entry that is nowhere larger is rounding
