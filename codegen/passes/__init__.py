"""From Equations to Program: verbs that rewrite a function's graph (`pipeline` is the page to read first)."""

from codegen.passes.pipeline import program

__all__ = ["program"]
