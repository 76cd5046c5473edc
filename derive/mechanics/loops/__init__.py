"""Functions of a tree as loops over its links: one formula for each kind of joint, what differs
from link to link in tables. The size of the code does not grow with the mechanism.

Frames: z on the joint axis, origin on it; x of a link is perpendicular to the axis of the link that
follows, so that the placement of a link in its parent is Rx(α) Rz(θ) after the offset p, and
Rz(γ) Rx(α) Rz(θ) for the further children of a link with several (Khalil, Kleinfinger 1986).
"""
