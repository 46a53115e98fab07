"""What is physically there on a simulated bench: head, package, chambers, line, sensors, and what nobody declared.

Written from rotations, heat and gas flow, a second time and independently of the models the fitter knows. Everything
is a function of virtual time in closed form, so that neither the order nor the number of questions asked of it
can change an answer.
"""

from sims.physics.plant import Plant
from sims.physics.truth import Truth, WorldError, read_truth, sensor_axes

__all__ = ["Plant", "Truth", "WorldError", "read_truth", "sensor_axes"]
