"""World files: what they may say, and how a mistake in one is reported."""

import tomllib
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from sims.physics import WorldError, read_truth
from sims.physics.truth import SENSORS, SensorTruth, Truth
from sims.physics.undeclared import Effects, HeadError

AXES = {"x": "x", "y": "y", "aoa2": "x"}
DOCS = Path(__file__).parents[1] / "docs" / "worlds.md"


def test_nothing_said_is_a_world_without_surprises() -> None:
    truth = read_truth({}, AXES)
    assert truth.effects == Effects()
    assert truth.sensors == {"x": SENSORS["x"], "y": SENSORS["y"], "aoa2": SENSORS["x"]}
    assert truth.epoch is None


def test_what_is_said_replaces_what_is_usual() -> None:
    values = tomllib.loads("""
        seed = 7
        epoch = 2026-01-15T18:00:00Z
        [sensors.x]
        offset_V = 0.5
        [effects.isolation_pad]
        pitch_compliance_deg_per_g = 1.5e-3
        [effects.offset_temperature]
        uV_per_degC = { x = 40, aoa2 = -3 }
        [[effects.head_error]]
        axis = "roll"
        amplitude_arcsec = 2
        """)
    truth = read_truth(values, AXES)
    assert (truth.seed, truth.epoch) == (7, 1768500000.0)
    assert truth.sensors["x"].offset_V == 0.5
    assert truth.sensors["x"].sensitivity_V_per_g == SENSORS["x"].sensitivity_V_per_g
    assert truth.effects.isolation_pad.pitch_compliance_deg_per_g == 1.5e-3
    assert truth.effects.offset_temperature.uV_per_degC == {"x": 40.0, "aoa2": -3.0}
    assert truth.effects.head_error == (HeadError("roll", 2.0, 1.0, 0.0),)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sed = 1", r"sed is not known; did you mean seed\? \(known: seed, epoch, sensors"),
        ("seed = -1", "seed must be a whole number"),
        ("seed = 1.5", "seed must be a whole number"),
        ("epoch = 12", "epoch must be a date and time like"),
        ("[lab]\nmean = 3", r"lab.mean is not known; did you mean mean_degC\?"),
        ("[lab]\nmean_degC = 'warm'", "lab.mean_degC must be a number"),
        ("[lab]\nmean_degC = true", "lab.mean_degC must be a number"),
        ("[lab]\nmean_degC = 900", "lab.mean_degC = 900 is outside -50 to 60"),
        ("[lab]\nmean_degC = nan", "lab.mean_degC must be a number"),
        ("lab = 3", r"lab must be a table, \[lab\]"),
        ("[enclosure]\nstart_controlled = 1", "start_controlled must be true or false"),
        ("[sensors.z]\noffset_V = 0", r"sensors.z is not known .*on this bench: x, y, aoa2"),
        ("[sensors.x]\ngain = 0", r"sensors.x.gain is not known .*sensitivity_V_per_g"),
        ("[effects.pad]", r"effects.pad is not known.*isolation_pad"),
        ("[effects.offset_drift]\nuV_per_h = {q = 1}", r"effects.offset_drift.uV_per_h.q is not known .*x, y, aoa2"),
        ("[effects.head_error]\naxis = 'pitch'", r"effects.head_error must be given as tables, each under \[\[eff"),
        ("[[effects.head_error]]\naxis = 'yaw'", r"effects.head_error\[1\].axis must be one of pitch, roll"),
    ],
)
def test_a_mistake_is_named_with_its_place_and_what_would_be_right(text: str, message: str) -> None:
    with pytest.raises(WorldError, match=message):
        read_truth(tomllib.loads(text), AXES)


def keys(table: Any) -> set[str]:
    found = set()
    for field in fields(table):
        value = getattr(table, field.name)
        found |= {field.name} | (keys(value) if is_dataclass(value) else set())
    return found


def test_the_reference_explains_every_key() -> None:
    text = DOCS.read_text(encoding="utf-8")
    known = keys(Truth()) | keys(SensorTruth()) | keys(HeadError())
    assert (
        sorted(name for name in known if not any(form in text for form in (f"`{name}`", f"{name}]", f"[{name}."))) == []
    )


def test_the_worlds_in_the_reference_are_valid() -> None:
    blocks = DOCS.read_text(encoding="utf-8").split("```toml\n")[1:]
    assert blocks
    for block in blocks:
        read_truth(tomllib.loads(block.split("```")[0]), {"x": "x", "y": "y", "z": "z"})
