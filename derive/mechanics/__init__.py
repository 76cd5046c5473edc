"""What is true of a mechanical system before any choice of quasi-velocities: Model → System."""

from derive.mechanics.system import system

__all__ = ["system"]
