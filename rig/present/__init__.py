"""What a person reads, made of rows: numbers and words, the same on the terminal and on a page."""
