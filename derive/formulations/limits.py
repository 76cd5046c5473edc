"""The tolerances and limits of formulations, with unit and reason; relative where nothing else is
said."""

# charts
# of its largest value over the sampled states: a pivot that comes closer to zero at one of them
# makes a choice unsafe
SAFE = 0.03
# no further chart where some chart has all pivots above this part at every sampled state
ENOUGH = 0.2
WORTH = 2.0  # times as far from singular at the worst state: what a further chart has to bring
MOST = 4  # charts that are looked for
# quasi-velocities up to which the orthonormal choice, which is dense, is the other chart: with 15,
# of a chain held at both ends, it takes ten times the operations of a partition, growing as n³
DENSE = 12
# and up to which a motion goes on with it, which keeps more digits where it comes near singular
# positions: with 27, of a rope of ten balls, it is not made within minutes
TOO_DENSE = 24
LOW = 0.2  # of the largest pivot seen when the equations were made: below this a chart is left ...
BETTER = 2.0  # ... for one that is so much better, so that no two charts take turns

# fitness
MASSLESS = 1e-12  # a diagonal entry of M below this part of the largest is not scaled to one
NULL = 1e-10  # singular values below this part of the largest count as zero
# a velocity belongs to a null direction where its entry is at least this part of the largest
TAKES_PART = 0.1
# of the largest: what moves less by a null direction, which is exact to NULL, stands still
DEPENDENT = 1e-6

# functions
PER_RADIAN = 1e-3  # digits of a closed position are lost from 1,000 rad on, in proportion
CLOSED = 1e-13  # project stops when |φ| is this small, in the units of φ, divided by …
USUAL = 3  # … the size of its terms where that is more than so many powers of ten from one
# velocities from which `project` and λ are looked for without M: on a chain that is linear in their
# number, where M takes the square and the bordered matrix the cube
MANY = 10
BORDERED = 40  # of more the bordered matrix is not made where another way is known
FEW_ROWS = 0.25  # of the velocities: of so many at most M⁻¹ Aᵀ is looked for by the recursion
# what a dropped row counts beside those that it repeats: met to 1e-7, where kept ones are to 1e-13
REPEATED = 1e-6
MOST_STEPS = 20  # of Newton; it doubles the digits in each, or does not converge

# distribution
SAMPLES = 12  # states at which it is looked at

# configuration
# keeps 0/0 out of sin(θ)/θ, which does not change where θ² is not far above; float32 can hold it
TINY = 1e-30

# udwadia_phohomsiri
LIGHT = 1e-9  # masses and mobilities below this part of the usual say nothing of a row's size

# ---- derivatives

BESIDE = 1e-2  # of a coordinate or of one: how far beside the constraints A S = 0 is looked at
EXACT = 1e-10  # of |A| |S|: what is left of A S is rounding
UNROLLED = 6_000  # operations of solving for them up to which they are written out, not looped over

# ---- rolled

MOST_KINDS = 12  # bodies of code in one loop over links; each is a branch and some kilobytes
MOST_PARAMETRIC = 64  # rows of a table that are computed from parameters, written out each time
# With more rows a column is numbers times at most so many formulas of parameters
MOST_FACTORS = 4
PLACES = 16  # values of the parameters at which that is looked at
FACTORED = 1e-12  # relative to an entry: what may be left of it
PIVOTAL = 0.1  # of the largest row that is left: the first such is taken
