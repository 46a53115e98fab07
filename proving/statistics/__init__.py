"""Campaigns over seeds that say how often what the program says of data is so."""
