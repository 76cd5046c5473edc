"""The limits of builds, with unit and reason."""

from __future__ import annotations

# folder
ATTEMPTS = 20  # another build may be doing the same

# options
QUICK_STATES = 20  # what a build verifies at; `verify` does more
FEWEST = 2  # states it looks at in any case
MANY = 2000  # bodies, over all states
# and generalized velocities of closed mechanisms, each squared, for their equations are solved
# densely
DENSE = 150_000

# scratch
YOUNG = 60.0  # s: so long after it was made a folder of a living process may not be locked yet
ABANDONED = 86_400.0  # s: without locks, nothing takes longer

# store
FRESH = 600.0  # s in which an entry may be in use by another process and is left alone
DAY = 86_400.0  # s
LONGEST = 60 * DAY  # s; what was not used for so long is dropped
LARGEST = 500_000_000  # bytes; above this the entries not used for longest are dropped ...
SMALL = 100_000  # ... but those of up to so many bytes, which make no room

# tune
FEW = 1.5  # candidates with more than so many times the fewest operations are not compiled
ROWS = 256  # states that a candidate is timed over
FASTER = 0.97  # of the time of the usual one: what takes more is no reason for another
ROUNDS = 60  # the least of so many counts: what else the machine does only adds

# typeset
RUNS = 2  # the second has the numbers of equations and sections
PATIENCE = 120  # seconds for one
