"""Work of a person in a run: steps, settings and readings, asked for and confirmed."""
