"""What is true of a mechanical system before any choice of quasi-velocities: Model → System."""
