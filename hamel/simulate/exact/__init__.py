"""Solutions to hold simulations against: many digits, with a bound on the error."""

from hamel.simulate.exact.solution import Problem, Solution, solution, state_of, written

__all__ = ["Problem", "Solution", "solution", "state_of", "written"]
