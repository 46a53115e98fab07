"""The kind "general": a table of anything, with a declared formula."""
