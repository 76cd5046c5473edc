"""The implicit midpoint rule: order 2, symmetric, symplectic in canonical coordinates; energies
stay bounded over long runs."""

from codegen.integrators.records import Midpoint

IMPLICIT_MIDPOINT = Midpoint(
    name="implicit_midpoint",
    about="implicit midpoint rule of order 2 for long runs, fixed steps, with the generated "
    "Jacobian",
    source="E. Hairer, C. Lubich, G. Wanner: Geometric Numerical Integration, 2006, II.1",
)
