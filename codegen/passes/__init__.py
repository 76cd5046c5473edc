"""From Equations to Program: verbs that rewrite a function's graph (`pipeline` is the page to read
first)."""

from codegen.passes.pipeline import program
from codegen.passes.precision import in_precision

__all__ = ["in_precision", "program"]
