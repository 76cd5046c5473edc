"""The tolerances and limits of steady motions and their linear equations, with unit and reason;
relative where nothing else is said."""

# critical
DEPTH = 40  # bisections before two changes are taken for one
CRITICAL_NEAR = 12  # bisections before eigenvalues are told apart by nearness
CRITICAL_STEPS = 100  # of a bisection, at most: a double has 53 bits

# cyclic
# of a derivative, in the model's own units, where it is small at all sampled states
LEAST_SCALE = 1e-3
CYCLIC_SAMPLES = 5  # random states at which a derivative has to vanish
CANCELLED = 1e-13  # of the largest derivative of all rows: what rounding leaves in the others
NOTHING = 1e-8  # relative size of a derivative that counts as zero at random states

# discrete
# steps within h: at first, and the most
DISCRETE_FEWEST, DISCRETE_MOST = 4, 4_096
DISCRETE_AGREES = 1e-10  # with half as many, relative to the row or column
DECAYED = 1e-6  # of what was one: less is looked at no closer than this
NEWTON = 12  # iterations of a step
SETTLED = 1e-14  # a change of the stages below this, relative to 1 + |x|, is the last

# kinks
ON_KINK = 1e-11  # in the model's own units: a motion so near to a kink lies on it
ASIDE = 1e-8  # in the model's own units: how far beside a kink its pieces are taken
BENDS = 1e-6  # of the largest slope: a difference between both sides that is one
JUMPS = 1e-8  # against 1 + the largest slope: the same of rates

# minimal
MANY = 32  # points from which operations take longer than what calls them
WEAK = 1e-9  # relative size of what is left of a row that repeats others
# coordinates whose rates are quasi-velocities become dependent only where others are this much
# weaker
SPARED = 1e-3
# guard: smallest pivot of the dependent coordinates, relative to where they were chosen
MINIMAL_NEAR = 1e-6

# sensitivity
TWIN = 1e-9  # of the norm of A: eigenvalues that differ by less are one
DEFECTIVE = 1e-7  # |yᴴ x| below which two eigenvalues are one and have no derivative

# spectrum
AVOIDED = 1e-2  # weight of coordinates among what tells families apart
VANISHES = 1e-9  # determinant below which they do not
NULL = 1e-11  # relative singular value that counts as zero at motions chosen at random
# relative imaginary part below which an eigenvalue counts as real, and real part below which it
# counts as marginal
REAL = 1e-9

# branch
SMOOTH = 0.05  # of the way: how far from the foreseen place the next motion of a branch may be
HALVED = 20  # times that the way to the next motion is halved, at most
STEPS = 400  # of this way, at most
LEAPS = 0.1  # of the way: a change that is left after these is no bend, and the branch has ended
LITTLE = 0.02  # of the largest change: what an unknown may do that does not change
HALF_KNOWN = 1e-3  # in the model's own units: a motion where branches meet is known so well
ROUNDED_AWAY = 1e-5  # in the model's own units: a largest change below this is taken for so much

# fold
ARC = 0.02  # the first step along a branch, in the model's own units and the way of the values
ARC_LEAST = 1e-9  # a shorter one is none: the branch ends there
ARC_STEPS = 1_000  # at most
ARC_ROUNDS = 8  # of Newton's method on the curve: more is no convergence from so near
ARC_STANDS = 1e-12  # a correction below this is the last
ARC_DIPS = 0.5  # of τ_t at both ends: with less of it halfway, a step may go across two folds
ARC_TURN = 0.9  # cosine of what the tangent may turn in a step
ARC_OFF = 0.2  # of the way: how far from where the tangent leads a point may be

# steady
STANDS = 1e-15  # a step of the iteration below this, relative to 1 + |y|, is its last
STRAIGHT = 1e-13  # residual, against 1 + |y|, up to which a course is a straight line
STEADY_STEPS = 40  # of a damped Newton iteration
RANK = 1e-10  # relative singular value below which a direction is left alone
KEPT = 1e-9  # relative residual up to which a motion is steady
STRAYS = 1e-3  # relative step that is no last one: a search that still makes it runs away
HALVINGS = 8  # of one of its steps
LEAP = 0.7  # rad or own length, against 1 + |q|: the largest step of a coordinate taken at once
FAR = 1.0  # rad or own length: a motion beyond is looked for nearer to the guess, and told
CREEPS = 1e-5  # a largest speed below this is tried at rest
FLAT = 1e-3  # the least slope that a row's residual is measured by
ROUNDING = 2e-4  # of slopes, against KEPT: a thousand roundings of the unknowns

# study
SPREADS = (
    1e-2,
    1e-2,
    1e-2,
    1e-3,
    1e-4,
)  # of parameters, relative; smaller where there is no motion
STUDY_SAMPLES = 3  # motions near the given one at which families are looked for
# singular values of rows of like size below this belong to rows that repeat others
SAME_ROWS = 1e-9
# the same of rows over their usual lengths at a steady motion, which is found to half the digits
# where they are dependent
DEPENDENT = 1e-6

# unreduced
CONSTANT = 1e-8  # relative rate below which a velocity is constant along the motion
ROUNDED = 1e-14  # of the largest row: what rounding leaves of one that says nothing
