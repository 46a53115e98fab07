"""Names of findings about noise in every kind of run: stratum "noise", no column of the model."""

NOISE_GROWS = "noise-grows"
"""The scatter of readings depends on a recorded quantity, named in the finding's cause and terms."""
AUTOCORRELATION = "autocorrelation"
"""Errors of successive readings are correlated, up to a random walk."""
OUTLIERS = "outliers"
"""Single readings that the scatter of the others does not explain."""
