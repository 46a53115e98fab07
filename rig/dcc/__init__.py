"""Digital calibration certificates (DCC) of others: reading, units of the Digital SI, signatures, schema."""
