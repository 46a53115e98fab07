"""A laboratory's history as a declared prior: of names that data cannot tell apart, the likelier one is reported."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import rig
from proving.statistics.attitude import GRID
from proving.truth import table
from proving.truth.attitude import simulate
from proving.truth.attitude_hidden import sized
from proving.truth.table import Lab
from proving.truth.whole_plot_hidden import hide
from rig.effects import laboratory_effects
from rig.errors import ConfigurationError
from rig.procedures.attitude.effects.catalogue import CATALOGUE
from rig.procedures.attitude.effects.effect import Effect
from rig.procedures.attitude.trace import trace
from rig.procedures.evaluate.catalogue import with_own
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.effects.scene import PressureEffect
from rig.procedures.pressure.trace import trace_whole_plots


def of_attitude_sensors(_: Path) -> tuple[str, str]:
    """The first name, and why it is doubtful."""
    data = simulate(sized("square axes", 2.0, GRID), GRID, 1)[0]
    catalogue = with_own(CATALOGUE, laboratory_effects(), Effect)
    one = replace(data, outputs={"y_V": data.outputs["y_V"]})
    (found,) = trace(one, catalogue, validate=False).sensors.values()
    return found.effects[0].effect, found.effects[0].doubtful or ""


def of_any_table(tmp_path: Path) -> tuple[str, str]:
    lab = Lab(60, clock=True)
    columns = table.simulate(lab, 1, table.MISSING["drift"].at(1.5))
    with (tmp_path / "table.csv").open("w", newline="") as file:
        csv.writer(file).writerows([list(columns), *zip(*columns.values(), strict=True)])
    (sensor,) = rig.open(tmp_path / "table.csv").trace(**table.options(lab)).to_json()["sensors"].values()
    return sensor["effects"][0]["effect"], sensor["effects"][0]["doubtful"] or ""


def of_transducers(tmp_path: Path) -> tuple[str, str]:
    hidden = hide(["sensor cubed"], [2.5], seed=5, transducers=1)
    catalogue = with_own(PRESSURE_CATALOGUE, laboratory_effects(), PressureEffect)
    (found,) = trace_whole_plots(hidden.data, hidden.model, catalogue, validate=False).sensors.values()
    return found.effects[0].effect, found.effects[0].doubtful or ""


KINDS = [
    (of_attitude_sensors, "axes-not-square", "magnetic-heading"),
    (of_transducers, "sensor-temperature-third-order", "sensor-by-sse-squared"),
    (of_any_table, "drift:t_s", "ageing:t_s"),
]


def declare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, count: int) -> None:
    file = tmp_path / "effects.toml"
    file.write_text(f'[history]\ncalibrations = 20\nconfirmed = {{ "{name}" = {count} }}\n')
    monkeypatch.setenv("RIG_EFFECTS", str(file))


@pytest.mark.parametrize(("traced", "first", "other"), KINDS)
def test_a_name_that_the_laboratory_found_often_leads_and_is_doubtful(
    traced: Callable[[Path], tuple[str, str]], first: str, other: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert traced(tmp_path) == (first, "")
    declare(tmp_path, monkeypatch, other, 18)
    assert traced(tmp_path) == (
        other,
        f"these data alone would name {first}: the laboratory's history decides, 18 of 20 calibrations with {other} "
        f"and 0 with {first}",
    )
    declare(tmp_path, monkeypatch, first, 18)
    assert traced(tmp_path) == (first, "")


def test_a_history_makes_no_name_where_data_exclude_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    declare(tmp_path, monkeypatch, "gear-pitch", 20)
    assert of_attitude_sensors(tmp_path) == ("axes-not-square", "")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[history]\ncalibrations = 20\n", "calibrations, a number, and confirmed"),
        ("[history]\ncalibrations = 0\nconfirmed = {}\n", "a number from 1 on"),
        ("[history]\ncalibrations = 3\nconfirmed = { leak = 4 }\n", "leak was confirmed in 0 to 3 calibrations, not 4"),
        ("[history]\ncalibrations = 3\nconfirmed = { leek = 1 }\n", "leek is in no catalogue"),
        ("[history]\ncalibrations = true\nconfirmed = {}\n", "a number from 1 on"),
    ],
)
def test_what_is_wrong_with_a_history_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, says: str
) -> None:
    (tmp_path / "effects.toml").write_text(text)
    monkeypatch.setenv("RIG_EFFECTS", str(tmp_path / "effects.toml"))
    with pytest.raises(ConfigurationError, match=says):
        laboratory_effects()
