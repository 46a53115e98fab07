"""Further runs of whole plots: what as many whole plots as coefficients cannot judge is said, and not proposed."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from command import rig
from general_lab import run_dry
from test_hard_anything import FIXTURE, FIXTURE_PROCEDURE, FIXTURE_WORLD

from rig.bench.config import parse_procedure
from rig.procedures.general.confirming import _determined
from rig.procedures.plan.further_runs import Variation
from rig.verbs.confirm.answers import judge
from rig.verbs.confirm.choosing import _proposal
from rig.verbs.confirm.first import open_traced

WORLD = FIXTURE_WORLD.replace("+ seat", "+ 0.02*(gap_mm - 3)^2 + seat").replace("sd = 0.003", "sd = 0.001")
TEN = FIXTURE_PROCEDURE.replace("REPLICATIONS", "2").replace("levels = [1, 2]", "levels = [1, 2, 3, 4, 5]")
TWO = FIXTURE_PROCEDURE.replace("REPLICATIONS", "1").replace("levels = [1, 2]", "levels = [1, 4]")


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """A run whose line over the gap lacks a square: an effect between whole plots."""
    path, _ = run_dry(tmp_path_factory.mktemp("first"), TEN, FIXTURE, WORLD)
    return path


@pytest.fixture(scope="module")
def traced(first):
    return open_traced(first)


def test_a_run_whose_whole_plots_its_own_line_takes_up_cannot_tell(first, tmp_path):
    """Judge and forecast said "not shown" although the error with the effect fell to a tenth, and no reason."""
    later, _ = run_dry(tmp_path, TWO, FIXTURE, f"epoch = 2030-01-01T00:00:00Z\n{WORLD}")
    done = rig("confirm", first, "--by", later, "--json")
    assert done.returncode == 3, done.stderr
    told = json.loads(done.stdout)
    (effect,) = told["effects"]
    assert (effect["named"], effect["verdict"]) == ("second-order:gap_mm", "not shown")
    assert effect["members"][0]["sigmas_expected"] < 0.1
    assert "cannot tell whether second-order:gap_mm is there" in effect["sentence"]
    assert "its 2 groups of readings" in effect["sentence"]
    assert "no degrees of freedom" in effect["sentence"]


def test_such_a_run_is_neither_forecast_to_show_it_nor_proposed(traced):
    two, ten = (parse_procedure(text, "procedure.toml") for text in (TWO, TEN))
    assert not _determined(two)
    assert _determined(ten)
    (expected,) = _proposal(traced, Variation("two whole plots", two)).separations
    assert expected.least < 0.1


def test_a_quantity_that_follows_the_whole_plots_is_planned_with_their_settings(traced):
    """It was interpolated in time, so that a forecast had variation within whole plots that no run has."""
    confirming, procedure = traced.confirming, parse_procedure(TWO, "procedure.toml")
    table = confirming.data.table
    air = 20.0 + table.columns["gap_mm"] ** 2
    plot, within = table.columns["whole_plot"], np.arange(len(table)) % 3
    other = {"air_degC": air, "lid": np.sin(7.0 * plot), "fan": np.cos(5.0 * plot) + within}
    read = replace(confirming.traced.table, columns={**table.columns, **other})
    each = {name: replace(one, table=read) for name, one in confirming.traced.each.items()}
    again = replace(confirming, traced=replace(confirming.traced, each=each))
    planned = again._planned(procedure.expand(), 0.0).columns
    np.testing.assert_array_equal(planned["air_degC"], 20.0 + planned["gap_mm"] ** 2)
    assert [len(set(planned[name].tolist())) for name in other] == [2, 2, 6]


def test_what_is_left_undecided_for_the_same_reason_is_said_to_be_so(first, tmp_path):
    later, _ = run_dry(tmp_path, TWO, FIXTURE, f"epoch = 2030-01-01T00:00:00Z\n{WORLD}")
    (answer,) = judge(open_traced(first), later).answers
    (one,) = answer.members
    two = replace(answer, members=(one, replace(one, effect="another")))
    assert (two.verdict, two.cannot_tell) == ("undecided", True)
    assert not replace(two, members=(one, replace(one, effect="another", expected=9.0))).cannot_tell
