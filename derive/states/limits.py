"""The tolerances and limits of sampled and consistent states, with unit and reason; relative where
nothing else is said."""

# axes
AXES_SAMPLES = 60  # states at which rows are judged: twenty do not show what happens once a turn
BETTER = 2.0  # times the share of the ground's axes: what others have to bring
SIDES = (0, 1, 2, 3, 4)  # of `Closure.along`: those that are tried
FEW_CLOSURES = 6  # of so many each is tried by itself, too

# closing
REPEATS = 1e-10  # singular values below this part of the largest belong to rows that repeat others
CLOSED = 1e-12  # |φ| against 1 + |q|, or of a row against the sizes of its own terms
ROUNDED = 1.4e-14  # |φ| against 1 + |q|: what the way round a loop rounds, no row can be better
GUESSES = 8  # starts anywhere on a turn, where held values are met from none beside the guesses
EVEN = 1e-3  # of the largest of these a row has at least that part
NEWTON = 30  # iterations after which a start counts as hopeless
LEAP = 0.7  # rad: the largest step taken at once
NUDGES = (0.0, 1e-3, 0.1)  # rad or own lengths: what a start that does not close is moved by

# independence
# of the independence of all rows: with less at some state other rows than the first are looked at
POOR = 0.3
MOST_SETS = 200  # of rows to keep that are all compared
SINGULAR = 1e-3  # of its usual value the least singular value of all rows: no regular state
REGULAR = 0.5  # of the same: a state that is far from singular ones

# initial
AGREES = 1e-9  # relative residual up to which held velocities count as kept
UNWOUND = 1e-9  # by so much coordinates move at most when an angle is taken back by whole turns
TAKES_PART = 1e-3  # of the largest residual of rows that contradict each other: one of them

# nonideal
SAMPLES = 12  # states at which pivots of the ideal problem are looked at
RANK = 1e-9  # singular values of rows of length one below this are zero

# sampling
BEYOND = 30.0  # times Newton's step from there: where the slope of a formula is looked at once more
VANISHED = 0.1  # of that slope: less where the formula is zero is none
LATER = (0.1, 0.5, 1.0, 2.0)  # s: when a mechanism that moves by itself is asked to close, too
SQUARES = 1e-14  # eigenvalues of J Jᵀ below this part of the largest are zero: rounding of squares

# sparse
MANY_ROWS = 40  # from so many rows on zeros are left out: with fewer LAPACK is as fast
MANY_VELOCITIES = 250  # … and N has a square of entries
ROUNDS = 2  # of solving for velocities: once more, for what rounding left
REFINED = 2  # steps of refinement of what is solved by squares
POWERS = 30  # of a matrix whose extreme singular values are looked for: three digits of them
NOTHING_LEFT = 1e-8  # of a wish: the rows forbid all of it
LEFT_OVER = 1e-14  # of the longest row: a shorter one is rounding
STEPS = 9  # of a walk
FAR = 1.0  # rad or width: a step that moves a coordinate by more ran into a singular position
LOOSE = 0.02  # rad or width: what a step may be off φ = 0 before its last correction
GAP = 1e-12  # eigenvalues of A Aᵀ below this part of the largest belong to rows that repeat others
# a smallest singular value below this part of its usual size is near a singular position
NEAR = 0.1
PROBES = 6  # configurations looked at to learn the rank
TRIALS = 6  # ranks that are tried from the least one to that of all rows, where there are many
STARTS = 40  # random starts where the nominal one cannot be closed
CONTRADICTION = 1e-6  # what A v = c may be off by, in rows of length one, relative to 1 + |v|
LOCKED = 1e6  # entries of N from which q̇ = N v runs away; away from gimbal lock they are about one
SPARE = 4  # walkers more than states asked for, and a fifth of these

# scales
# singular values below this part of the largest: nothing in the file fixes that unit
UNKNOWN = 1e-6
STEP = 3  # decades
# of the largest row of a closure: a smaller one is what lever arms of a long way round have rounded
ROUNDOFF = 1e-12
FARTHEST = 30  # decades: what is beyond is left to the numbers, so that no product overflows
PLACES = 5  # configurations at which the rows are looked at
SMALL = 0.75  # decades: the parts that a file gives are smaller than the whole that moves
