"""A bounded share of the kill campaign; the whole of it is `python -m proving crashes kills`."""

from __future__ import annotations

from proving.crashes.kills import one_run


def test_killed_at_random_moments_nothing_is_lost_doubled_or_approached_from_the_wrong_side(tmp_path):
    seed = 101
    print(f"seed {seed}")
    tally = one_run(tmp_path, seed, kills=4, longest_s=1.0, replications=3)
    assert tally.kills >= 3
    assert (tally.lost, tally.duplicated, tally.wrong_side) == (0, 0, 0)


def test_whole_plots_killed_at_random_moments(tmp_path):
    seed = 303
    print(f"seed {seed}")
    tally = one_run(tmp_path, seed, kills=2, longest_s=1.2, replications=1, lab="pressure")
    assert tally.kills >= 1
    assert (tally.points, tally.lost, tally.duplicated, tally.wrong_side) == (25, 0, 0, 0)
