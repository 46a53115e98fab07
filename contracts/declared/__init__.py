"""An instrument as a table: what its manual says, for its driver, its twin, its page and its tests."""
