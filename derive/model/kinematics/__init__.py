"""Functions of the motion in formulas: position(load), distance(a, b), der(…) …"""
