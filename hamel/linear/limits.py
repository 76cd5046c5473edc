"""What pages of the linear motion take as zero, as equal and as enough, with unit and reason."""

from __future__ import annotations

# page
MAP = 25  # values of each name in a map that is made for the page
STRONGEST = 8  # parameters named for each mode
NARROW_TABLE = 48  # letters of a row that fit on the narrowest screen
GAP = 2  # letters between columns
GROWING = 1e-9  # a real part (1/s) above this grows
NOTHING = 1e-12  # a constant of the motion below this is zero
ROUNDOFF = 1e-13  # of the largest entry: an entry below this is zero
REAL = 1e-9  # of its size: a slope with less of an imaginary part is real

# courses
# of the way along a branch from the last row to a fold: eigenvalues are looked at so far on it
INSIDE = 1 - 1e-6

ON_ROW = 1e-3  # of the way to the row beyond: a fold so near to a row lies on it
SAME_PLACE = 1e-9  # of a value: what happens so near to a fold is the fold

# words
SEEN = 0.01  # relative amplitude below which a coordinate is not mentioned
# of the largest amplitude, in the model's own units: less may be the rounding of a mode
FAINT = 1e-6
SAME = 1e-9  # of an eigenvalue: a smaller part of it is zero

# ranges
COUNT = 101  # values of a range that does not say how many
MOST = 1_000_000  # values in one sweep
TRIED = 9  # values of a range, where the file's own has no steady motion
