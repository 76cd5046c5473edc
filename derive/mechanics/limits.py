"""The tolerances and limits of assembling and solving, with unit and reason; relative where nothing
else is said."""

# closures
HALF_A_TURN = 1e-12  # 1 + tr R up to which two frames are half a turn apart

# silent
FAINT = 1e-10  # of one and of the largest entry of A: what is below is looked at for rounding
PLACES = 4  # configurations at which it has to be that

# solve
SAFE = 0.5  # a pivot whose least value is at least this part of its largest is taken as it is
BETTER = 3.0  # a larger block has to stay this much farther from zero to be preferred
# a ratio this many times its median says that one pivot vanishes where the other does not
ALONE = 10.0
# relative size that counts as zero: what is left of a row that repeats others, at closed positions
VANISHES = 1e-8
ZERO = 1e-6  # a pivot that comes so near zero at a sample, relative to its largest, vanishes there
MANY = 60  # rows from which the sizes of pivots are compared to so many digits
DIGITS = 9
SAME = 1e-9  # relative variation that counts as none
MOST = 200  # candidate blocks looked at
COFACTORS = 3  # rows up to which a block is inverted by cofactors
MOST_REFLECTED = 16  # rows up to which all that is left may be solved by reflections
GROWTH = 6.0  # an elimination that may let entries grow more than this gives way to reflections

# moments
NO_MOMENT = 1e-14  # what rounding leaves of moments of inertia, of the largest of them

# system
REGULAR = 1e-13  # least eigenvalue of a mass matrix with an inverse, of its largest
MOST_ENTRIES = 2_500  # of M below the diagonal; beyond that only the O(n) recursions are of use
# links from which equations are formed on demand alone: until then all of it takes some seconds
LONG = 250
FEW = 40  # with more links than this, equivalent sets of inertias are not compared

# templates
MOST_TERMS = 2_000  # of the formula of a force at a joint in loops over links

# rolling
FLAT = 1e-9  # a sine of the angle between axis and normal below this is none

# scene
# links on the way to a body from which its velocity, and what a force on it does, go from link to
# link, in space and in a plane: on shorter ways sums over the joints take fewer operations
DEEP, DEEP_IN_PLANE = 2, 10

# loads
AT_REST = 1e-32  # added to the squared sine of half a turn: nothing beside a turn of 1e-8
FEW_ENTRIES = 8  # of a force: up to so many are added one by one, where a sum has thousands

# links
EXACT = 1e-14  # what rounding leaves between an entry of a direction and a whole number

FEET = 8  # points from where a surface is looked for
STEPS_TO_SURFACE = 60  # halves of the way to a double root: 1e-18 of it is left
FLAT_SURFACE = 1e-6  # of the slope beside a surface: what is less on all of it is none
STEPS_TO_FOOT = 6  # 64 digits of the way from the centre of a sphere to the surface below it
LONG_SUM = 64  # terms of a position that are looked through for what is constant in it
