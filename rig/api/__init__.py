"""The Python door: what `import rig` gives, and what the command line prints. `docs/python.md` says how it is used."""
