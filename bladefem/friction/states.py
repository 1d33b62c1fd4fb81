"""States of a contact, numbered in one place.

A kernel knows the state at an instant; a period has a state of its own, from the shares of stick,
slip and separation; a count of nodes distinguishes those that open for a part of the period. The
integrator in time numbers with the sign of slip, because its equations multiply by it.
"""

from __future__ import annotations

# at an instant, and in a period all the time
SEPARATED = 0
STICK = 1

# at an instant
SLIP = 2
# of one tangent, where the slider is dragged to higher and to lower displacements
SLIP_UP = SLIP
SLIP_DOWN = 3
# closes within the step
CLOSING = 4

# in a period: slip in at most half of the contact time, or in more
PARTIAL_SLIP = 2
GROSS_SLIP = 3

# what nodes are counted by: stick all the time, slip, open for a part of the period, open
NODE_STATES = ("stick", "slip", "lift", "open")

# in `bladefem.time.event_integrator`: +1 and -1 are slip in that direction
SIGNED_STICK = 0
SIGNED_SEPARATED = 2
