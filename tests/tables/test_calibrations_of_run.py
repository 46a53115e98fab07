"""Asset, certificate and due date of a reference standard have one source: the register in the run file."""

from __future__ import annotations

from types import SimpleNamespace

from rig.run_file.events.sessions import Identified
from rig.run_file.state.documents import Stored
from rig.tables.provenance import instruments_of, standards_of
from rig.verbs.chart.inputs import _changes

BENCH = """
[instruments.coriolis]
driver = "scpi-meter"
asset = "REF-01"
[instruments.valve]
asset = "V-01"
[references.flow_kg_per_min]
reader = "coriolis"
of = "valve_V"
"""
REGISTER = """
[equipment.REF-01]
[equipment.REF-01.certificate]
number = "Q-4711"
due = 2027-05-01
[equipment.V-01]
description = "voltage source of the valve"
"""


def standards(bench=BENCH, register=REGISTER):
    return standards_of(Stored.of({"bench.toml": bench}, "bench.toml"), {"equipment.toml": register})


def test_a_reference_standard_has_the_asset_of_its_reader_and_the_certificate_of_the_register():
    of_register = "asset REF-01, certificate Q-4711, calibration due 2027-05-01, read by coriolis"
    assert standards() == f"flow_kg_per_min: {of_register}"
    own = BENCH + 'asset = "REF-02"\ndue = 2026-12-01\n'
    assert standards(own) == "flow_kg_per_min: asset REF-02, calibration due 2026-12-01, read by coriolis"
    assert standards(register="") == "flow_kg_per_min: asset REF-01, calibration due not declared, read by coriolis"


def test_an_instrument_has_the_certificate_of_the_register_and_a_new_one_is_no_other_instrument():
    event = Identified(instrument="coriolis", maker="EMERSON", model="CMF025", serial="SN1", asset="REF-01")
    reader = SimpleNamespace(records=lambda kind: [SimpleNamespace(event=event)])
    told = instruments_of(reader, {"equipment.toml": REGISTER})
    assert told == {"coriolis": f"{event.words}, certificate Q-4711, calibration due 2027-05-01"}
    before = {"coriolis": f"{event.words}, calibration due 2026-05-01"}
    assert _changes({"instruments": before}, {"instruments": told}) == []
