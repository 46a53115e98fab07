"""What an instrument said of itself, against the register whose number a certificate prints."""

from __future__ import annotations

import pytest
from general_lab import run_dry
from test_register import BENCH, GOOD

from rig.bench.config import parse_bench
from rig.register import parse_register
from rig.run_file.events.sessions import Identified
from rig.run_file.read.reader import RunReader
from rig.tables.table_of_run import run_table
from rig.verbs.budget.identities import contradicted, not_told

CONFIG = parse_bench(BENCH, "bench.toml")
REGISTER = parse_register(GOOD, "equipment.toml")
(NAME,) = (name for name, one in CONFIG.instruments.items() if one.asset == "DVM-0102")
KNOWN = REGISTER.equipment["DVM-0102"]


def said(**more):
    own = {"maker": "HEWLETT-PACKARD", "model": KNOWN.model, "serial": KNOWN.serial, "confirmed": True}
    return Identified(instrument=NAME, **{**own, **more})


def told(*every, simulated=False):
    return list(contradicted(REGISTER, CONFIG, every, "equipment.toml", simulated=simulated))


def test_the_instrument_of_the_register_is_no_contradiction_under_an_older_makers_name():
    assert told(said()) == []
    assert list(not_told(REGISTER, CONFIG, [said()])) == []


@pytest.mark.parametrize("model", [KNOWN.model.lower(), f"HP {KNOWN.model}", KNOWN.model[:3] + " " + KNOWN.model[3:]])
def test_a_model_may_be_written_in_other_ways(model):
    assert told(said(model=model)) == []


def test_another_model_than_the_register_prints_is_a_reason_against_a_certificate():
    """A run recorded a 34401A, and its certificate said 3458A."""
    (line,) = told(said(model="3458A", serial="0", confirmed=False))
    assert line == (
        f"equipment.toml: equipment.DVM-0102.model = {KNOWN.model!r}, and in the run {NAME} said that it is a '3458A': "
        "correct it, or name the register of the instrument that was used"
    )
    assert told(said(model="3458A"), simulated=True) == []


def test_another_serial_number_is_one_too():
    (line,) = told(said(serial="MY999"))
    assert f"serial = {KNOWN.serial!r}, and in the run {NAME} reported 'MY999'" in line


def test_a_serial_number_that_was_not_told_is_said_and_is_no_contradiction():
    """Some meters report the serial number 0."""
    one = said(serial="0", confirmed=False)
    assert told(one) == []
    assert list(not_told(REGISTER, CONFIG, [one, one])) == [
        f"{NAME} told its model ({KNOWN.model}), and no serial number: that it is DVM-0102, serial number "
        f"{KNOWN.serial}, is by the register alone."
    ]


def test_of_a_simulated_run_no_serial_number_is_confirmed(tmp_path):
    path, _ = run_dry(tmp_path)
    with RunReader.open(path) as reader:
        (said,) = (r.event for r in reader.records("identity") if r.event.instrument == "dvm")
    assert said.serial
    assert not said.confirmed
    assert "simulated, so its identity is not confirmed" in said.words
    assert said.words in run_table(path).provenance["instruments"]["dvm"]
