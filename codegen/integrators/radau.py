"""Radau IIA of order 5, L-stable and stiffly accurate: collocation at three points, as in the
program RADAU5."""

from fractions import Fraction

from codegen.integrators.records import Collocation, row

RADAU = Collocation(
    name="radau",
    about="L-stable implicit Runge-Kutta method Radau IIA of order 5 for stiff systems, with "
    "the generated Jacobian",
    source="E. Hairer, G. Wanner: Solving Ordinary Differential Equations II, 1996, IV.8 (RADAU5)",
    order=5,
    c=row("0.155051025721682190180271592529 0.644948974278317809819728407471 1"),
    b=row("0.376403062700467275050075442369 0.512485826188421613838813446520 1/9"),
    real=Fraction("3.63783425274449573220841851358"),
    pairs=(row("2.68108287362775213389579074321 3.05043019924741056942637762479"),),
    T=(
        row(
            "0.0944387624889752414874900795064 -0.141255295020954208427990383808 "
            "0.0300291941051474244918611170891"
        ),
        row(
            "0.250213122965333311376509067513 0.204129352293799931995990810298 "
            "-0.382942112757261937795438233600"
        ),
        row("1 1 0"),
    ),
    inverse=(
        row(
            "4.17871859155190472734646265851 0.327682820761062387082533272430 "
            "0.523376445499449548039930915909"
        ),
        row(
            "-4.17871859155190472734646265851 -0.327682820761062387082533272430 "
            "0.476623554500550451960069084091"
        ),
        row(
            "0.502872634945786875951247343140 -2.57192694985560542918678535360 "
            "0.596039204828224924968821911099"
        ),
    ),
    error=row("-10.0488093998274155624603295076 1.38214273316074889579366284098 -1/3"),
)
