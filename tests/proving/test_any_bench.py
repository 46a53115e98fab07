"""Nights whose bench is drawn, too: from every instrument with a file, of all protocols."""

from __future__ import annotations

import random
import tomllib

import pytest

from proving.night import any_bench
from proving.night.campaign import one_night
from proving.night.scenario import draw
from rig.bench.plugins import declared
from rig.contracts.declared.instrument import parse


def test_every_instrument_with_a_file_and_every_protocol_is_drawn():
    seen: set[str] = set()
    for seed in range(300):
        _, documents = any_bench.drawn(random.Random(seed))
        seen |= {one["driver"] for one in tomllib.loads(documents["bench.toml"])["instruments"].values()}
    known = {**declared(), **any_bench.texts()}
    assert seen - set(known) == {"can-daq", "druck-pace", "newport-esp301"}
    assert seen >= set(known)
    assert {parse(text).wire.protocol for text in known.values()} == {"text", "stream", "modbus", "can"}


def test_the_same_seed_is_the_same_night_on_the_same_bench():
    assert draw(5, any_bench.LAB) == draw(5, any_bench.LAB)
    assert draw(5, any_bench.LAB).documents["bench.toml"] != draw(6, any_bench.LAB).documents["bench.toml"]


@pytest.mark.parametrize("seed", range(9))
def test_without_faults_nothing_is_given_up(seed):
    verdict = one_night(seed, any_bench.LAB, calm=True)
    assert not verdict.violations
    assert (verdict.complete, verdict.skipped, verdict.sessions) == (True, 0, 1)


# a stream of several lines that come together; a controller that was stopped while it made the bench safe
@pytest.mark.parametrize("seed", [*range(100, 104), 4081, 4654])
def test_whatever_happens_what_is_recorded_holds(seed):
    assert not one_night(seed, any_bench.LAB).violations
