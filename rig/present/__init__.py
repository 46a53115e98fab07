"""Output for people, made of rows of numbers and words, the same on the terminal and on a page."""
