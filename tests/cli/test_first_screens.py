"""First screens: many sensors take one screen, `--full` has the rest; a wrong line is shown with the mended one."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command import rig

from rig.bench.config import ConfigurationError, parse_toml
from rig.lab.people import parse_people
from rig.procedures.evaluate.fit_in_short import remarks
from rig.procedures.evaluate.in_short import spanned
from rig.procedures.present.blocks import Grid
from rig.verbs.budget.in_short import of_sensors, what_of

SENSORS = 5


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight whole plots of five transducers."""
    rng = np.random.default_rng(45)
    names = ",".join(f"bridge_{k + 1}_mV" for k in range(SENSORS))
    lines = [f"whole_plot,order,elapsed_s,pressure_psia,sensor_temperature_degC,sse_temperature_degC,{names}"]
    order = 0
    for plot in range(8):
        of_plot = rng.normal(0, 0.01, SENSORS)
        for pressure in (0.01, 0.12, 0.5, 1.0, 2.5, 5.0):
            order += 1
            values = 2.0 * pressure + of_plot + rng.normal(0, 0.002, SENSORS)
            cells = ",".join(f"{value:.6f}" for value in values)
            lines.append(f"{plot + 1},{order},{60 * order},{pressure},{-90 + 5 * plot},{4 * (plot % 3)},{cells}")
    path = tmp_path_factory.mktemp("table") / "night.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_fit_of_many_sensors_is_one_screen_and_full_has_all(table: Path):
    short = rig("fit", table, "--formula", "1 + P")
    full = rig("fit", table, "--formula", "1 + P", "--full")
    assert (short.returncode, full.returncode) == (0, 0), short.stderr
    assert len(short.stdout.splitlines()) <= 45
    assert len(full.stdout.splitlines()) > 100
    assert all(short.stdout.count(f"bridge_{k + 1}_mV") >= 2 for k in range(SENSORS))
    assert "more: --full" in short.stdout
    assert "more: --full" not in full.stdout


def test_remarks_stand_once_and_say_whose_numbers_they_have():
    of = {"a": ["low by 3 V", "odd"], "b": ["low by 4 V"], "c": ["low by 3 V"]}
    assert [one.text for one in remarks(of)] == [  # type: ignore[union-attr]
        "[yellow]all: low by 3 V (numbers of a)[/]",
        "[yellow]a: odd[/]",
    ]


def _budgeted(name: str, expanded: float, influence: str) -> Any:
    first = SimpleNamespace(name=influence, share=0.9)
    more = {"value": 1.0, "unit": "V", "coverage_probability": 0.95, "contributions": (first,)}
    return SimpleNamespace(name=name, expanded_uncertainty=expanded, **more)


def test_a_budget_of_many_sensors_has_a_row_each_with_smallest_and_largest():
    every, sensors = [], []
    for sensor in ("a", "b", "c", "d"):
        every.append(_budgeted(f"{sensor} coefficient 1", 9.0, "scatter"))
        every.append(_budgeted(f"{sensor} inferred force at 1 kN", 0.1, "scatter"))
        every.append(_budgeted(f"{sensor} inferred force at 5 kN", 0.3, "weights: their class"))
        sensors += [f"{sensor}_V"] * 3
    of = SimpleNamespace(stated=SimpleNamespace(what_is_lacking=lambda _: []))
    found: Any = SimpleNamespace(budgets=every, sensors=sensors, of=of, unstated=())
    (grid,) = [one for one in of_sensors(found) if isinstance(one, Grid)]
    assert grid.rows[0] == ("a_V", "inferred force", "0.10 V", "0.30 V", "weights, 90 %")
    assert len(grid.rows) == 4


@pytest.mark.parametrize(
    ("name", "sensor", "what"),
    [
        ("cell_1 inferred force at 5 kN, 23 degC", "cell_1_V", "inferred force"),
        ("coefficient P", "bridge_1_mV", "coefficient P"),
        ("output at 2 kN", "cell_V", "output"),
    ],
)
def test_a_result_is_of_a_sort(name: str, sensor: str, what: str):
    assert what_of(name, sensor) == what


@pytest.mark.parametrize(
    ("text", "mended"),
    [
        ("x = 1\nk = two # hm\n", 'k = "two" # hm'),
        ("a = 1,5\n", "a = 1.5"),
        ("a = [1 2 -3]\n", "a = [1, 2, -3]"),
        ("a = True\n", "a = true"),
        ("a = off\n", "a = false"),
        ('a = "C:\\x"\n', "a = 'C:\\x'"),
        ("[a\nx = 1\n", "[a]"),
        ("a: 3\n", "a = 3"),
        ("; remark\n", "# remark"),
        ("a = \u201cx\u201d\n", 'a = "x"'),
    ],
)
def test_a_wrong_line_is_shown_and_the_mended_one_can_be_read(text: str, mended: str):
    with pytest.raises(ConfigurationError) as found:
        parse_toml(text, "bench.toml")
    number = next(n for n, line in enumerate(text.splitlines(), 1) if f"line {n}: {line}" in str(found.value))
    assert f"write instead: {mended}" in str(found.value)
    lines = text.splitlines()
    assert parse_toml("\n".join([*lines[: number - 1], mended, *lines[number:]]), "bench.toml") is not None


@pytest.mark.parametrize("text", ["a = !\n", "a = 5 # \x1b[31m\nb = two \x07\n", f"a = {'x' * 600}\n"])
def test_a_line_that_nobody_can_mend_is_not_mended(text: str):
    with pytest.raises(ConfigurationError) as found:
        parse_toml(text, "bench.toml")
    assert "write instead" not in str(found.value)
    assert "\x07" not in str(found.value)


def test_no_secret_is_shown():
    with pytest.raises(ConfigurationError) as found:
        parse_toml("token = abc-very-secret\n", "other.toml")
    assert "very-secret" not in str(found.value)
    with pytest.raises(ConfigurationError) as found:
        parse_people("[people.anna]\nname = very-secret\n", "people.toml")
    assert "very-secret" not in str(found.value)


def test_one_smooth_peak_is_told_as_one_shape_and_not_as_many_names(tmp_path: Path) -> None:
    seed = 3
    print("seed", seed)
    x = np.linspace(380.0, 780.0, 61)
    y = 5.0 * np.exp(-(((x - 560.0) / 45.0) ** 2)) + np.random.default_rng(seed).normal(0.0, 0.01, len(x))
    (tmp_path / "peak.csv").write_text("wave_nm,y\n" + "".join(f"{a:.4f},{b:.6f}\n" for a, b in zip(x, y, strict=True)))
    done = rig("trace", "peak.csv", "--response", "y", "--formula", "1 + wave_nm", cwd=tmp_path)
    first = done.stdout.partition("┘")[2]
    assert first.lstrip().startswith("y: no name is sure: one shape over wave_nm"), done.stdout
    assert "to confirm" not in first
    assert (
        "doubtful: "
        in rig("trace", "peak.csv", "--response", "y", "--formula", "1 + wave_nm", "--full", cwd=tmp_path).stdout
    )


def test_notes_of_sensors_that_differ_in_one_number_are_one():
    """Four sensors had four lines about the smallest drift that counts."""
    few = "{} whole plots are few: the smallest drift is about {} Hz over the run"
    found = spanned({few.format(9, 0.34): ["a"], few.format(9, 0.4): ["b"], few.format(9, 0.325): ["c"]})
    assert found == {few.format(9, "0.325 to 0.4"): ["a", "b", "c"]}
    apart = {few.format(9, 0.3): ["a"], few.format(8, 0.4): ["b"], "at -0.3 V": ["a"], "at -0.4 V": ["b"]}
    assert spanned(apart) == apart, "two numbers differ, or a sign would be lost"
    own = {few.format(9, 0.3): ["a"], few.format(9, 0.4): ["a"]}
    assert spanned(own) == own, "both are of one sensor"
