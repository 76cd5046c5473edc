"""The Taylor series of the solution, by recurrences over the program, of an order that the
tolerance asks for; steps from the last two coefficients."""

from codegen.integrators.records import Taylor

TAYLOR = Taylor(
    name="taylor",
    about="Taylor series of the order that the tolerance asks for, for tight tolerances",
    source="A. Jorba, M. Zou: A software package for the numerical integration of ODEs by means "
    "of high-order Taylor methods, Exp. Math. 14, 2005",
)
