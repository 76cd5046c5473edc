"""Inverse dynamics, linear in inertial parameters, and which of them act together."""
