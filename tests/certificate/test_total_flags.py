"""Flags of total uncertainty: an angle moved too far for the first order, and a value without any uncertainty."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from command import rig
from test_total_in_use import DATA, EXAMPLES

from rig.procedures.evaluate.inference import Inference
from rig.verbs.infer import csv_reader, infer, read_calibration
from rig.verbs.infer.total import KeptBudget, KeptInfluence, with_total

FAR, BLANK = "propagation to first order fails", "an influence leaves no value, so no uncertainty is known"


def inferred(values, turns=None, flags=None, sd=0.5):
    """Quantities with an sd; each has its own column of flags if there are several."""
    columns = {}
    for q, numbers in values.items():
        value = np.asarray(numbers, float)
        of = np.where(np.isfinite(value), sd, np.nan)
        columns |= {q: value, f"{q}_sd": of, f"{q}_lo95": value - 2 * of, f"{q}_hi95": value + 2 * of}
        columns[(flags or {}).get(q, "flag")] = np.full(len(value), "", dtype=object)
    n = len(value)
    df = {q: np.full(n, 1e9) for q in values}
    more = {"turns": dict.fromkeys(values, turns)} if turns else {}
    return Inference(
        columns, tuple(columns), (), 0, tuple(values), df=df, **more, **({"flags": flags} if flags else {})
    )


def totalled(values, influences, **more):
    """With influences, each a list of modes, each of which moves quantities up, and as far down, by (n,) numbers."""
    modes = [[{q: np.asarray(one, float) for q, one in mode.items()} for mode in modes] for modes in influences]
    kept = tuple(
        KeptInfluence(f"i{k}", inf, tuple((mode, {q: -v for q, v in mode.items()}) for mode in each), {})
        for k, each in enumerate(modes)
    )
    found = inferred(values, **more)
    kind = SimpleNamespace(with_coefficients=lambda _calibration, coefficients: coefficients)

    def moved(by, _read, _other):
        turn = more.get("turns") or inf
        places = {q: np.asarray(v, float) + by.get(q, 0.0) for q, v in values.items()}
        return inferred({q: v if turn == inf else (v + 180.0) % turn - 180.0 for q, v in places.items()}, **more)

    return with_total(found, KeptBudget("r", False, kept, ()), kind, None, moved, None, None, same_meter=False)


@pytest.mark.parametrize("at", [20.0, 179.0])
def test_an_angle_that_is_moved_by_more_than_30_deg_has_a_flag(at):
    found = totalled({"roll_deg": [at] * 3}, [[{"roll_deg": [5.0, 29.9, 30.1]}]], turns=360.0)
    assert found.columns["roll_deg_sd"].round(1).tolist() == [5.0, 29.9, 30.1]
    assert [FAR in flag for flag in found.columns["flag"]] == [False, False, True]
    assert found.flagged == 1


def test_many_influences_that_are_too_large_only_together_have_one_too():
    modes = [[{"roll_deg": [12.0, 22.0]}], [{"roll_deg": [12.0, 22.0]}]]
    for influences in (modes, [[*modes[0], *modes[1]]]):
        found = totalled({"roll_deg": [20.0, 20.0]}, influences, turns=360.0)
        assert found.columns["roll_deg_sd"].round(1).tolist() == [17.0, 31.1]
        assert [FAR in flag for flag in found.columns["flag"]] == [False, True]


def test_a_quantity_that_is_no_angle_may_move_as_far_as_it_likes():
    found = totalled({"p_psia": [20.0]}, [[{"p_psia": [500.0]}]])
    assert (found.columns["flag"].tolist(), found.flagged) == ([""], 0)


@pytest.mark.parametrize("several", [False, True], ids=["one mode", "several modes"])
@pytest.mark.parametrize("rows", [1, 2], ids=["the only row", "one of two"])
def test_a_value_that_an_influence_leaves_without_has_no_uncertainty_and_says_so(several, rows):
    """Its repeatability is not its total uncertainty, and neither is 0."""
    gone = {"p_psia": [np.nan, 0.3][:rows]}
    found = totalled({"p_psia": [20.0, 30.0][:rows]}, [[gone, {"p_psia": [0.1] * rows}] if several else [gone]])
    sd, low, high = (found.columns[f"p_psia{end}"] for end in ("_sd", "_lo95", "_hi95"))
    assert np.isnan([sd[0], low[0], high[0]]).all()
    assert BLANK in found.columns["flag"][0]
    assert found.flagged == 1
    if rows == 2:
        assert sd[1] > 0.5
        assert found.columns["flag"][1] == ""


def test_each_of_several_columns_of_flags_has_those_of_its_quantity():
    """Nothing was said with several transducers: uncertainty was blanked without a word."""
    flags = {"a_psia": "a_psia_flag", "b_psia": "b_psia_flag"}
    moved = {"a_psia": [np.nan, 0.1, 0.1], "b_psia": [0.1, np.nan, 0.1]}
    found = totalled({"a_psia": [1.0, 2.0, 3.0], "b_psia": [1.0, 2.0, 3.0]}, [[moved]], flags=flags)
    assert [BLANK in flag for flag in found.columns["a_psia_flag"]] == [True, False, False]
    assert [BLANK in flag for flag in found.columns["b_psia_flag"]] == [False, True, False]
    assert found.flagged == 2
    assert np.isnan(found.columns["a_psia_sd"]).tolist() == [True, False, False]


def test_what_had_no_value_before_has_no_further_flag():
    found = totalled({"a_psia": [np.nan]}, [[{"a_psia": [0.1]}]])
    assert (found.columns["flag"].tolist(), found.flagged) == ([""], 0)


def test_two_transducers_in_use_have_flags_of_their_own(tmp_path):
    """With the slope of one taken to zero on one side of an influence: no pressure has that output then."""
    run, file, readings = DATA / "pressure-20261121.sqlite", tmp_path / "c.json", tmp_path / "r.csv"
    register = EXAMPLES / "pressure-lab" / "equipment.toml"
    done = rig("fit", run, "--equipment", register, "--formula", "1 + P", "--out", file)
    assert done.returncode == 0, done.stderr
    readings.write_text("bridge_1_mV,bridge_2_mV,sensor_temperature_degC,sse_temperature_degC\n3,3,-90,0.05\n")
    kept = read_calibration(file)
    first, *others = kept.budget.influences
    (up, down), *more = first.modes
    flat = np.array(up["bridge_1_mV"])
    flat[1] = 0.0
    broken = replace(first, modes=(({**up, "bridge_1_mV": flat}, down), *more))
    options = kept.kind.infer_options()
    whole = infer(kept, csv_reader(readings), options)
    found = infer(
        replace(kept, budget=replace(kept.budget, influences=(broken, *others))), csv_reader(readings), options
    )
    assert BLANK in found.columns["bridge_1_pressure_psia_flag"][0]
    assert BLANK not in found.columns["bridge_2_pressure_psia_flag"][0]
    assert np.isnan(found.columns["bridge_1_pressure_psia_sd"][0])
    assert found.columns["bridge_2_pressure_psia_sd"][0] == whole.columns["bridge_2_pressure_psia_sd"][0] > 0
    assert (whole.flagged, found.flagged) == (0, 1)
