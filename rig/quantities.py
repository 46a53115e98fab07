"""Names of the quantities that calibrations are made over, as tables and bench files have them."""

PITCH, ROLL = "pitch_deg", "roll_deg"
PRESSURE, SENSOR, SSE = "pressure_psia", "sensor_temperature_degC", "sse_temperature_degC"
