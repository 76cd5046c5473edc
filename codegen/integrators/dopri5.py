"""The pair of orders 5 and 4 of Dormand and Prince (J. Comput. Appl. Math. 6, 1980), step control
after Hairer and Wanner; continuous output of L. F. Shampine (Math. Comp. 46, 1986)."""

from fractions import Fraction

from codegen.integrators.records import Dense, Tableau, row

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
    dense=Dense(
        order=4,
        c=(),
        a=(),
        powers=(
            row("1 0 0 0 0 0 0"),
            row(
                """
                -8048581381/2820520608 0 131558114200/32700410799 -1754552775/470086768
                127303824393/49829197408 -282668133/205662961 40617522/29380423
                """
            ),
            row(
                """
                8663915743/2820520608 0 -68118460800/10900136933 14199869525/1410260304
                -318862633887/49829197408 2019193451/616988883 -110615467/29380423
                """
            ),
            row(
                """
                -12715105075/11282082432 0 87487479700/32700410799 -10690763975/1880347072
                701980252875/199316789632 -1453857185/822651844 69997945/29380423
                """
            ),
        ),
    ),
)
