"""The physical state of a simulated bench: head, package, chambers, line, sensors, and undeclared effects.

It is written from rotations, heat and gas flow, independently of the models of the fitter. Everything is a closed-form
function of virtual time, so neither the order nor the number of queries changes an answer.
"""

from rig.sims.physics.plant import Plant
from rig.sims.physics.truth import Truth, WorldError, read_truth, sensor_axes

__all__ = ["Plant", "Truth", "WorldError", "read_truth", "sensor_axes"]
