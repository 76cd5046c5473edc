"""states: consistent states of a system (closed positions, initial states, random admissible
samples, scales), and the system completed by what only they can tell."""

from derive.states.nonideal import system

__all__ = ["system"]
