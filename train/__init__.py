"""From a surface to valid charts, searched or learned, and the networks that answer for them; `presets` begins it."""

import os

# torch's threads (GNU OpenMP) spin for milliseconds while they wait for each other.  Beside other programs that doubled
# the time of training small networks and more; to sleep at once doubles it on an idle machine.  This many turns,
# some microseconds, cost nothing there and little here.  Read once, when torch is first imported.
os.environ.setdefault("GOMP_SPINCOUNT", "1000")
