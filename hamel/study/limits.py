"""What report and extremes take as equal, as too long and as enough, with unit and reason."""

from __future__ import annotations

# advice
WORTH = 1e-8  # the error the advice is about, where it is reached
MOST = 1e-2  # the largest error that anything is advised for
NEARBY = 10.0  # times an error: methods that come this near to it are compared first
MOST_BROKEN = 6  # reasons of failed runs that are listed

# extremes
DIGITS = 15  # of a solution that judges
AGREES = 1e-6  # of its accelerations at the end with the independent derivation
LEAST_ERROR = 1e-16  # a smaller error is shown as this one, so that its logarithm exists
MOST_OF_RADAU = 3.0  # times those of SciPy's Radau

# front
NOISE = 1.1  # times that differ by less are the same
SMALL = 1e-12  # drift that is rounding

# judgement
AGREE = 1e-3  # two tight runs that differ by more give no reference
# an error above this is no result: wrong where another method with the same tolerance is this much
# closer
FAR = 0.1
CLOSER, NEAR = 100.0, 1e-4  # … and is near
LEAST = 1e-15  # of errors: below it is rounding
# times the bound and what the best runs differ by, from each other and from their looser ones
CONTRADICTED = 10.0

# libraries
LIBRARY_LIMIT = 2.0  # seconds of one run after which tighter ones are not tried
LIBRARY_SHARE = 0.1  # seconds of repeated calls from which a run time is taken

# page
COMPARED = 1e-8  # tolerance of the comparison of formulations and enforcements

# runs
MOST_STEPS = 10**9  # the time ends a run, not the steps
POINTS = 240  # of a track
MOST_REPEATS = 15  # of a run whose least time is taken

# study
EXACT_LIMIT = 20.0  # seconds of a tight run
EXACT_PARTS = 4  # … and no more than one of so many parts of the budget
EXACT_SHARE = 0.5  # of the budget, after which no other tight run is tried
# of what is left then, before violations over time and library solvers have their turn
MEASURED_SHARE = 0.75
# of what is shown of a study as done: its modules, then its runs, then library solvers
BUILT, RAN = 0.4, 0.8
BUILD_LIMIT = 120.0  # seconds of one build
GRACE = 60.0  # seconds on top of what a message should take, for machines that are busy otherwise
TRACK_LIMIT = 5.0  # seconds of one of them
TRACKED = 1e-8  # tolerance of the motions whose violations are drawn over time
