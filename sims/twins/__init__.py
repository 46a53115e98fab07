"""Simulated instruments, one module for each driver; they answer bytes with bytes."""
