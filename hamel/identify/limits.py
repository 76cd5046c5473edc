"""What identification takes as zero, as settled and as enough, with unit and reason."""

from __future__ import annotations

# base
VANISHES = 1e-10  # of a coefficient or a column, relative to the largest: what rounding leaves
DEPENDS = 1e-8  # of a column that is scaled to one: what is left of it by those before it
STATES = 60  # at least, and enough for three times as many equations as parameters
ROUND = 1e-9  # a coefficient this near a whole number is one

# estimate
ROUNDS = 10  # of weights by residuals; they settle in two or three
SETTLED = 1e-4  # of a standard deviation: far below what it is known to
LIGHT = 0.01  # least known deviation by that of the untold: so masses stay within reason
EXACT = (1e-11, 1e-9, 1e-8)  # of the solver, and what it may have where that is not reached
MARGIN = 1e-9  # of a pseudo-inertia's own size: strictly inside, so that rounding stays there
LEAST_WEIGHT = 1e-12  # of the largest residual: an equation without noise is not infinitely exact
FEW_WEIGHTS = (1e-4, 1e-2)  # the same, where no body has what is told so exactly: solvers fail

# fit
DOUBTFUL = 0.1  # of forces, or of what is measured: a fit that leaves more explains another thing

# excitation
TRIES = 20  # random series, of which the best is improved
STEPS = 15  # of the search
POINTS = 12  # of time per harmonic, where the motion is judged
PEAKS = 80  # of time per harmonic, where limits are looked at: the bound is then 0.08 % above
ROOM = 0.95  # of the way to a limit

# measured
ORDER = 4  # of the Butterworth filter, that runs forwards and backwards
TOP = 0.8  # of half the sampling rate, from where on there is noise alone
RISEN = 10.0  # times the power of the noise: there is motion at that frequency
SMOOTH = 9  # frequencies that power is averaged over
ABOVE = 1.5  # the cutoff is so many times the highest frequency with motion
SPLINE_ENDS = 12  # rows in which what a quintic spline's end does falls to 1e-4 of itself
NYQUIST = 0.4  # and at most this part of the sampling rate
EVEN = 1e-3  # of a time step: what steps may differ
LEAST = 20  # rows
LOOKED = 10  # of them are looked at for what loops tell: few are at a dead centre

# shooting
TOLERANCE = 1e-11  # of the motions: differences of them have to be smooth
DIFFERENCE = 1e-5  # of a scale, that a start or parameter is moved by: half of the digits there are
MOVES = 1e-6  # SI: the spread from which on an entry of the state is its own scale
FIRST_NOISE = 0.01  # of the spread of what is measured
CONTINUOUS = 1e4  # standard deviations of noise that a gap of one spread of the state counts as
LOOSE = (1.0, 100.0)  # the same before that, while parameters are far away
EVALUATIONS = 100  # of all segments
PASSES = 2  # the second with the noise that the first left
TOLD = 1e-9  # of the largest singular value: what the motion tells nothing of
SMALLEST_STEP = 1e-12  # of all unknowns in their scales: the search ends
PART = 0.1  # of a direction that nothing is told of: a parameter in it is named
