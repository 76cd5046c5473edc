"""The numbers that mechanics is written in: CasADi scalars, and floats where a value is known, so
that exact zeros and ones are seen and nothing is ever multiplied by them."""

from __future__ import annotations

import casadi as ca

Scalar = ca.SX | float
Vector = list[Scalar]
Matrix = list[Vector]
