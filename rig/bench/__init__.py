"""The bench as its file declares it: instruments, limits, sensors; checked against their drivers, nothing opened."""
