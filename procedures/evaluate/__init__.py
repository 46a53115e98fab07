"""Common parts of every kind's fit, trace, inference, chart, confirmation, budget and certificate."""
