"""The 34401A driver and twin: the user's guide on the wire, noise and resolution, overload, errors, another client."""

from __future__ import annotations

import statistics
from unittest.mock import Mock

import pytest
from pydantic import ValidationError
from serial_bench import FakePlant, plug_in, wires

from rig.bench.plugins import driver_class
from rig.drivers.errors import BadReply, InstrumentError, LimitError, NoReply, NotReady, WrongInstrument
from rig.drivers.roles import Reader, Restartable, is_overload
from rig.sims.twins.keysight_34401a import Keysight34401ATwin
from rig.sims.twins.scpi import Wait
from rig.sims.world import World

Keysight34401A = driver_class("keysight-34401a")


class Rig:
    def __init__(self, volts=1.23456789, **options):
        self.world = World()
        self.plant = FakePlant(self.world, {"input": volts})
        self.twin = Keysight34401ATwin("dvm", options, self.world, self.plant, "")
        self.address = plug_in(self.world, self.twin)
        self.wires, self.wire = wires(self.world)
        self.dvm = Keysight34401A("dvm", self.address, Keysight34401A.Options(**options), self.wires, self.world)
        self.line = self.dvm._talk.line

    def ready(self):
        self.dvm.identify()
        self.dvm.prepare()
        self.wire.log.clear()
        return self

    def remote(self):
        self.line.write("SYST:REM")
        return self.line


def test_it_is_a_reader_with_one_channel():
    dvm = Rig().dvm
    assert isinstance(dvm, Reader)
    assert dvm.channels() == ("input",)


@pytest.mark.parametrize("with_dtr", [True, False])
def test_device_clear_is_heard_while_the_meter_holds_up_the_handshake_only_with_dtr(with_dtr):
    """User's guide, page 151: a query is pending, its DTR is false; Ctrl-C counts when the controller drops its own."""
    rig = Rig(nplc=100).ready()
    rig.dvm.start(5)
    with pytest.raises(NoReply):
        rig.line.query("FETC?", 0.2, repeat=False)
    rig.line.device_clear("\x03", with_dtr=with_dtr)
    assert rig.twin.measuring is not with_dtr
    if with_dtr:
        assert rig.line.query("*IDN?").startswith("HEWLETT")


def test_the_driver_clears_with_dtr():
    rig = Rig(nplc=100).ready()
    rig.dvm.start(5)
    with pytest.raises(NoReply):
        rig.line.query("FETC?", 0.2, repeat=False)
    rig.dvm.make_safe()
    assert not rig.twin.measuring


def test_remote_control_is_taken_over_rs232_only():
    """Over GPIB, SYSTem:REMote is error 514."""
    rig = Rig(interface="gpib")
    rig.ready()
    rig.dvm.start(1)
    rig.dvm.fetch()
    rig.dvm.prepare()
    assert not any(b"SYST:REM" in line for line in rig.wire.sent())
    rig.line.write("SYST:REM")
    assert rig.line.query("SYST:ERR?") == '+514,"Command allowed only with RS-232"'


def test_more_readings_than_its_memory_holds_are_error_531():
    line = Rig().remote()
    line.write("SAMP:COUN 513;:INIT")
    assert line.query("SYST:ERR?") == '+531,"Insufficient memory"'
    line.write("SAMP:COUN 512;:VOLT:DC:NPLC 0.02;:INIT")
    assert line.query("SYST:ERR?") == '+0,"No error"'


@pytest.mark.parametrize("nplc", [2, 20, 200])
def test_it_has_not_the_scanners_integration_times(nplc):
    with pytest.raises(ValidationError, match="must be one of"):
        Keysight34401A.Options(nplc=nplc)


def test_another_meter_is_refused():
    rig = Rig()
    rig.twin.identity = "HEWLETT-PACKARD,34420A,0,10-5-2"
    with pytest.raises(
        WrongInstrument, match=r"dvm at sim://.* should be a 34401A; it answers 'HEWLETT-PACKARD,34420A"
    ):
        rig.dvm.identify()


@pytest.mark.parametrize("echo", ["*IDN?", "SYST:REM*IDN?", "SYST:REM\r*idn? "])
def test_an_echo_in_front_of_the_identity_is_no_makers_name(echo):
    rig = Rig()
    rig.twin.identity = f"{echo}HEWLETT-PACKARD,34401A,0,10-5-2"
    with pytest.raises(WrongInstrument, match=r"echoes the command before its answer.*switch the echo off"):
        rig.dvm.identify()


def test_prepare_configures_command_by_command_checks_errors_and_reads_back():
    rig = Rig(nplc=1)
    rig.dvm.prepare()
    sent = [line for line in rig.wire.sent() if line != b"*OPC?\n"]
    assert sent == [
        b"\x03\n",
        b"SYST:REM\n",
        b"*RST\n",
        b"*CLS\n",
        b"CONF:VOLT:DC 10\n",
        b"VOLT:DC:NPLC 1\n",
        b"ZERO:AUTO ON\n",
        b"TRIG:SOUR IMM\n",
        b"SAMP:COUN 1\n",
        b"SYST:ERR?\n",
        b"FUNC?\n",
        b"VOLT:DC:RANG?\n",
        b"VOLT:DC:RANG:AUTO?\n",
        b"VOLT:DC:NPLC?\n",
        b"ZERO:AUTO?\n",
        b"TRIG:SOUR?\n",
        b"SAMP:COUN?\n",
        b"*PSC 1;*ESE 52\n",
        b"*ESE?\n",
    ]


def test_it_knows_whether_it_has_been_off_since_it_was_prepared():
    rig = Rig()
    assert isinstance(rig.dvm, Restartable)
    assert rig.dvm.restarted()
    rig.ready()
    assert not rig.dvm.restarted()
    rig.twin.power_cycle()
    assert rig.dvm.restarted()


def test_a_setting_that_reads_back_otherwise_is_reported():
    rig = Rig()
    rig.twin.set_nplc = lambda cycles: None
    rig.twin.nplc = 1.0
    rig.twin.configure = lambda span="DEF", resolution="DEF": setattr(rig.twin, "nplc", 1.0)
    with pytest.raises(BadReply, match=r"dvm at .*: VOLT:DC:RANG\S* answers .*, not "):
        rig.dvm.prepare()


def test_a_refused_command_is_reported_in_the_instruments_own_words():
    rig = Rig()
    rig.twin.commands = {k: v for k, v in rig.twin.commands.items() if k != "ZERO:AUTO"}
    with pytest.raises(InstrumentError, match="error -113: Undefined header") as caught:
        rig.dvm.prepare()
    assert caught.value.code == -113


def test_a_measurement_is_two_lines_and_waits_until_the_readings_are_due():
    rig = Rig().ready()
    began = rig.world.now()
    expected = rig.dvm.start(5)
    assert expected == pytest.approx(5 * (0.0015 + 2 * 10 / 50))
    readings = rig.dvm.fetch()["input"]
    assert rig.wire.sent() == [b"*SRE 1;:TRIG:COUN 5;:INIT\n", b"FETC?;*SRE?\n"]
    assert len(readings) == 5
    assert readings == pytest.approx([1.2345679] * 5, abs=5e-6)
    assert expected < rig.world.now() - began < expected + 0.2
    assert len({(t0, t1) for _, t0, t1 in rig.plant.windows[-5:]}) == 5
    assert all(t1 - t0 == pytest.approx(0.2) for _, t0, t1 in rig.plant.windows[-5:])


def test_noise_falls_with_the_square_root_of_time_down_to_a_floor():
    def sd(nplc):
        rig = Rig(nplc=nplc).ready()
        readings = []
        for _ in range(4):
            rig.dvm.start(500)
            readings += rig.dvm.fetch()["input"]
        return statistics.stdev(readings)

    assert sd(1) / sd(10) == pytest.approx(10**0.5, rel=0.2)
    assert sd(10) / sd(100) < 2.9, "white noise alone would give 3.16: the floor shows"
    assert 0.5e-6 < sd(10) < 2e-6, "about a microvolt on the 10 V range at 10 power line cycles"


@pytest.mark.parametrize(("nplc", "step"), [(0.02, 100e-6), (0.2, 10e-6), (1, 3e-6), (10, 1e-6), (100, 0.3e-6)])
def test_readings_come_in_steps_of_a_tenth_of_the_guides_resolution(nplc, step):
    rig = Rig(nplc=nplc).ready()
    rig.dvm.start(3)
    for value in rig.dvm.fetch()["input"]:
        assert value / step == pytest.approx(round(value / step), abs=1e-3)


def test_readings_repeat_in_another_world_but_not_at_another_time():
    def series():
        rig = Rig().ready()
        rig.dvm.start(20)
        return rig.dvm.fetch()["input"]

    one = series()
    assert one == series()
    assert len(set(one)) > 1


def test_overload_is_a_reading_and_a_status_bit_but_no_error():
    rig = Rig(volts=12.5).ready()
    rig.line.query("*ESR?")
    rig.dvm.start(2)
    assert all(is_overload(v) for v in rig.dvm.fetch()["input"])
    assert rig.wire.log[-1] == ("rx", b"+9.90000000E+37,+9.90000000E+37;+1\r\n")
    assert rig.line.query("*ESR?") == "+8"
    assert rig.line.query("STAT:QUES?") == "+1"
    assert rig.line.query("SYST:ERR?") == '+0,"No error"'


def test_the_range_measures_twenty_per_cent_beyond_its_name():
    rig = Rig(volts=-11.9).ready()
    rig.dvm.start(1)
    assert rig.dvm.fetch()["input"][0] == pytest.approx(-11.9, abs=1e-5)


@pytest.mark.parametrize("count", [0, 513])
def test_more_readings_than_memory_are_refused(count):
    rig = Rig().ready()
    with pytest.raises(LimitError, match="1 to 512 readings"):
        rig.dvm.start(count)
    assert rig.wire.sent() == []


def test_fetching_without_starting_is_refused():
    with pytest.raises(NotReady, match="nothing to fetch"):
        Rig().ready().dvm.fetch()


def test_readings_that_never_come_end_the_measurement_and_leave_the_line_in_step():
    rig = Rig().ready()
    rig.dvm.start(1)
    rig.twin.fetch = Mock(side_effect=Wait(1e9))
    with pytest.raises(NoReply, match=r"dvm at .* answered nothing to 'FETC\?;\*SRE\?'"):
        rig.dvm.fetch()
    del rig.twin.fetch
    rig.dvm.prepare()
    rig.dvm.start(1)
    assert rig.dvm.fetch()["input"] == pytest.approx([1.23457], abs=1e-5)


def test_a_power_cycle_is_local_control_and_shows_as_an_error():
    rig = Rig().ready()
    rig.twin.power_cycle()
    rig.dvm.start(1)
    with pytest.raises(InstrumentError, match="error 550: Command not allowed in local"):
        rig.dvm.fetch()


@pytest.mark.parametrize(
    ("command", "error"),
    [
        ("VOLT:DC:NPLCX 1", '-113,"Undefined header"'),
        ("VOLTA:NPLC 1", '-113,"Undefined header"'),
        ("VOLT:DC:NPLC", '-109,"Missing parameter"'),
        ("VOLT:DC:NPLC 1,2", '-108,"Parameter not allowed"'),
        ("VOLT:DC:NPLC 101", '-222,"Data out of range"'),
        ("VOLT:DC:NPLC 1x", '-121,"Invalid character in number"'),
        ("CONF:VOLT:DC 2000", '-222,"Data out of range"'),
        ("CONF:VOLT:DC DEF;:VOLT:DC:RES 1", '-221,"Settings conflict"'),
        ("TRIG:SOUR NOW", '-224,"Illegal parameter value"'),
        ("*TRG", '-211,"Trigger ignored"'),
        ("INIT;:INIT", '-213,"Init ignored"'),
        ("TRIG:COUN 5;INIT", '-113,"Undefined header"'),
    ],
)
def test_the_instrument_refuses_with_scpi_error_numbers(command, error):
    line = Rig().remote()
    line.write("*CLS")
    line.write(command)
    assert line.query("SYST:ERR?") == error
    assert line.query("SYST:ERR?") == '+0,"No error"'


def test_fetching_what_is_not_there_is_stale_and_answers_nothing():
    line = Rig().remote()
    with pytest.raises(NoReply):
        line.query("FETC?", repeat=False)
    assert line.query("SYST:ERR?") == '-230,"Data stale"'


def test_the_error_queue_holds_twenty_and_then_says_so():
    line = Rig().remote()
    line.write(";".join([":NO"] * 25))
    errors = [line.query("SYST:ERR?") for _ in range(21)]
    assert errors[:19] == ['-113,"Undefined header"'] * 19
    assert errors[19:] == ['-350,"Too many errors"', '+0,"No error"']


def test_the_event_register_tells_classes_of_errors_and_reading_clears_it():
    line = Rig().remote()
    assert line.query("*ESR?") == "+128", "power on"
    line.write("NO;:VOLT:DC:NPLC 1000;:*ESE 48;*SRE 32")
    assert line.query("*STB?") == "+96"
    assert line.query("*ESR?") == "+48"
    assert line.query("*ESR?;*STB?") == "+0;+0"


def test_bus_trigger_waits_for_its_trigger():
    rig = Rig().ready()
    rig.line.write("TRIG:SOUR BUS;:INIT")
    rig.world.sleep(5.0)
    rig.line.write("*TRG")
    assert float(rig.line.query("FETC?", 2.0)) == pytest.approx(1.23457, abs=1e-5)


def test_operation_complete_waits_for_the_measurement():
    rig = Rig().ready()
    rig.line.write("TRIG:COUN 10;:INIT")
    began = rig.world.now()
    assert rig.line.query("*OPC?", 10.0) == "1"
    assert rig.world.now() - began > 3.9


def test_a_wrong_frame_hears_nothing():
    rig = Rig()
    other = Keysight34401A.Options(frame="8N1")
    rig.wires.close()
    dvm = Keysight34401A("dvm", rig.address, other, rig.wires, rig.world)
    with pytest.raises(NoReply, match="set to 9600 baud 8N1"):
        dvm.identify()


@pytest.mark.parametrize("options", [{"nplc": 5}, {"range_V": 3}, {"baud": 115200}, {"ncycles": 1}])
def test_options_are_checked(options):
    with pytest.raises(ValidationError):
        Keysight34401A.Options(**options)
