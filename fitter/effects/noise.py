"""What is found of the noise, by names that every kind of run shares: stratum "noise", no column of the model."""

NOISE_GROWS = "noise-grows"
"""The scatter of readings changes with something recorded; what it is, is in the finding's cause and terms."""
AUTOCORRELATION = "autocorrelation"
"""Errors of successive readings are alike, up to a random walk."""
OUTLIERS = "outliers"
"""Single readings that the scatter of the others does not explain."""
