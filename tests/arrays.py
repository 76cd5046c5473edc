"""Arrays as functions of C take them."""

from __future__ import annotations

import ctypes

import numpy as np


def address(values: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)


def aligned(values: np.ndarray) -> np.ndarray:
    """A copy that begins at a multiple of 64 bytes."""
    room = np.zeros(values.size + 8)
    first = -room.ctypes.data // 8 % 8
    made = room[first : first + values.size].reshape(values.shape)
    made[...] = values
    return made
