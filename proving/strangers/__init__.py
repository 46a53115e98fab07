"""Worlds that nobody here wrote: sets of hidden causes by strangers, opened once, and scored.

The contract of a set, the judge's list and the commands: README.md in this folder.
"""
