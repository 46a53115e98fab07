"""Tables that others wrote, as they come: encoding, separator, decimal sign, preamble, names, units, gaps.

Only what `rig.tables.csv_files` refuses is read here. Ambiguous files are refused, and the message names the option
that settles it (docs/how_to/tables.md).
"""
