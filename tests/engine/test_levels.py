"""Levels in the unit of a standard, of a source that is set in another: a valve in V, and levels in kg/min.

The first setting comes from a table of approach, and is corrected until the standard reads the level.
"""

from __future__ import annotations

import numpy as np
import pytest
from command import rig
from test_set_in import BENCH, PROCEDURE, WORLD

from rig.bench.approach import Approach
from rig.bench.config import parse_bench
from rig.engine.axes import AxisReading
from rig.engine.steered import Steered
from rig.engine.steering import _next
from rig.errors import ConfigurationError
from rig.procedures.plan.run_list import Factor
from rig.run_file.read.reader import RunReader
from rig.tables.table_of_run import run_table

TABLE = "approach = [[0, 0], [2, 0.95], [5, 2.2], [10, 3.8]]"
BENCH = BENCH.replace('of = "valve_V"', f'of = "valve_V"\n{TABLE}').replace(
    "[limits]", "[limits]\nvalve_V = [0, 10]", 1
)
BENCH = BENCH.replace("\nvalve_V = [0, 10]\nvalve_V = [0, 10]", "\nvalve_V = [0, 10]")
LEVELS = [0.5, 1, 1.5, 2, 2.5, 3, 3.5]
IN_VOLTS = PROCEDURE
PROCEDURE = (
    PROCEDURE.replace("[factors.valve_V]", "[factors.flow_kg_per_min]")
    .replace("[1, 2.5, 4, 5.5, 7, 8.5, 10]", f"{LEVELS}")
    .replace("180*valve_V/2", "180*flow_kg_per_min")
    .replace("replications = 3", "replications = 2")
)
WORLD = WORLD.replace("0.012*valve_V^2", "0.012*valve_V^2 + 0.01*valve_side")
"""The valve has a hysteresis, and the table is off by up to 0.04 kg/min."""
NEAR = 0.015


def at(folder, bench=BENCH, procedure=PROCEDURE, world=WORLD):
    for file, text in (("bench.toml", bench), ("procedure.toml", procedure), ("world.toml", world)):
        (folder / file).write_text(text)
    return folder


def run_in(folder):
    return rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", cwd=folder)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = at(tmp_path_factory.mktemp("levels"))
    done = run_in(folder)
    assert done.returncode == 0, done.stderr
    assert "flagged overshot; a setting had gone beyond its level" in " ".join(done.stderr.split())
    (path,) = folder.glob("**/*.sqlite")
    return path


@pytest.fixture(scope="module")
def seen(path):
    with RunReader.open(path) as reader:
        return [record.data for record in reader.records("observation")]


def test_plan_says_the_first_setting_of_every_level(path):
    told = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=path.parent.parent)
    assert told.returncode == 0, told.stderr
    flat = " ".join(told.stdout.split())
    assert "until its standard reads the level within 0.015 kg/min: 0.5 at 1.053, 1 at 2.12, 1.5 at 3.32" in flat
    assert "beyond the table of approach" not in flat
    assert "no precision is predicted" not in flat, "levels of the flow are known before"


def test_the_standard_reads_every_level_in_the_end(path):
    columns = run_table(path).columns
    assert sorted(set(columns["flow_set_kg_per_min"].tolist())) == LEVELS
    np.testing.assert_allclose(columns["flow_kg_per_min"], columns["flow_set_kg_per_min"], atol=NEAR)
    volts, side = columns["valve_set_V"], columns["flow_side"]
    np.testing.assert_allclose(columns["flow_kg_per_min"], 0.5 * volts - 0.012 * volts**2 + 0.01 * side, atol=0.012)
    np.testing.assert_allclose(columns["valve_readback_V"], volts, atol=0.002)
    assert len(set(volts.tolist())) > len(LEVELS), "other settings on the way down"
    assert np.all(columns["flow_from_kg_per_min"][1:] != columns["flow_set_kg_per_min"][1:])


def test_every_setting_and_what_was_read_there_are_in_the_run_file(seen):
    tries = [one["steered"]["flow_kg_per_min"]["tries"] for one in seen]
    assert all(
        abs(each[-1][1] - data["readback"]["flow_kg_per_min"]) <= NEAR + 0.003
        for each, data in zip(tries, seen, strict=True)
    )
    assert max(map(len, tries)) in {2, 3}
    first, second = tries[: len(tries) // 2], tries[len(tries) // 2 :]
    assert sum(map(len, second)) < sum(map(len, first)), "what was corrected once is known"


def test_each_level_is_approached_from_its_side_and_what_went_beyond_is_flagged(path, seen):
    sides = run_table(path).columns["flow_side"].tolist()
    for side, data in zip(sides, seen, strict=True):
        steered = data["steered"]["flow_kg_per_min"]
        level, tries = data["references"]["flow_kg_per_min"]["mean"], steered["tries"]
        level = min(LEVELS, key=lambda one, level=level: abs(one - level))
        beyond = [reading for _, reading in tries[:-1] if side * (reading - level) > 0]
        assert bool(beyond) == ("overshot" in data["flags"]) == steered.get("overshot", False)
        if side:
            assert data["approach"]["flow"][0] == side
    verified = rig("verify", path)
    assert verified.returncode == 0, verified.stdout


def test_models_are_fitted_in_what_was_read(path):
    told = rig("fit", path).stdout
    assert "its setting had gone beyond the level and was approached again, from the planned side" in " ".join(
        told.split()
    )
    assert "flow_kg_per_min^2" in told


def test_a_level_that_is_not_reached_is_skipped_and_said(tmp_path):
    world = WORLD.replace("0.5*valve_V - 0.012*valve_V^2 + 0.01*valve_side", "min(0.5*valve_V - 0.012*valve_V^2, 3.2)")
    procedure = PROCEDURE.replace("replications = 2", "replications = 1").replace(f"{LEVELS}", "[1, 2, 3, 3.5]")
    done = run_in(at(tmp_path, world=world, procedure=procedure))
    told = " ".join((done.stdout + done.stderr).split())
    assert "flow does not reach 3.5 kg/min within 0.0125: its standard reads 3.2" in told
    assert "outside 0 to 10. Look at the supply and at the table of approach of references.flow_kg_per_min" in told
    (path,) = tmp_path.glob("**/*.sqlite")
    assert sorted(set(run_table(path).columns["flow_set_kg_per_min"].tolist())) == [1, 2, 3]


def test_a_standard_that_scatters_more_than_is_asked_is_said(tmp_path):
    world = WORLD.replace("noise = 0.0002", "noise = 0.2")
    procedure = PROCEDURE.replace("replications = 2", "replications = 1").replace(f"{LEVELS}", "[1, 2, 3]")
    procedure = procedure.replace('order = "up-down"', 'order = "up-down"\nnear = 0.0005')
    done = run_in(at(tmp_path, world=world, procedure=procedure))
    assert done.returncode != 0
    assert "after 8 settings" in done.stderr
    assert "if the readings scatter, widen `near` of factors.flow_kg_per_min" in " ".join(done.stderr.split())


def test_levels_in_volts_are_as_before(tmp_path):
    told = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=at(tmp_path, procedure=IN_VOLTS))
    assert told.returncode == 0, told.stderr
    assert "first as in its table of approach" not in told.stdout


@pytest.mark.parametrize(
    ("bench", "procedure", "says"),
    [
        (
            (f"\n{TABLE}", ""),
            ("", ""),
            "flow_kg_per_min is read, and set by valve_V: give levels of valve_V, or pairs of",
        ),
        (("[10, 3.8]]", "[10, 3.8], [9, 4]]"), ("", ""), "readings only rise, or only fall, with it"),
        (
            ("valve_V = [0, 10]", "valve_V = [0, 8]"),
            ("", ""),
            "= 3.5 takes 9.062 V by references.flow_kg_per_min.approach",
        ),
        (
            ("", ""),
            ('order = "up-down"', 'order = "up-down"\nhard = true'),
            "it is hard to change; give levels of valve_V",
        ),
    ],
)
def test_what_cannot_be_brought_to_levels_is_said_by_plan(tmp_path, bench, procedure, says):
    folder = at(tmp_path, bench=BENCH.replace(*bench), procedure=PROCEDURE.replace(*procedure))
    told = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=folder)
    assert told.returncode == 78
    assert says in " ".join(told.stderr.split())


def test_a_table_of_approach_needs_its_factor():
    with pytest.raises(ConfigurationError, match="approach needs `of`, the factor whose settings it has"):
        parse_bench(BENCH.replace('of = "valve_V"\n', ""), "bench.toml")


def test_levels_beyond_the_table_are_said(tmp_path):
    folder = at(tmp_path, bench=BENCH.replace("[10, 3.8]]", "[8, 3.2]]"))
    told = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=folder)
    assert "flow_kg_per_min = 3.5 is beyond the table of approach: the first setting goes on" in " ".join(
        told.stdout.split()
    )


@pytest.mark.parametrize("readings", [(0.0, 0.95, 2.2, 3.8), (9.0, 8.0, 4.0, 1.0)])
def test_a_table_is_read_both_ways_between_its_pairs_and_beyond(readings):
    table = Approach.of(list(zip((0.0, 2.0, 5.0, 10.0), readings, strict=True))[::-1])
    for setting in (-1.0, 0.0, 1.0, 2.0, 7.0, 12.0):
        assert table.setting(table.reading(setting)) == pytest.approx(setting)
    assert not table.covers(readings[0] * 1.1 + (1.0 if readings[0] else -1.0))


class Valve:
    """A source's axis."""

    def __init__(self):
        self.volts = 0.0

    def span(self):
        return {"valve": (0.0, 10.0)}

    def read(self):
        return {"valve": AxisReading("valve_V", self.volts, False, True, True, "", drive=False, margin=0.1)}

    def go(self, targets):
        self.volts = targets["valve"]


def test_the_axis_is_at_its_level_at_the_last_setting_for_it_and_moves_as_the_table_says():
    valve, table = Valve(), Approach.of([[0, 0], [10, 5]])
    one = Steered(valve, Factor("valve_V", "valve"), Factor("flow_kg_per_min", "flow"), table, 0.0)
    assert one.span() == {"flow": (0.0, 5.0)}
    one.go({"flow": 2.0})
    assert valve.volts == 4.0
    one.learn(4.0, 2.1)
    one.correct(2.0, 3.7)
    one.go({"flow": 2.0})
    assert (valve.volts, one.read()["flow"].value) == (3.7, 2.0)
    assert one.read()["flow"].margin == pytest.approx(0.05)
    valve.volts = 3.9
    assert one.read()["flow"].value == pytest.approx(2.1)
    one.go({"flow": 3.0})
    assert valve.volts == pytest.approx(5.8), "the table's error at the last level is known"


def test_settings_are_corrected_by_secants_unless_these_do_not_tell():
    assert _next([(4.0, 2.2)], 2.0, 0.5) == pytest.approx(3.6)
    assert _next([(4.0, 2.2), (3.6, 1.9)], 2.0, 0.5) == pytest.approx(3.6 + 0.1 / 0.75)
    assert _next([(4.0, 2.2), (3.6, 2.21)], 2.0, 0.5) == pytest.approx(3.6 - 0.21 / 0.5), "of the other sign: noise"
