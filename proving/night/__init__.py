"""Nights: simulated runs on which everything goes wrong, and what must hold nevertheless."""
