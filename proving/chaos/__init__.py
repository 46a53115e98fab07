"""Chaos acts on real controllers, judged by a checker that shares no code with the project."""
