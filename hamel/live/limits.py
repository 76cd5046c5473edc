"""How much a live page computes and offers, with unit and reason."""

from __future__ import annotations

# page
SPAN = 5.0  # seconds of a motion
ROWS = 300  # of it: between them states are interpolated for the picture
TOLERANCE = 1e-8  # of a step: finer than any plot, and still milliseconds
LARGEST_PUSH = 10.0  # of an input, in its unit
FEW = 12  # sliders of coordinates
NOTHING = 1e-12  # an initial value below it is rounding
CURVES = 4  # quasi-velocities in one plot: as many as there are colours

# course
STEPS = 500  # of the motion that the size of the picture is read from: a hundredth of a second each
LOOKED = 50  # of its states

# shape
LEGIBLE = 150.0  # pixels of a mechanism at its start
STEP = 1e-4  # of a parameter, by which the points of shapes are compared
STILL = 1e-9  # of the size: a point that moves less does not depend on the parameter
