"""World files: what they may say, and how a mistake in one is reported."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from rig.sims.bench import world_for
from rig.sims.physics import WorldError, read_truth, sensor_axes
from rig.sims.physics.pressure_truth import TransducerTruth, ordinary
from rig.sims.physics.truth import SENSORS, SensorTruth
from rig.sims.physics.undeclared import Effects, HeadError

AXES = {"x": "x", "y": "y", "aoa2": "x"}
DOCS = Path(__file__).parents[2] / "docs" / "reference" / "simulation.md"


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
        ("[effects.hysteresis]\nuV = 1", "effects.hysteresis is of pressure transducers, and this bench has none"),
        ("[effects.head_error]\naxis = 'pitch'", r"effects.head_error must be given as tables, each under \[\[eff"),
        ("[[effects.head_error]]\naxis = 'yaw'", r"effects.head_error\[1\].axis must be one of pitch, roll"),
    ],
)
def test_a_mistake_is_named_with_its_place_and_what_would_be_right(text: str, message: str) -> None:
    with pytest.raises(WorldError, match=message):
        read_truth(tomllib.loads(text), AXES)


PRESSURE_AXES = {"bridge_1": "", "bridge_2": ""}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[sensors.bridge_1]\noffset = 1", r"bridge_1.offset is not known; did you mean offset_mV\?"),
        ("[sensors.bridge_1]\noffset_V = 1", "bridge_1.offset_V is not known; did you mean offset_mV"),
        ("[sensors.bridge_3]\noffset_mV = 1", "sensors.bridge_3 is not known; did you mean bridge_"),
        ("[sensors.bridge_1]\nsubplot_mV = -1", "bridge_1.subplot_mV = -1 is outside"),
        ("[sensors_chamber]\ndamping = 1", r"sensors_chamber is not known; did you mean sensor_chamber\?"),
        ("[sensor_chamber]\ndampling = 1", r"dampling is not known; did you mean damping\?"),
        ("[pressure_line]\nleak_s = 1", "pressure_line.leak_s is not known"),
        ("[effects.hysterisis]\nuV = 1", r"effects.hysterisis is not known; did you mean hysteresis\?"),
        ("[effects.carry_over]\npct = {bridge_9 = 1}", "carry_over.pct.bridge_9 is not known; .*bridge_1, bridge_2"),
        ("[effects.isolation_pad]", "effects.isolation_pad is of attitude sensors, and this bench has none"),
    ],
)
def test_a_mistake_about_a_pressure_bench_is_named_too(text: str, message: str) -> None:
    with pytest.raises(WorldError, match=message):
        read_truth(tomllib.loads(text), PRESSURE_AXES)


def test_transducers_that_are_not_described_are_ordinary_and_all_different() -> None:
    truth = read_truth(tomllib.loads("sensors.bridge_2.offset_mV = 0.5"), PRESSURE_AXES)
    assert truth.sensors["bridge_1"] == ordinary(1)
    assert truth.sensors["bridge_2"] == replace(ordinary(2), offset_mV=0.5)
    several = [ordinary(n) for n in range(1, 8)]
    for key in ("offset_mV", "sensitivity_mV_per_psi", "sensitivity_ppm_per_degC", "sse_gain_ppm_per_degC"):
        assert len({getattr(t, key) for t in several}) == 7
    assert all(1.9 <= t.sensitivity_mV_per_psi <= 2.1 for t in several)


def test_a_bench_may_have_sensors_of_both_kinds() -> None:
    values = tomllib.loads("effects.hysteresis.uV = 3\neffects.offset_drift.uV_per_h = { x = 1 }")
    truth = read_truth(values, {"x": "x", "bridge_1": ""})
    assert [type(sensor) for sensor in truth.sensors.values()] == [SensorTruth, TransducerTruth]
    with pytest.raises(WorldError, match=r"attitude sensors on this bench: x\)"):
        read_truth(tomllib.loads("effects.offset_drift.uV_per_h = { bridge_1 = 1 }"), {"x": "x", "bridge_1": ""})


def test_the_world_of_a_bench_of_any_kind_begins_when_its_file_says() -> None:
    bench = {"sensors": {"x": {"axis": "x"}, "bridge_1": {"axis": None}, "bridge_2": {}}}
    assert sensor_axes(bench) == {"x": "x", "bridge_1": "", "bridge_2": ""}
    assert world_for(bench, {"epoch": "2026-01-15T18:00:00Z"}).utc() == 1768500000.0


def test_the_example_of_the_pressure_bench_is_a_valid_world_of_it() -> None:
    example = DOCS.parents[2] / "examples" / "pressure-lab"
    bench, world = (tomllib.loads((example / name).read_text("utf-8")) for name in ("bench.toml", "world.toml"))
    truth = read_truth(world, sensor_axes(bench))
    assert set(truth.sensors) == set(bench["sensors"])
    assert set(truth.effects.third_order_pressure.uV_per_psi3) == set(bench["sensors"])
    assert all(sensor.subplot_mV_per_psi == 0.00135 for sensor in truth.sensors.values())


def test_what_the_example_offers_to_try_is_valid() -> None:
    example = DOCS.parents[2] / "examples" / "pressure-lab"
    bench, world = ((example / name).read_text("utf-8") for name in ("bench.toml", "world.toml"))
    offered = world.split("# More to try")[1].splitlines()[1:]
    read_truth(tomllib.loads("\n".join(line.removeprefix("# ") for line in offered)), sensor_axes(tomllib.loads(bench)))


def test_the_worlds_in_the_reference_are_valid() -> None:
    of_attitude, of_pressure, of_faults = re.findall(r"```toml\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    for block, axes in ((of_attitude, {"x": "x", "y": "y", "z": "z"}), (of_pressure, {"bridge_1": ""})):
        read_truth(tomllib.loads(block), axes)
    assert [table["kind"] for table in tomllib.loads(of_faults)["faults"]]
