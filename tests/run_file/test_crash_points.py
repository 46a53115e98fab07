"""A share of `python -m proving crashes`: crashes, power cuts and damage, and nothing lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from proving.crashes.damages import Interrupted, file_damages, log_damages, small_finished
from proving.crashes.runs import crash_once, power_cuts

CRASHES = {"attitude": range(1, 270, 52), "pressure": range(1, 245, 48)}
"""From the first write to one of the last."""


@pytest.mark.parametrize("lab", CRASHES)
@pytest.mark.parametrize(("which", "lost"), [(0, "none"), (1, "all"), (2, "some")])
def test_a_crash_at_any_write_or_sync_is_gone_on_from(tmp_path, lab, which, lost):
    for nth in CRASHES[lab][which::3]:
        crashed, _, verdict = crash_once(lab, tmp_path / str(nth), nth, lost, seed=nth)
        assert crashed
        assert not verdict, f"{lab}, crash at {nth}, {lost} lost: {verdict}"


@pytest.mark.parametrize(("lab", "seeds"), [("attitude", (1, 2)), ("pressure", (4,))])
def test_power_cuts_at_random_moments(tmp_path, lab, seeds):
    cuts = 0
    for seed in seeds:
        done, _, verdict = power_cuts(lab, tmp_path / str(seed), seed, cuts=8)
        assert not verdict, f"{lab}, seed {seed}: {verdict}"
        cuts += done
    assert cuts >= 5 * len(seeds)


@pytest.fixture(scope="module")
def killed(tmp_path_factory) -> Interrupted:
    return Interrupted.make("attitude", tmp_path_factory.mktemp("killed"))


def test_a_damaged_log_is_told_of_or_has_lost_nothing(killed):
    counts, wrong = log_damages(killed, every=421)
    assert not wrong
    assert counts["distinct outcomes resumed to the end"] >= 3
    assert not any("not said" in what for what in counts if not what.startswith("0 "))


def test_a_damaged_file_is_refused_with_a_way_forward_or_has_lost_nothing(tmp_path: Path):
    counts, wrong = file_damages(small_finished("attitude", tmp_path), 4096 - 50, every=3)
    assert not wrong
    assert sum(counts.values()) > 40
