"""The tolerances and limits of the numbers of a model file, with unit and reason; relative where
nothing else is said."""

# axes
RIGHT_ANGLE = 1e-6  # cosine of the angle between axes that count as being at right angles

# bodies
INERTIA_SLACK = 1e-9  # relative: a thin disk has Ixx + Izz = Iyy exactly, up to rounding
SYMMETRIC = 1e-9  # of the largest moment: what rounding leaves between the halves of a tensor
TRIANGLE_SLACK = 1e-5  # relative: of a thin disk whose moments are written with five digits

# quaternions
UNIT_LENGTH = 1e-12  # how far from one the length may be before it is set right

# space
# of a quarter turn: an angle so near to a whole number of them is meant to be one
RIGHT_TURN = 1e-14
ZERO_ENTRY = 1e-12  # entries of a rotation nearer to zero are zero

# placements
# how far from a rotation the entries of a matrix may be: what six printed digits leave
ORTHOGONAL = 1e-6

# extremes
RTOL = {"float64": 1e-11, "float32": 1e-6}  # of a case that says nothing, by what it is computed in

# ---- formulas (nodes)

LONGEST_RATE = 100_000  # of the rate of a definition, which is written out
