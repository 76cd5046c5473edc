"""The tolerances and limits of robot files, with unit and reason; relative where nothing
else is said."""

# inertias
SLACK = 0.5e-9  # relative, half of what the language allows
TRIANGLE = 0.5e-5  # the same of the triangle inequality
NOISE = 1e-15  # kg m²: what exporters write instead of zero; a gram at a micrometre

# friction
SMOOTHING = 0.01  # rad/s or m/s: where tanh in place of the sign is three quarters there
REST = 1e-3  # s in which friction may stop a joint: a step of a controller

# numbers
WHOLE = 1e15  # whole numbers below it are written without a point or an exponent

# rotations
NEAR = 1e-9  # of an entry: a direction so near to a simple one is that one
SAME_DEGREE = 1e-11  # rad: an angle so near to whole degrees is one to all digits that were written
MEANT = 1e-8  # rad: 1.5707963259 has a wrong digit, and means a right angle
ROUNDING = 1e-15  # of the largest entry of a tensor: less is what rounding leaves of zero
MOST_STEPS = 1e6  # degrees: an angle beyond is none that somebody meant
SAME_ANGLE = 1e-12  # relative: a printed angle is a rounding of the one that was meant

# words
SLIP = 0.7  # of the letters of two words the same (difflib's ratio): one is a slip of the other
MOST_UNKNOWN = 1000  # unknown words of a file are compared with known ones, which takes time

# size
MOST_BODIES = 20_000  # as of a model; building so many takes minutes
