"""Simulated instruments, one module per driver; they answer bytes with bytes."""
