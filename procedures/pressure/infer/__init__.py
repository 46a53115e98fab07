"""Pressure in flight from a calibrated transducer, with an interval, by a zero read in flight.

infer_pressure(fit.calibration(), bridge_mV, T_sensor, T_SSE, Zero(v_0, T_sensor_0, T_SSE_0))
"""

from rig.procedures.pressure.infer.in_flight import STOOD_DEGC, Inferred, infer_pressure
from rig.procedures.pressure.infer.zero import Departure, Zero, departure

__all__ = ["STOOD_DEGC", "Departure", "Inferred", "Zero", "departure", "infer_pressure"]
