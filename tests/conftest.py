"""Settings of all tests."""

from __future__ import annotations

from hypothesis import settings

# Seeded by the test's own name: a failure on one machine is the same failure on another.
settings.register_profile("seeded", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("seeded")
