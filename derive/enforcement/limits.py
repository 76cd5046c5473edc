"""The tolerances and limits of enforcing constraints, with unit and reason; relative where nothing
else is said."""

# invariants
CONSERVED = 1e-8  # largest rate of an invariant, relative to the rates of its parts
TRIED = 20  # random values at which the power of forces in pieces is looked at
