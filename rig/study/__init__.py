"""Studies: published work done again with this program's own means, and held against what was printed."""
