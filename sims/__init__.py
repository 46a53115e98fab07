"""The same bench, simulated: virtual time, physics, and a twin behind real bytes for every instrument."""
