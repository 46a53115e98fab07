"""A laboratory's history as a declared prior: of names that data cannot tell apart, the likelier one is reported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import proving.strangers
import rig
from proving.strangers.runs import made_of
from proving.strangers.sets import load
from proving.truth.whole_plot_hidden import hide
from rig.effects import laboratory_effects
from rig.errors import ConfigurationError
from rig.procedures.evaluate.catalogue import with_own
from rig.procedures.pressure.effects import PRESSURE_CATALOGUE
from rig.procedures.pressure.effects.scene import PressureEffect
from rig.procedures.pressure.trace import trace_whole_plots

STRANGER = Path(proving.strangers.__file__).parent / "fifteenth"


def of_a_table(kind: str, cause: str, tmp_path: Path) -> tuple[str, str]:
    """The first name, and why it is doubtful."""
    made = made_of(load(STRANGER), kind, (cause,), seed=1, size=2.0)
    (tmp_path / "table.csv").write_text(made.csv)
    options = {key[2:]: value for key, value in zip(made.options[::2], made.options[1::2], strict=True)}
    sensors = rig.open(tmp_path / "table.csv").trace(**options).to_json()["sensors"]
    effect = next(iter(sensors.values()))["effects"][0]
    return effect["effect"], effect["doubtful"] or ""


def of_attitude_sensors(tmp_path: Path) -> tuple[str, str]:
    return of_a_table("attitude", "axes_skew", tmp_path)


def of_any_table(tmp_path: Path) -> tuple[str, str]:
    return of_a_table("general", "stuck_start", tmp_path)


def of_transducers(tmp_path: Path) -> tuple[str, str]:
    hidden = hide(["sensor cubed"], [2.5], seed=5, transducers=1)
    catalogue = with_own(PRESSURE_CATALOGUE, laboratory_effects(), PressureEffect)
    (found,) = trace_whole_plots(hidden.data, hidden.model, catalogue, validate=False).sensors.values()
    return found.effects[0].effect, found.effects[0].doubtful or ""


KINDS = [
    (of_attitude_sensors, "axes-not-square", "magnetic-heading"),
    (of_transducers, "sensor-temperature-third-order", "sensor-by-sse-squared"),
    (of_any_table, "kink:torque_Nm", "clip:torque_Nm"),
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
