"""The classical Runge–Kutta method (Kutta 1901): no error estimate, so fixed steps only."""

from fractions import Fraction

from codegen.integrators.records import Tableau, row

RK4 = Tableau(
    name="rk4",
    about="the classical Runge-Kutta method of order 4, fixed steps",
    source="W. Kutta: Beitrag zur naherungsweisen Integration totaler Differentialgleichungen, "
    "1901",
    order=4,
    c=row("0 1/2 1/2 1 1"),
    a=((), row("1/2"), row("0 1/2"), row("0 0 1"), row("1/6 1/3 1/3 1/6")),
    errors=(),
    damping=Fraction(0),
)
