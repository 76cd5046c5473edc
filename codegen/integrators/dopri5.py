"""The pair of orders 5 and 4 of Dormand and Prince (J. Comput. Appl. Math. 6, 1980), step control
after Hairer and Wanner."""

from fractions import Fraction

from codegen.integrators.records import Tableau, row

DOPRI5 = Tableau(
    name="dopri5",
    about="explicit Runge-Kutta pair of orders 5 and 4",
    source="J. R. Dormand, P. J. Prince: A family of embedded Runge-Kutta formulae, 1980",
    order=5,
    c=row("0 1/5 3/10 4/5 8/9 1 1"),
    a=(
        (),
        row("1/5"),
        row("3/40 9/40"),
        row("44/45 -56/15 32/9"),
        row("19372/6561 -25360/2187 64448/6561 -212/729"),
        row("9017/3168 -355/33 46732/5247 49/176 -5103/18656"),
        row("35/384 0 500/1113 125/192 -2187/6784 11/84"),
    ),
    errors=(row("71/57600 0 -71/16695 71/1920 -17253/339200 22/525 -1/40"),),
    damping=Fraction(4, 100),
)
