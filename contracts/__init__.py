"""What both sides of a wire agree on: EDS, register maps, and how an instrument is declared in a table."""
