"""The networks of the paper, their training, and the finishing that makes valid charts of them."""

import os

# torch's OpenMP threads spin while they wait for each other.  On a busy machine that made training ten times slower,
# on an idle one sleeping instead costs nothing that could be measured.  Read once, when torch is first imported.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
