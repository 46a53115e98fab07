"""The simulated bench: virtual time, physics, and a twin for every instrument that answers with real bytes."""
