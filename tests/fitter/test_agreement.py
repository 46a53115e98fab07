"""Several sensors of one quantity in use: what they do not agree on is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rig.procedures.evaluate.agreement import compared
from rig.procedures.evaluate.inference import Inference


def inference(values: dict[str, list[float]], *, sd: float = 0.1, df: float = np.inf) -> Inference:
    columns: dict[str, object] = {}
    for name, numbers in values.items():
        columns |= {name: np.array(numbers), f"{name}_sd": np.full(len(numbers), sd)}
    dfs = {name: np.full(len(numbers), df) for name, numbers in values.items()}
    sensors = {name: name.removesuffix("_bath_degC") for name in values}
    return Inference(columns, tuple(columns), ("before",), 0, tuple(values), df=dfs, alike={"bath_degC": sensors})


def test_two_sensors_far_apart_are_named_in_a_column_and_a_note():
    found = compared(inference({"a_bath_degC": [20.0, 20.0, np.nan], "b_bath_degC": [20.1, 21.0, 20.0]}))
    assert found.columns["bath_degC_differ"].tolist() == ["", "a and b differ by 1 degC", ""]
    note, before = found.notes
    assert note.startswith(
        "sensors do not agree on bath_degC in 1 of 3 rows (column bath_degC_differ): a and b differ by up to 1 degC, "
        "7.07 joint standard deviations (limit 2.4)"
    )
    assert (before, found.added[-1]) == ("before", "bath_degC_differ")


def test_what_agrees_says_nothing():
    found = inference({"a_bath_degC": [20.0, 20.0], "b_bath_degC": [20.1, 20.2], "c_bath_degC": [20.0, 20.1]})
    assert compared(found) is found
    few = inference({"a_bath_degC": [20.0], "b_bath_degC": [20.3]}, df=3.0)
    assert compared(few) is few, "2.1 joint standard deviations of 6 degrees of freedom: Student's limit is 2.45"


def test_the_odd_one_of_three_is_in_both_of_its_pairs():
    found = compared(inference({"a_bath_degC": [20.0], "b_bath_degC": [23.0], "c_bath_degC": [20.0]}))
    assert found.columns["bath_degC_differ"].tolist() == ["a and b differ by 3 degC; b and c differ by 3 degC"]


@pytest.mark.parametrize("seed", range(3))
def test_by_chance_few_tables_say_anything(seed):
    random = np.random.default_rng(seed)
    drawn = random.normal(0.0, 0.1, (200, 3, 20))
    tables = [
        inference({f"{s}_bath_degC": list(values) for s, values in zip("abc", one, strict=True)}) for one in drawn
    ]
    assert sum(bool(compared(one) is not one) for one in tables) <= 20, "10 of 200 are expected"


def test_what_one_standard_does_to_both_cancels_and_what_two_do_does_not():
    """With total uncertainties 42 joint standard deviations were called 4.7, and 31 were not told."""
    total = inference({"a_bath_degC": [20.0], "b_bath_degC": [20.5]}, sd=np.hypot(0.05, 0.3))
    assert compared(total) is total, "as if both had errors of their own"
    own = {name: np.array([0.05]) for name in total.quantities}
    shared = {name: np.array([[0.3]]) for name in total.quantities}
    found = compared(replace(total, own_sd=own, shifts=shared, shifts_df=[np.inf]))
    assert "7.07 joint standard deviations" in found.notes[0]
    apart = {"a_bath_degC": np.array([[0.3], [0.0]]), "b_bath_degC": np.array([[0.0], [0.3]])}
    two = replace(total, own_sd=own, shifts=apart, shifts_df=[np.inf, 50.0])
    assert compared(two) is two
