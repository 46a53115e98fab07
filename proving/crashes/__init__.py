"""Crashes, power cuts, kills and damaged files: nothing that was accepted may be lost, doubled or wrong."""
