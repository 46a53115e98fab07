"""The 34970A driver and twin: scan lists, thermistors, de-interleaving, and the Command Reference's errors."""

from __future__ import annotations

import itertools

import pytest
from pydantic import ValidationError
from serial_bench import FakePlant, plug_in, wires

from rig.bench.plugins import driver_class
from rig.contracts.declared.scan import joined
from rig.drivers.errors import BadReply, InstrumentError, LimitError, WrongInstrument
from rig.drivers.roles import Reader, Restartable, is_overload
from rig.sims.twins.keysight_34970a import Keysight34970ATwin
from rig.sims.world import World

Keysight34970A = driver_class("keysight-34970a")
CHANNELS = {"102": "volts", "101": "volts", "103": "volts", "110": "thermistor-10k", "109": "thermistor-5k"}


class Rig:
    def __init__(self, degC=23.4567, **options):
        self.world = World()
        self.plant = FakePlant(self.world, {"101": 1.0, "102": 2.0, "103": -3.0}, degC)
        options = {"channels": CHANNELS, **options}
        self.twin = Keysight34970ATwin("dvm", options, self.world, self.plant, "")
        self.wires, self.wire = wires(self.world)
        address = plug_in(self.world, self.twin)
        self.dvm = Keysight34970A("dvm", address, Keysight34970A.Options(**options), self.wires, self.world)
        self.line = self.dvm._talk.line

    def ready(self):
        self.dvm.identify()
        self.dvm.prepare()
        self.wire.log.clear()
        return self

    def remote(self):
        self.line.write("SYST:REM")
        return self.line


def test_it_is_a_reader_of_its_channels_in_scan_order():
    dvm = Rig().dvm
    assert isinstance(dvm, Reader)
    assert list(dvm.channels()) == ["101", "102", "103", "109", "110"]


def test_prepare_sets_channels_and_scan_list_and_reads_them_back():
    rig = Rig()
    rig.dvm.prepare()
    sent = [line for line in rig.wire.sent() if line != b"*OPC?\n"]
    assert sent == [
        b"\x03\n",
        b"SYST:REM\n",
        b"*RST\n",
        b"*CLS\n",
        b"CONF:VOLT:DC 10,(@101:103)\n",
        b"VOLT:DC:NPLC 10,(@101:103)\n",
        b"CONF:TEMP THER,5000,(@109)\n",
        b"CONF:TEMP THER,10000,(@110)\n",
        b"TEMP:NPLC 10,(@109:110)\n",
        b"UNIT:TEMP C,(@109:110)\n",
        b"ROUT:SCAN (@101:103,109:110)\n",
        b"TRIG:SOUR IMM\n",
        b"SYST:ERR?\n",
        b"VOLT:DC:RANG? (@101:103)\n",
        b"VOLT:DC:NPLC? (@101:103)\n",
        b"TEMP:TRAN:TYPE? (@109)\n",
        b"TEMP:TRAN:THER:TYPE? (@109)\n",
        b"TEMP:TRAN:TYPE? (@110)\n",
        b"TEMP:TRAN:THER:TYPE? (@110)\n",
        b"TEMP:NPLC? (@109:110)\n",
        b"UNIT:TEMP? (@109:110)\n",
        b"ROUT:SCAN?\n",
        b"TRIG:SOUR?\n",
        b"SYST:LFR?\n",
        b"*PSC 1;*ESE 52\n",
        b"*ESE?\n",
    ]
    assert ("rx", b"#222(@101,102,103,109,110)\r\n") in rig.wire.log


def test_a_scan_list_that_reads_back_otherwise_is_reported():
    rig = Rig()
    rig.twin.ask_scan = lambda: "#206(@101)"
    with pytest.raises(BadReply, match=r"ROUT:SCAN\? answers 101, not 101,102,103,109,110"):
        rig.dvm.prepare()


def test_sweeps_come_back_by_channel():
    rig = Rig().ready()
    began = rig.world.now()
    expected = rig.dvm.start(3)
    readings = rig.dvm.fetch()
    assert rig.wire.sent() == [b"*SRE 1;:TRIG:COUN 3;:INIT\n", b"FETC?;*SRE?\n"]
    assert expected == pytest.approx(3 * 5 * (1 / 60 + 0.0015 + 2 * 10 / 50), rel=1e-3)
    assert expected < rig.world.now() - began < expected + 0.4
    assert {name: len(values) for name, values in readings.items()} == dict.fromkeys(rig.dvm.channels(), 3)
    assert readings["101"] == pytest.approx([1.0] * 3, abs=1e-5)
    assert readings["103"] == pytest.approx([-3.0] * 3, abs=1e-5)
    assert readings["110"] == pytest.approx([23.457] * 3, abs=0.005)
    order = [channel for channel, _, _ in rig.plant.windows]
    assert order == ["101", "102", "103"] * 3


def test_channels_are_measured_one_after_another():
    rig = Rig().ready()
    rig.dvm.start(2)
    rig.dvm.fetch()
    edges = [edge for _, t0, t1 in rig.plant.windows for edge in (t0, t1)]
    assert edges == sorted(edges)


def test_the_power_lines_frequency_is_learnt():
    rig = Rig(channels={"101": "volts"})
    rig.twin.line_hz = 60.0
    rig.ready()
    assert rig.dvm.sweep_s() == pytest.approx(1 / 60 + 0.0015 + 2 * 10 / 60, rel=1e-3)


def test_an_open_thermistor_is_an_overload_with_its_own_status_bit():
    rig = Rig(degC=float("inf")).ready()
    rig.line.query("*ESR?")
    rig.dvm.start(1)
    readings = rig.dvm.fetch()
    assert is_overload(readings["110"][0])
    assert not is_overload(readings["101"][0])
    assert rig.line.query("STAT:QUES?") == "+1024"
    assert rig.line.query("*ESR?") == "+8"
    assert rig.line.query("SYST:ERR?") == '+0,"No error"'


BRIDGES = {**{f"10{n}": "volts" for n in range(1, 8)}, "108": "rtd-4w-385", "109": "rtd-2w-391"}


def test_seven_bridges_and_resistance_thermometers_in_one_scan():
    """Ten millivolts of a bridge belong on the 100 mV range; the coldest soak is below what a thermistor can do."""
    rig = Rig(-130.0, channels=BRIDGES, range_V=0.1, ranges={"107": 10})
    rig.plant.volts = {f"10{n}": n * 1.2345678e-3 for n in range(1, 8)}
    rig.ready()
    assert rig.line.query("ROUT:SCAN:SIZE?") == "+9"
    assert rig.line.query("CONF? (@101,107,108,109)") == (
        '"VOLT +1.000000E-01,+1.000000E-07","VOLT +1.000000E+01,+1.000000E-05",'
        '"TEMP FRTD,85,+1.000000E+00,+1.000000E-04","TEMP RTD,91,+1.000000E+00,+1.000000E-04"'
    )
    rig.dvm.start(2)
    readings = rig.dvm.fetch()
    assert readings["106"] == pytest.approx([7.4074068e-3] * 2, abs=5e-8)
    assert readings["107"] == pytest.approx([8.6419746e-3] * 2, abs=5e-6)
    assert readings["108"] == pytest.approx([-130.0] * 2, abs=0.005)
    assert readings["109"] == pytest.approx([-130.0] * 2, abs=0.005)


def test_prepare_reads_back_what_kind_of_resistor_it_is():
    rig = Rig(channels={"108": "rtd-4w-391"})
    rig.twin.ask_frtd = lambda channels="": "+85"
    with pytest.raises(BadReply, match=r"TEMP:TRAN:FRTD:TYPE\? \(@108\) answers \+85, not 91.0"):
        rig.dvm.prepare()


@pytest.mark.parametrize(
    ("kind", "degC", "overload"),
    [
        ("thermistor-10k", -79.9, False),
        ("thermistor-10k", -130.0, True),
        ("thermistor-10k", 150.1, True),
        ("rtd-4w-385", -199.9, False),
        ("rtd-2w-385", -200.1, True),
        ("rtd-4w-391", 600.1, True),
        ("rtd-4w-391", float("inf"), True),
    ],
)
def test_outside_a_thermometers_range_is_an_overload(kind, degC, overload):
    """Thermistors end at -80 and 150 degrees Celsius, platinum at -200 and 600 (34970A user's guide)."""
    rig = Rig(degC, channels={"101": "volts", "105": kind}).ready()
    rig.dvm.start(1)
    assert is_overload(rig.dvm.fetch()["105"][0]) is overload
    assert (rig.line.query("STAT:QUES?") == "+1024") is overload


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        ({"108": "rtd-4w-385", "118": "volts"}, "118 carries the other two wires of 108"),
        ({"112": "rtd-4w-391"}, "four wires go to channel 101 to 110"),
    ],
)
def test_the_second_channel_of_four_wires_is_taken(channels, words):
    with pytest.raises(ValidationError, match=words):
        Keysight34970A.Options(channels=channels)
    Keysight34970A.Options(channels={"108": "rtd-2w-385", "118": "volts"})


def test_it_knows_whether_it_has_been_off_since_it_was_prepared():
    rig = Rig()
    assert isinstance(rig.dvm, Restartable)
    assert rig.dvm.restarted()
    rig.ready()
    assert not rig.dvm.restarted()
    rig.dvm.start(1)
    rig.dvm.fetch()
    rig.dvm.make_safe()
    rig.dvm.identify()
    assert not rig.dvm.restarted()
    rig.twin.power_cycle()
    assert rig.dvm.restarted()
    assert rig.dvm.restarted(), "asking does not use the evidence up"
    rig.dvm.prepare()
    assert not rig.dvm.restarted()


def test_a_mask_that_outlives_the_power_is_told_not_to():
    """*PSC 0 would keep it."""
    rig = Rig()
    rig.line.write("*PSC 0")
    rig.ready()
    rig.twin.power_cycle()
    assert rig.dvm.restarted()


def test_memory_limits_the_sweeps():
    with pytest.raises(LimitError, match="1 to 10000 sweeps"):
        Rig().ready().dvm.start(10_001)


def test_settings_are_fixed_while_a_scan_is_under_way_and_abort_ends_it():
    rig = Rig().ready()
    rig.dvm.start(10)
    rig.line.write("VOLT:DC:NPLC 1,(@101)")
    assert rig.line.query("SYST:ERR?") == '+261,"Not able to execute while scan initiated"'
    rig.line.write("ABOR")
    rig.line.write("VOLT:DC:NPLC 1,(@101)")
    assert rig.line.query("SYST:ERR?") == '+0,"No error"'


def test_make_safe_gives_up_a_scan():
    rig = Rig().ready()
    rig.dvm.start(1000)
    rig.dvm.make_safe()
    assert not rig.twin.measuring
    assert rig.dvm.identify().model == "34970A"


def test_readings_stay_after_fetching_and_go_with_a_changed_setting():
    rig = Rig().ready()
    rig.dvm.start(1)
    rig.dvm.fetch()
    assert rig.line.query("FETC?").count(",") == 4
    rig.line.write("TRIG:COUN 2")
    assert rig.line.query("FETC?;:SYST:ERR?") == '-230,"Data stale"'


@pytest.mark.parametrize(
    ("command", "error"),
    [
        ("INIT", '+113,"Channel list: empty scan list"'),
        ("ROUT:SCAN (@101,201)", '+111,"Channel list: slot number out of range"'),
        ("ROUT:SCAN (@101,121)", '+112,"Channel list: channel number out of range"'),
        ("ROUT:SCAN (101)", '+309,"Incorrectly formatted channel list"'),
        ("CONF:TEMP TC,K,(@101)", '+251,"Unsupported temperature transducer type"'),
        ("CONF:TEMP THER,4711,(@101)", '-224,"Illegal parameter value"'),
        ("CONF:TEMP FRTD,4711,(@101)", '-224,"Illegal parameter value"'),
        ("CONF:TEMP FRTD,85,(@111)", '+308,"Channel not able to perform requested operation"'),
        ("CONF:TEMP FRTD,85,(@101);:ROUT:SCAN (@101,111)", '+306,"Part of a 4-wire pair"'),
        ("CONF:VOLT:DC 10,(@101);:TEMP:TRAN:TYPE? (@101)", '+305,"Not able to perform requested operation"'),
        ("TEMP:NPLC 1,(@101)", '+305,"Not able to perform requested operation"'),
        ("ROUT:SCAN", '-109,"Missing parameter"'),
    ],
)
def test_the_instrument_refuses_with_the_references_error_numbers(command, error):
    line = Rig().remote()
    line.write(command)
    assert line.query("SYST:ERR?") == error


def test_local_control_obeys_nothing():
    line = Rig().line
    line.write("ROUT:SCAN (@101)")
    assert line.query("SYST:ERR?") == '+550,"Not able to execute command in local mode"'


def test_the_error_queue_holds_ten_and_then_says_so():
    line = Rig().remote()
    line.write(";".join([":NO"] * 15))
    errors = [line.query("SYST:ERR?") for _ in range(11)]
    assert errors[8:] == ['-113,"Undefined header"', '-350,"Error queue overflow"', '+0,"No error"']


def test_configuration_reads_back_as_in_the_reference():
    """The reference prints "TEMP THER,5000,+1.000000E+00,+1.000000E-04" for a 5 kilohm thermistor."""
    line = Rig().remote()
    line.write("CONF:TEMP THER,5000,1,0.1,(@108)")
    assert line.query("CONF? (@108)") == '"TEMP THER,5000,+1.000000E+00,+1.000000E-04"'
    line.write("CONF:VOLT:DC 10,0.003,(@103,108)")
    assert line.query("ROUT:SCAN?") == "#210(@103,108)"


def test_factory_reset_is_the_references():
    line = Rig().remote()
    line.write("CONF:VOLT:DC 10,(@101);:TRIG:COUN 7")
    line.write("*RST")
    assert line.query("ROUT:SCAN:SIZE?") == "+0"
    assert line.query("VOLT:DC:NPLC? (@101);:TRIG:COUN?;SOUR?") == "+1.00000000E+00;+1.00000000E+00;IMM"


@pytest.mark.parametrize("nplc", [2, 20, 200])
def test_integration_times_that_only_the_scanner_has(nplc):
    rig = Rig(channels={"101": "volts", "109": "thermistor-10k"}, nplc=nplc).ready()
    expected = rig.dvm.start(2)
    assert expected == pytest.approx(2 * 2 * (0.0167 + 0.0015 + 2 * nplc / 50))
    assert rig.dvm.fetch()["101"] == pytest.approx([rig.plant.volts["101"]] * 2, abs=5e-6)
    assert float(rig.line.query("VOLT:DC:NPLC? (@101)")) == nplc


def test_it_obeys_another_version_of_the_standard_than_the_voltmeter():
    assert Rig().remote().query("SYST:VERS?") == "1994.0"


@pytest.mark.parametrize(("slot", "card"), [(100, "34901A,0,2.3"), (200, "0,0,0"), (300, "0,0,0")])
def test_it_tells_what_is_in_its_slots(slot, card):
    assert Rig().remote().query(f"SYST:CTYP? {slot}") == f"HEWLETT-PACKARD,{card}"


def test_measure_configures_scans_once_and_answers():
    rig = Rig()
    line = rig.remote()
    first, second = line.query("MEAS:VOLT:DC? 10,(@101,102)", 10.0).split(",")
    assert float(first) == pytest.approx(rig.plant.volts["101"], abs=1e-4)
    assert float(second) == pytest.approx(rig.plant.volts["102"], abs=1e-4)
    assert float(line.query("MEAS:TEMP? THER,10000,(@109)", 10.0)) == pytest.approx(rig.plant.degC, abs=0.01)
    assert line.query("SYST:ERR?") == '+0,"No error"'


def test_readings_carry_what_they_are_told_to():
    """Unit, time from the beginning of the scan, channel, alarm: in this order (Command Reference, FORMat:READing)."""
    rig = Rig()
    line = rig.remote()
    line.write("CONF:VOLT:DC 10,(@101,102)")
    line.write("FORM:READ:UNIT ON;:FORM:READ:TIME ON;:FORM:READ:CHAN ON;:FORM:READ:ALAR ON")
    words = line.query("READ?", 10.0).split(",")
    assert [word.partition(" ")[2] for word in words[::4]] == ["VDC", "VDC"]
    assert float(words[4].split()[0]) == pytest.approx(rig.plant.volts["102"], abs=1e-4)
    assert [words[1], words[5]] == ["00000000.000", "00000000.058"], "a relay, settling and two power line cycles"
    assert words[2::4] == ["101", "102"]
    assert words[3::4] == ["0", "0"]
    line.write("*RST")
    assert line.query("FORM:READ:CHAN?") == "0"


def test_readings_can_be_taken_out_of_the_memory_while_it_scans():
    rig = Rig()
    line = rig.remote()
    line.write("CONF:VOLT:DC 10,(@101,102)")
    line.write("TRIG:SOUR TIMER;TIM 5;COUN INF;:INIT")
    assert line.query("TRIG:COUN?") == "+9.90000000E+37"
    rig.world.sleep(11.0)
    assert line.query("DATA:POIN?") == "+4"
    values = [float(word) for word in line.query("DATA:REM? 3").split(",")]
    assert values == pytest.approx([rig.plant.volts[c] for c in ("101", "102", "101")], abs=1e-4)
    assert float(line.query("DATA:LAST?")) == pytest.approx(rig.plant.volts["102"], abs=1e-4)
    assert line.query("DATA:POIN?") == "+1"
    line.write("DATA:REM? 2")
    assert line.query("SYST:ERR?") == '-222,"Data out of range"'
    assert line.query("STAT:OPER:COND?") == "+16", "scanning"
    block = line.query("R? 5")
    assert block[:4] == "#215"
    assert float(block[4:]) == pytest.approx(rig.plant.volts["102"], abs=1e-4)
    assert line.query("R?") == "#10"
    assert line.query("DIAG:DMM:CYCL?;:DIAG:REL:CYCL? (@101,102)") == "+0,+0,+0;+0,+0"


def test_timed_scans_keep_their_interval():
    rig = Rig(channels={"101": "volts"}).ready()
    rig.line.write("TRIG:SOUR TIM;TIM 7.5;COUN 3;:INIT")
    rig.line.query("*OPC?", 60.0)
    begins = [t0 for _, t0, _ in rig.plant.windows]
    assert [b - a for a, b in itertools.pairwise(begins)] == pytest.approx([7.5, 7.5])


def test_what_it_sends_to_hold_up_the_host_is_no_part_of_its_answers():
    """It leaves the factory with XON/XOFF; the characters come when it pleases, between answers and in them."""
    channels = {str(n): "volts" for n in range(101, 121)}
    rig = Rig(channels=channels, nplc=0.02, ranges={f"1{n:02}": (1, 100)[n % 2] for n in range(1, 20)})
    rig.plant.volts = dict.fromkeys(channels, 0.5)
    rig.ready()
    rig.line.write("*CLS;" * 30)
    rig.dvm.start(3)
    assert rig.dvm.fetch()["107"] == pytest.approx([0.5] * 3, abs=0.02)
    heard = b"".join(data for direction, data in rig.wire.log if direction == "rx")
    assert {b"\x11"[0], b"\x13"[0]} <= set(heard)
    assert rig.line.retries == 0


def test_another_scanner_is_refused():
    rig = Rig()
    rig.twin.identity = "Agilent Technologies,34972A,MY49000001,1.12"
    with pytest.raises(WrongInstrument, match="should be a 34970A"):
        rig.dvm.identify()


def test_a_refused_channel_is_reported():
    rig = Rig(channels={"201": "volts"})
    with pytest.raises(InstrumentError, match="error 111: Channel list: slot number out of range"):
        rig.dvm.prepare()


@pytest.mark.parametrize(
    "options",
    [
        {"channels": {}},
        {"channels": {"121": "volts"}},
        {"channels": {"101": "ohms"}},
        {"nplc": 3},
        {"range_V": 300},
        {"ranges": {"101": 0.3}},
        {"ranges": {"110": 0.1}},
        {"ranges": {"104": 0.1}},
    ],
)
def test_options_are_checked(options):
    with pytest.raises(ValidationError):
        Keysight34970A.Options(**{"channels": CHANNELS, **options})


def test_neighbours_join_in_a_channel_list():
    assert joined([101, 102, 103, 110, 201]) == "101:103,110,201"
