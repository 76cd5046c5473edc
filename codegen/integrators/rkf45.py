"""The pair of orders 4 and 5 of Fehlberg (NASA TR R-315, 1969); the step is the solution of order
5, as Haug takes it."""

from fractions import Fraction

from codegen.integrators.records import Dense, Tableau, row

RKF45 = Tableau(
    name="rkf45",
    about="Runge-Kutta-Fehlberg pair of orders 5 and 4, advanced with order 5",
    source="E. Fehlberg: Low-order classical Runge-Kutta formulas with stepsize control, NASA "
    "TR R-315, 1969",
    order=5,
    c=row("0 1/4 3/8 12/13 1 1/2 1"),
    a=(
        (),
        row("1/4"),
        row("3/32 9/32"),
        row("1932/2197 -7200/2197 7296/2197"),
        row("439/216 -8 3680/513 -845/4104"),
        row("-8/27 2 -3544/2565 1859/4104 -11/40"),
        row("16/135 0 6656/12825 28561/56430 -9/50 2/55"),
    ),
    errors=(row("1/360 0 -128/4275 -2197/75240 1/50 2/55 0"),),
    damping=Fraction(0),
    dense=Dense(
        order=4,
        c=(),
        a=(),
        powers=(
            row("1 0 0 0 0 0 0"),
            row("-71/30 0 1664/475 -15379/3135 54/25 6/55 3/2"),
            row("298/135 0 -3328/675 17576/1485 -126/25 -4/55 -4"),
            row("-13/18 0 1664/855 -2197/342 27/10 0 5/2"),
        ),
    ),
)
