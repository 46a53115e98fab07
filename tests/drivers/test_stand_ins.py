"""A driver without a twin is planned and run dry with a stand-in of its role, and the run says so."""

from __future__ import annotations

import pytest

from rig.bench.config import parse_bench
from rig.bench.plugins import installed
from rig.drivers.roles import Remarking
from rig.errors import ConfigurationError
from rig.runs.forecast import rehearse
from rig.runs.plans import plan_of
from rig.simulated import dry_run, stand_ins

BENCH = """name = "lab"
[instruments.meter]
driver = "scpi-meter"
address = "visa://GPIB0::22::INSTR"
model = "M1"
reading_s = 0.1
[instruments.calibrator]
driver = "scpi-source"
address = "visa://GPIB0::4::INSTR"
model = "S1"
low = -10
high = 10
set = "VOLT {value}"
setpoint = "VOLT?"
on = "OUTP ON"
off = "OUTP OFF"
output = "OUTP?"
[sensors.dmm]
reader = "meter"
[factors]
volts_V = "calibrator"
[limits]
volts_V = [-10, 10]
"""
PROCEDURE = """kind = "general"
name = "voltmeter"
seed = 1
replications = 1
[factors.volts_V]
levels = [-5, 5]
[settle]
dwell_s = 2
[measure]
readings = 3
[model]
formula = "1 + volts_V"
"""


@pytest.fixture
def without_twins(monkeypatch):
    """Of these drivers only the drivers are installed."""

    def some(group: str) -> list[str]:
        lost = ("scpi-meter", "scpi-source", "newport-esp301") if group == "rig.twins" else ()
        return [name for name in installed(group) if name not in lost]

    monkeypatch.setattr(stand_ins, "installed", some)
    monkeypatch.setattr(dry_run, "installed", some)
    dry_run.twin_class.cache_clear()
    yield
    dry_run.twin_class.cache_clear()


def test_it_is_planned_and_run(without_twins):
    plan = plan_of({"bench.toml": BENCH, "procedure.toml": PROCEDURE}, dry=False)
    assert rehearse(plan, lambda news: None).rehearsed == 2


def test_it_says_that_it_is_a_stand_in(without_twins):
    dry = dry_run.DryBench(parse_bench(BENCH, "bench"), {})
    try:
        from rig.bench.bench_file import check_options  # noqa: PLC0415
        from rig.instruments.opening import open_bench  # noqa: PLC0415

        bench = open_bench(dry.config, check_options(dry.config, "bench"), dry.clock, dry.wires)
        for instrument in bench.instruments.values():
            assert isinstance(instrument, Remarking)
            assert "lines are not those of the instrument" in instrument.remarks()[0]
            instrument.identify()
            instrument.prepare()
    finally:
        dry.close()


def test_a_head_needs_its_twin(without_twins):
    text = BENCH.replace('driver = "scpi-meter"', 'driver = "newport-esp301"').replace(
        'model = "M1"\nreading_s = 0.1\n', ""
    )
    with pytest.raises(ConfigurationError, match="only readers and sources have stand-ins"):
        dry_run.DryBench(parse_bench(text, "bench"), {})
