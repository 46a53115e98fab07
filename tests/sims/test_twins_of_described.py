"""Twins of instruments that the bench file describes: identities, compound questions, chambers that say little."""

from __future__ import annotations

import json
import re

import pytest
from command import rig
from test_scpi_described import METER, SOURCE, Bench

from rig.drivers.roles import Identity
from rig.sims.identity import fitting

PATTERNS = [
    r"KEITHLEY INSTRUMENTS INC\.,MODEL 2400,.*,.*",
    r"FLUKE,(5500A|5520A),\d+,.+",
    r"(?i)hewlett-packard,34401a,0,\d+-\d+-\d+",
    r"Keysight Technologies,34461A,MY\d{8},A\.\d\d\.\d\d-.*",
    r"LSCI,MODEL336,[A-Z0-9]+/[A-Z0-9]+,\d\.\d",
    r"ISOTECH,TTI-\d+,[^,]+,[^,]*",
    r"(HEWLETT-PACKARD|Agilent)[^,]*,34970A,.*",
    r".*5500A.*",
    r"\S+ \S+",
    r"(A|B)\1x{3,5}",
]


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("table", [METER, SOURCE], ids=["meter", "source"])
def test_the_twin_answers_an_identity_that_fits_the_pattern(table, pattern):
    it = Bench({key: one for key, one in table.items() if key != "model"} | {"identity": pattern})
    try:
        found = it.it.identify()
    finally:
        it.dry.close()
    assert isinstance(found, Identity)
    assert re.fullmatch(pattern, fitting(pattern, "SN123456"))


@pytest.mark.parametrize(
    ("pattern", "told"),
    [
        (PATTERNS[0], "KEITHLEY INSTRUMENTS INC.,MODEL 2400,SN123456,simulated"),
        ("STRANGER,.*", "STRANGER,SIMULATED,SN123456,simulated"),
        (PATTERNS[1], "FLUKE,5500A,123456,simulated"),
    ],
)
def test_it_is_marked_as_simulated_where_the_pattern_allows_it(pattern, told):
    assert fitting(pattern, "SN123456") == told


def test_a_pattern_that_no_text_fits_is_none():
    assert fitting(r"(?!)", "SN1") is None


@pytest.mark.parametrize(
    "given",
    [
        {"fetch": ":FETC?;:STAT:QUES:COND?", "number": "{number};*"},
        {"fetch": ":STAT?;:FETC?;:TEMP?", "number": "*;{number};*"},
        {"fetch": ":READ?;:STAT?", "number": "{number};*", "start": None, "abort": None},
        {"fetch": ":READ?;:STAT?", "number": "{number};*", "start": None, "abort": None, "numbered": False},
    ],
)
def test_a_compound_fetch_is_one_question_for_the_twin(given):
    it = Bench({key: one for key, one in (METER | given).items() if one is not None})
    try:
        it.it.prepare()
        it.it.start(2)
        (read,) = it.it.fetch().values()
    finally:
        it.dry.close()
    assert len(read) == 2
    assert all(0.3 < value < 0.4 for value in read)
    assert any(line.startswith(given["fetch"]) for line in it.sent)


def test_the_twin_answers_every_part_of_a_compound_question_as_the_instrument_would():
    it = Bench(SOURCE | {"read": "MEAS:VOLT?;CURR?", "number": "{number};*", "setpoint": "VOLT?;CURR?"})
    try:
        it.it.prepare()
        it.it.set(3.0)
        assert it.it.read().setpoint == 3.0
    finally:
        it.dry.close()
    it = Bench(SOURCE | {"check": {"FUNC?;RANG?": "VOLT;20"}})
    try:
        it.it.prepare()
        assert it.it.wrong() == ()
    finally:
        it.dry.close()


CHAMBER = """name = "a chamber"
[instruments.chamber]
driver = "scpi-source"
address = "socket://192.0.2.32:5025"
identity = "WEISS,C180,.*"
unit = "degC"
low = 0
high = 60
set = "TEMP {value}"
decimals = 2
readback = 0.01
setpoint = "TEMP?"
read = "READ?"
on = "OUTP ON"
off = "OUTP OFF"
output = "OUTP?"
tolerance = 0.01
[instruments.thermo]
driver = "scpi-meter"
address = "socket://192.0.2.34:5025"
identity = "FLUKE,1502A,.*"
unit = "degC"
reading_s = 1
[sensors.probe]
reader = "thermo"
unit = "degC"
[factors]
chamber_degC = "chamber"
[limits]
chamber_degC = [5, 50]
"""
PROCEDURE = """kind = "general"
name = "a probe"
seed = 3
replications = 1
[factors.chamber_degC]
levels = [10, 25, 40]
band = 0.01
[settle]
dwell_s = 10
[measure]
readings = 2
[model]
formula = "1 + chamber_degC"
"""


@pytest.fixture
def files(tmp_path):
    (tmp_path / "bench.toml").write_text(CHAMBER)
    (tmp_path / "procedure.toml").write_text(PROCEDURE)
    return tmp_path


def test_a_chamber_without_a_time_constant_that_never_settles_in_time_is_said_and_is_no_defect(files):
    done = rig("plan", files / "procedure.toml", "--bench", files / "bench.toml")
    assert done.returncode == 1
    said = " ".join(done.stderr.split())
    assert "3 of 3 rehearsed points could not be measured on simulated instruments: moving took longer" in said
    assert "instruments.chamber.time_constant_s in the bench file says better" in said
    assert "defect" not in said


def test_some_points_that_cannot_be_measured_are_said_by_the_plan(files):
    (files / "procedure.toml").write_text(PROCEDURE.replace("40]", "30]").replace("dwell_s = 10", "timeout_s = 3500"))
    done = rig("plan", files / "procedure.toml", "--bench", files / "bench.toml")
    assert done.returncode == 0
    said = " ".join(done.stdout.split())
    assert "1 of 3 rehearsed points could not be measured on simulated instruments: moving took longer" in said
    assert "chamber, thermo: no question of `check` shows whether somebody has changed its unit" in said


def test_the_doctor_says_what_a_twin_cannot_know(files):
    quiet = {"XDG_CONFIG_HOME": str(files), "RIG_NOTIFY": ""}
    done = rig("doctor", "--bench", files / "bench.toml", "--dry", "--json", "--out", files, env=quiet)
    findings = {one["check"]: one for one in json.loads(done.stdout)["findings"]}
    assert findings["chamber"]["found"].startswith("WEISS C180, serial number SN")
    assert findings["chamber"]["found"].endswith("; simulated")
    assert findings["twins"]["level"] == "warning"
    assert "accept the commands, numbers and units of the bench file" in findings["twins"]["found"]
    assert "changed its unit, channel or range" in findings["chamber, thermo"]["found"]
