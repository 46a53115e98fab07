"""What both sides of a wire agree on: EDS and register maps. Data files only."""
