"""Hostile inputs at every door of the program: files, texts, wires and paths."""
