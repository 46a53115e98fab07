"""Settings of all tests."""

from __future__ import annotations

import os

# Before anything imports numpy: matrices here are narrow, and threads that spin beside two test workers cost minutes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hypothesis import settings

# Seeded by the test's own name: a failure on one machine is the same failure on another.
settings.register_profile("seeded", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("seeded")
