"""The PACE driver and twin: bytes of the manual K0472, what is left when things go wrong, and a safe end."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from serial_bench import plug_in, wires

from rig.drivers.declared.headers import same_header
from rig.drivers.druck_measures import full_scale_psi, reference_of
from rig.drivers.druck_pace import DruckPACE
from rig.drivers.errors import BadReply, InstrumentError, LimitError, NoReply, NotReady, WrongInstrument
from rig.drivers.roles import PressureController, Restartable, SelfChecking
from rig.sims.physics.pressure_line import ATMOSPHERE_PSIA, LineTruth, PressureLine
from rig.sims.twins.druck_pace import DruckPACETwin
from rig.sims.world import World

AIR = ATMOSPHERE_PSIA
TRUTH = LineTruth(control_noise_psi=0.0, reference_noise_psi=0.0)


class Gas:
    """A plant that is one pressure line."""

    def __init__(self, truth: LineTruth) -> None:
        self.line = PressureLine(truth, "pace", 7)

    def pressure_line(self, instrument: str) -> PressureLine:
        return self.line


class Rig:
    def __init__(self, truth=TRUTH, hardware=None, **options):
        self.world = World()
        self.gas = Gas(truth)
        self.line = self.gas.line
        self.twin = DruckPACETwin("pace", {**options, **(hardware or {})}, self.world, self.gas, "58784")
        self.wires, self.wire = wires(self.world)
        address = plug_in(self.world, self.twin)
        self.pace = DruckPACE("pace", address, DruckPACE.Options(**options), self.wires, self.world)

    def ready(self):
        self.pace.identify()
        self.pace.prepare()
        self.wire.log.clear()
        return self

    def wait(self, until, seconds=600.0):
        """Poll once a second; the state at which `until` held."""
        for _ in range(int(seconds)):
            state = self.pace.read()
            if until(state):
                return state
            self.world.sleep(1.0)
        raise AssertionError(f"waited {seconds} s in vain: {state}")

    def settle(self, psia):
        self.pace.set_pressure(psia)
        return self.wait(lambda s: s.in_limits)

    def say(self, text):
        """A line for the twin, past the driver; what it answers."""
        heard = []
        self.twin.on_rx(text.encode() + b"\n", heard.append)
        self.world.sleep(0.5)
        return b"".join(heard).decode()

    def sent(self):
        return [line.decode().strip() for line in self.wire.sent() if line != b":SYST:ERR?\n"]


def test_it_is_a_pressure_controller_that_knows_when_it_was_off():
    pace = Rig().pace
    assert isinstance(pace, PressureController)
    assert isinstance(pace, Restartable)
    assert pace.limits() == (0.0, 15.0)


# --- the manual's bytes


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("*IDN?", "*IDN GE Druck,Pace5000 User Interface,58784,01.05.04"),
        (":SYST:ERR?", ':SYST:ERR 0,"No error"'),
        (":UNIT:PRES?", ":UNIT:PRES BAR"),
        (":SENS:PRES?", ":SENS:PRES 1.0132500"),
        (":SENS:PRES:INL?", ":SENS:PRES:INL 1.0132500, 0"),
        (":SOUR:PRES?", ":SOUR:PRES:LEV:IMM:AMPL 0.0000000"),
        (":SOUR:PRES:INL:TIME?", ":SOUR:PRES:INL:TIME 2"),
        (":SOUR:PRES:LEV:IMM:AMPL:VENT?", ":SOUR:PRES:LEV:IMM:AMPL:VENT 0"),
        (":SOUR:PRES:SLEW:MODE?", ":SOUR:PRES:SLEW:MODE MAX"),
        (":SOUR:PRES:SLEW:OVER?", ":SOUR:PRES:SLEW:OVER 1"),
        (":OUTP:STAT?", ":OUTP:STAT 0"),
        (":SOUR:PRES:EFF?", ":SOUR:PRES:EFF 0.0000000"),
    ],
)
def test_it_answers_with_its_header_as_the_manual_prints_it(question, answer):
    assert Rig(replace(TRUTH, start_psia=14.695949)).say(question) == answer + "\r\n"


@pytest.mark.parametrize(
    "header", [":SOUR:VENT", ":source:pressure:level:immediate:amplitude:vent", "SOUR1:PRES:VENT", ":Sour:Ampl:Vent"]
)
def test_headers_come_long_short_in_either_case_and_with_the_modules_number(header):
    assert Rig().say(header + "?") == ":SOUR:PRES:LEV:IMM:AMPL:VENT 0\r\n"


def test_a_line_holds_several_commands_and_ends_in_lf_or_cr_lf():
    rig = Rig()
    assert rig.say(":UNIT:PRES PSI;:SOUR:PRES 2.5;:UNIT:PRES?;:SOUR:PRES?\r") == (
        ":UNIT:PRES PSI;:SOUR:PRES:LEV:IMM:AMPL 2.5000000\r\n"
    )


@pytest.mark.parametrize(
    ("command", "error"),
    [
        ("FRED", '-113,"Undefined header"'),
        (":SOUR3:PRES?", '-114,"Header suffix out of range"'),
        (":SOUR:PRES:INL:TIME 1", '-222,"Data out of range"'),
        (":SOUR:PRES 9999", '-222,"Data out of range"'),
        (":SENS:PRES 1", '-113,"Undefined header"'),
    ],
)
def test_errors_queue_with_the_manuals_numbers(command, error):
    rig = Rig()
    assert rig.say(command) == ""
    assert rig.say(":SYST:ERR?") == f":SYST:ERR {error}\r\n"


def test_five_errors_fit_the_queue_and_a_sixth_overflows_it():
    rig = Rig()
    rig.say(";".join([":FRED"] * 9))
    errors = [rig.say(":SYST:ERR?").strip() for _ in range(6)]
    assert errors[3:] == [
        ':SYST:ERR -113,"Undefined header"',
        ':SYST:ERR -350,"Queue overflow"',
        ':SYST:ERR 0,"No error"',
    ]


def test_units_are_converted_and_slews_are_per_second():
    rig = Rig()
    for unit, value in (("PSI", 1.0), ("KPA", 6.8947573), ("TORR", 51.7149326), ("PA", 6894.7572932)):
        rig.say(f":UNIT:PRES {unit}")
        rig.say(f":SOUR:PRES:SLEW {value}")
        rig.say(":UNIT:PRES MBAR")
        assert float(rig.say(":SOUR:PRES:SLEW?").split()[1]) == pytest.approx(68.9475729, abs=1e-6)


def test_the_power_on_bit_is_reserved_and_the_event_register_tells_errors():
    """K0472 revision A, table 3-1: bit 7 is not used and returns 0; bit 5 is a command error."""
    rig = Rig()
    assert rig.say("*ESR?") == "*ESR 0\r\n"
    rig.say("FRED")
    assert rig.say("*ESR?") == "*ESR 32\r\n"
    assert rig.say("*ESR?") == "*ESR 0\r\n"


def test_pressure_events_tell_once_what_has_come_about():
    """Table 3-2: bit 0 vent complete, bit 2 in limits."""
    rig = Rig().ready()
    rig.settle(5.0)
    assert rig.say(":STAT:OPER:PRES?") == ":STAT:OPER:PRES:EVEN 4\r\n"
    assert rig.say(":STAT:OPER:PRES?") == ":STAT:OPER:PRES:EVEN 0\r\n"
    assert rig.say(":STAT:OPER:PRES:COND?") == ":STAT:OPER:PRES:COND 4\r\n"
    rig.say(":SOUR:VENT 1")
    rig.world.sleep(60.0)
    assert rig.say(":STAT:OPER:PRES:COND?") == ":STAT:OPER:PRES:COND 1\r\n"


# --- the driver


def test_a_second_module_makes_it_another_model():
    assert Rig(module=2).pace.identify().model == "PACE6000"


@pytest.mark.parametrize("identity", ["Mensor,CPC6050,1,2", "GE Druck,Pace1000,1,2", "GE Druck"])
def test_another_instrument_is_refused(identity):
    rig = Rig()
    rig.twin.ask_identity = lambda: identity
    with pytest.raises(WrongInstrument, match="should be a Druck PACE5000 or PACE6000"):
        rig.pace.identify()


def test_prepare_sets_unit_and_slew_command_by_command_and_reads_them_back():
    rig = Rig(slew_psi_per_s=0.05)
    rig.pace.prepare()
    assert rig.sent() == [
        ":UNIT:PRES PSI",
        ":UNIT:PRES?",
        ":SOUR:PRES:SLEW:MODE LIN",
        ":SOUR:PRES:SLEW 0.05",
        ":SOUR:PRES:SLEW:OVER 0",
        ":SOUR:PRES:INL 0.01",
        ":SOUR:PRES:INL:TIME 2",
        ":SOUR:PRES:SLEW:MODE?",
        ":SOUR:PRES:SLEW?",
        ":SOUR:PRES:SLEW:OVER?",
        ":SOUR:PRES:INL?",
        ":SOUR:PRES:INL:TIME?",
        ":OUTP:MODE ACT",
        ":OUTP:MODE?",
        ":SOUR:PRES:RANG?",
        ":SENS:PRES:BAR?",
        ":SENS:PRES?",
        "*ESE 52",
        "*ESE?",
    ]
    assert ("rx", b':SYST:ERR 0,"No error"\r\n') in rig.wire.log
    assert not rig.line.controlling


def test_the_second_module_has_its_number():
    rig = Rig(module=2).ready()
    rig.settle(5.0)
    assert ":SOUR2:PRES 5.0000000" in rig.sent()
    assert ":OUTP2:STAT 1" in rig.sent()


def test_units_are_the_modules_own():
    """K0472 revision A, page 4-128: :UNIT[x], module 1 if not given."""
    rig = Rig(module=2)
    rig.say(":UNIT1:PRES MBAR;:UNIT2:PRES BAR")
    rig.pace.prepare()
    assert rig.say(":UNIT1:PRES?;:UNIT2:PRES?") == ":UNIT:PRES MBAR;:UNIT:PRES PSI\r\n", "module 1 is not ours"
    rig.say(":UNIT:PRES KPA")
    assert rig.settle(5.0).pressure_psia == pytest.approx(5.0, abs=0.002)
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(5.0, abs=0.002)
    rig.say(":UNIT2:PRES MBAR")
    assert rig.pace.read().pressure_psia == pytest.approx(5.0, abs=0.002)
    rig.pace.make_safe()
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(AIR, abs=0.02)
    assert rig.say(":UNIT1:PRES?") == ":UNIT:PRES KPA\r\n"


def test_a_unit_that_is_not_taken_stops_before_a_setpoint_is_sent(monkeypatch):
    rig = Rig().ready()
    monkeypatch.setattr(rig.twin, "set_unit", lambda name: None)
    rig.say(":UNIT:PRES MBAR")
    rig.twin._units[1] = "MBAR"
    with pytest.raises(BadReply, match="module 1 was set to PSI and says 'MBAR'"):
        rig.pace.set_pressure(5.0)
    assert not [line for line in rig.sent() if line.startswith((":SOUR:PRES 5", ":SOUR:PRES:SLEW", ":OUTP"))]


@pytest.mark.parametrize(
    ("answers", "options", "message"),
    [
        ({"ask_barometer": "1.0132500"}, {}, r"its barometer reads 1.01325 and it says it is set to PSI"),
        ({"ask_pressure": "1013.2500000"}, {}, r"it reads 1013.25 and .* range '15.00psia' ends at 15 psi"),
        ({"ask_range": '"0.70bara"'}, {}, r"high_psia = 15, but the control range '0.70bara' ends at 10.15 psia"),
        ({"ask_range": '"1600HPAG"'}, {}, r"control range is '1600HPAG', but the bench says reference = 'absolute'"),
        ({"ask_range": '""'}, {}, r"control range is '', whose name does not end in a \(absolute\) or g \(gauge\)"),
        ({"ask_range": '"BAROMETER"'}, {}, r"control range is 'BAROMETER', whose name does not end in a"),
        ({"ask_range": '"760mmHg"'}, {"reference": "gauge"}, r"control range is '760mmHg', whose name does not end"),
        ({"ask_pressure": "-3.0000000"}, {}, r"it reads -3 psia, less than a vacuum"),
        ({}, {"high_psia": 150.0}, r"high_psia = 150, but the control range '15.00psia' ends at 15 psia"),
    ],
)
def test_what_contradicts_the_unit_or_the_limits_is_refused_at_prepare(monkeypatch, answers, options, message):
    rig = Rig(**options)
    for method, answer in answers.items():
        monkeypatch.setattr(rig.twin, method, lambda answer=answer: answer)
    with pytest.raises(BadReply, match=message):
        rig.pace.prepare()


@pytest.mark.parametrize(
    ("name", "psi", "reference"),
    [
        ("15.00psia", 15.0, "absolute"),
        ("3.50barg", 50.763, "gauge"),
        ("1600HPAG", 23.206, "gauge"),
        ("7.00 bar g", None, "gauge"),
        ("760mmHg", 14.696, ""),
        ("760mmHga", 14.696, "absolute"),
        ("1000Pa", 0.14504, ""),
        ("BAROMETER", None, ""),
    ],
)
def test_names_of_control_ranges(name, psi, reference):
    found = full_scale_psi(name)
    assert found == (None if psi is None else pytest.approx(psi, rel=1e-4))
    assert reference_of(name) == reference


def test_a_barometer_that_fails_in_the_night_is_said_and_not_believed(monkeypatch):
    rig = Rig(reference="gauge").ready()
    monkeypatch.setattr(rig.twin, "ask_barometer", lambda: "2.5000000")
    state = rig.pace.read()
    assert state.faults == (
        "the barometer reads 2.5 psi, which cannot be the atmosphere; ambient_psia is used instead",
    )
    assert state.pressure_psia == pytest.approx(AIR, abs=0.02)


def test_a_pressure_below_a_vacuum_is_refused_at_every_reading(monkeypatch):
    rig = Rig().ready()
    monkeypatch.setattr(rig.twin, "ask_in_limits", lambda: "-0.4000000, 1")
    assert rig.pace.read().pressure_psia == -0.4
    monkeypatch.setattr(rig.twin, "ask_in_limits", lambda: "-0.6000000, 1")
    with pytest.raises(BadReply, match=r"it reads -0\.6 psia, less than a vacuum"):
        rig.pace.read()


@pytest.mark.parametrize("options", [{"reference": "gauge"}, {}])
def test_a_barometer_that_falls_to_0_in_the_night_is_a_fault(monkeypatch, options):
    rig = Rig(**options).ready()
    rig.pace._measures.atmosphere()
    monkeypatch.setattr(rig.twin, "ask_barometer", lambda: "0.0000000")
    rig.pace._measures.atmosphere()
    assert rig.pace.read().faults == (
        "the barometer reads 0 psi, which cannot be the atmosphere; ambient_psia is used instead",
    )
    monkeypatch.undo()
    rig.pace._measures.atmosphere()
    assert rig.pace.read().faults == ()


def test_no_gauge_setpoint_is_sent_while_the_barometer_is_wrong(monkeypatch):
    rig = Rig(reference="gauge").ready()
    monkeypatch.setattr(rig.twin, "ask_barometer", lambda: "0.0000000")
    with pytest.raises(BadReply, match="no gauge pressure is set while the barometer reads 0 psi"):
        rig.pace.set_pressure(5.0)
    assert not [line for line in rig.sent() if line.startswith((":SOUR:PRES -", ":SOUR:PRES 5", ":OUTP:STAT 1"))]


def test_gauge_pressures_without_barometer_need_the_atmosphere_given(monkeypatch):
    rig = Rig(hardware={"barometer": False}, reference="gauge")
    with pytest.raises(BadReply, match=r"barometer reads 0, and gauge pressures .* give `ambient_psia`"):
        rig.pace.prepare()
    assert rig.pace.read().faults, "nor does it go unsaid by a session that resumes"
    given = Rig(hardware={"barometer": False}, reference="gauge", ambient_psia=14.5).ready()
    assert given.pace.read().faults == ()
    given.pace.set_pressure(5.0)


def _same_header(asked, echoed):
    return same_header(asked, echoed, DruckPACE.table.wire.headers)


def test_an_answer_about_another_module_or_source_is_none_of_ours():
    assert _same_header(":SOUR:PRES:COMP1", ":SOUR:PRES:COMP1")
    assert not _same_header(":SOUR:PRES:COMP1", ":SOUR:PRES:COMP2")
    assert not _same_header(":UNIT2:PRES", ":UNIT1:PRES")
    assert _same_header(":UNIT2:PRES", ":UNIT:PRES")
    assert _same_header(":SENS:PRES", ":SENS1:PRES")
    assert _same_header(":SOUR2:PRES", ":SOUR2:PRES:LEV:IMM:AMPL")
    assert not _same_header(":SENS:PRES", ":SENS:PRES:INL")


@pytest.mark.parametrize("end", ["lf", "cr", "crlf"])
def test_line_ends_are_those_of_the_bench(end):
    rig = Rig(line_end=end).ready()
    assert rig.settle(5.0).pressure_psia == pytest.approx(5.0, abs=0.002)
    sent = {"lf": b"\n", "cr": b"\r", "crlf": b"\r\n"}[end]
    assert all(line.endswith(sent) and not line[: -len(sent)].endswith((b"\r", b"\n")) for line in rig.wire.sent())


@pytest.mark.parametrize(("set_to", "sent"), [("cr", "lf"), ("crlf", "lf"), ("crlf", "cr"), ("lf", "cr")])
def test_a_controller_set_to_another_line_end_does_not_answer(set_to, sent):
    rig = Rig(hardware={"line_end": set_to}, line_end=sent)
    with pytest.raises(NoReply, match=r"answered nothing to '\*IDN\?' within 2 s"):
        rig.pace.identify()


def test_flow_control_is_given_to_the_port():
    assert Rig(flow="rtscts").pace._line.settings.flow == "rtscts"
    assert Rig().pace._line.settings.flow == "none"


def test_clearing_the_status_clears_the_masks_and_reading_the_status_byte_clears_it():
    """K0472 revision A: pages 3-4 and 3-7, the example of page 4-103."""
    rig = Rig()
    assert rig.say("*SRE 255;FRED;*STB?") == "*STB 68\r\n"
    assert rig.say("*STB?") == "*STB 0\r\n"
    rig.say("*ESE 52")
    assert rig.say("*ESE?;*SRE?") == "*ESE 52;*SRE 255\r\n"
    assert rig.say("*CLS;*ESE?;*SRE?;*ESR?;:SYST:ERR?") == '*ESE 0;*SRE 0;*ESR 0;:SYST:ERR 0,"No error"\r\n'


def test_somebody_elses_clear_status_looks_like_a_restart():
    rig = Rig().ready()
    assert not rig.pace.restarted()
    rig.say("*CLS")
    assert rig.pace.restarted(), "the mark is gone: what was set is set again"


def test_the_manuals_status_system_tells_when_limits_are_reached():
    rig = Rig().ready()
    rig.say("*CLS;:STAT:OPER:PRES:ENAB 511;:STAT:OPER:ENAB 1024;*SRE 128")
    assert rig.say("*STB?") == "*STB 0\r\n"
    rig.settle(5.0)
    assert rig.say(":STAT:OPER?") == ":STAT:OPER:EVEN 1024\r\n"
    assert rig.say("*STB?") == "*STB 192\r\n"
    assert rig.say("*CLS;:STAT:OPER:PRES?;*SRE?") == ":STAT:OPER:PRES:EVEN 0;*SRE 0\r\n", "events and masks"


def test_what_other_clients_ask_is_answered():
    rig = Rig().ready()
    rig.settle(5.0)
    rig.say(":SOUR:PRES 8")
    rig.world.sleep(20.0)
    slew = rig.say(":SENS:PRES:SLEW?")
    assert float(slew.split()[1]) == pytest.approx(0.1, rel=0.02)
    said = rig.say(":UNIT1:PRES?;:OUTP:ISOL:STAT?;:OUTP:MODE?;:SENS:PRES:RANG?;:SOUR1:PRES:RANG?")
    assert said == (
        ':UNIT:PRES PSI;:OUTP:ISOL:STAT 0;:OUTP:MODE ACT;:SENS:PRES:RANG "15.00psia";:SOUR:PRES:RANG "15.00psia"\r\n'
    )
    assert rig.say(":OUTP:ISOL:STAT 1;:OUTP:ISOL:STAT?") == ":OUTP:ISOL:STAT 1\r\n"
    assert rig.say(":UNIT2:PRES?;:SYST:ERR?") == ':SYST:ERR -114,"Header suffix out of range"\r\n'


def test_set_pressure_checks_the_slew_before_the_setpoint_and_the_setpoint_before_control():
    rig = Rig().ready()
    rig.pace.set_pressure(2.5)
    sent = [line for line in rig.sent() if not line.startswith((":SOUR:PRES:LEV", ":UNIT:PRES?"))]
    assert sent == [
        ":UNIT:PRES PSI",
        ":SOUR:PRES:RANG?",
        ":SOUR:PRES:SLEW:MODE LIN",
        ":SOUR:PRES:SLEW 0.1",
        ":SOUR:PRES:SLEW:OVER 0",
        ":SOUR:PRES:SLEW:MODE?",
        ":SOUR:PRES:SLEW?",
        ":SOUR:PRES:SLEW:OVER?",
        ":SOUR:PRES 2.5000000",
        ":SOUR:PRES?",
        ":SOUR:PRES:RANG?",
        ":OUTP:STAT 1",
    ]


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ("set_slew_mode", r"SLEW:MODE\? should answer LIN and answers 'MAX'"),
        ("set_overshoot", r"SLEW:OVER\? should answer 0"),
    ],
)
def test_a_slew_mode_or_overshoot_that_is_not_taken_stops_before_a_setpoint(monkeypatch, method, message):
    rig = Rig().ready()
    rig.twin.power_cycle()  # fastest slew, overshoot allowed
    monkeypatch.setattr(rig.twin, method, lambda value: None)
    with pytest.raises(BadReply, match=message):
        rig.pace.set_pressure(5.0)
    assert not [line for line in rig.sent() if line.startswith((":SOUR:PRES 5", ":OUTP"))]


def test_it_slews_at_its_rate_and_settles_in_limits():
    rig = Rig(slew_psi_per_s=0.05).ready()
    began = rig.world.now()
    rig.pace.set_pressure(10.0)
    rig.world.sleep(20.0)
    under_way = rig.pace.read()
    assert under_way.controlling
    assert not under_way.in_limits
    assert under_way.pressure_psia == pytest.approx(AIR - 0.05 * (rig.world.now() - began - 1.5), abs=0.05)
    state = rig.wait(lambda s: s.in_limits)
    assert state.pressure_psia == pytest.approx(10.0, abs=0.0016)
    assert state.setpoint_psia == 10.0
    assert rig.world.now() - began == pytest.approx((AIR - 10.0) / 0.05 + 2.0 + 1.5 * 4, abs=6.0)


def test_the_old_setpoints_in_limits_flag_does_not_count_for_the_new_one():
    rig = Rig().ready()
    rig.settle(5.0)
    rig.twin.ask_in_limits = lambda: "5.0000000, 1"  # a controller that is slow to notice
    rig.pace.set_pressure(6.0)
    assert not rig.pace.read().in_limits


@pytest.mark.parametrize("psia", [-0.01, 15.01, float("nan"), float("inf")])
def test_limits_are_checked_before_anything_is_sent(psia):
    rig = Rig().ready()
    with pytest.raises(LimitError, match="outside 0 to 15"):
        rig.pace.set_pressure(psia)
    assert rig.wire.sent() == []


def test_stop_holds_where_it_is():
    rig = Rig().ready()
    rig.pace.set_pressure(5.0)
    rig.world.sleep(20.0)
    rig.pace.stop()
    held = rig.wait(lambda s: s.in_limits)
    assert 10.0 < held.pressure_psia < 13.0
    assert held.setpoint_psia == pytest.approx(held.pressure_psia, abs=0.002)
    idle = Rig().ready()
    idle.pace.stop()
    assert not idle.line.controlling


def test_a_unit_changed_at_the_front_panel_does_not_change_what_is_read_or_set():
    rig = Rig().ready()
    rig.settle(5.0)
    rig.say(":UNIT:PRES MBAR")
    state = rig.pace.read()
    assert state.pressure_psia == pytest.approx(5.0, abs=0.002)
    assert state.setpoint_psia == pytest.approx(5.0, abs=1e-6)
    assert rig.settle(6.0).pressure_psia == pytest.approx(6.0, abs=0.002)
    rig.say(":UNIT:PRES INHG")
    with pytest.raises(BadReply, match="unknown unit 'INHG'; set it to PSI"):
        rig.pace.read()


def test_gauge_pressures_are_counted_from_the_barometer():
    rig = Rig(reference="gauge").ready()
    assert rig.pace.read().pressure_psia == pytest.approx(AIR, abs=1e-4)
    state = rig.settle(5.0)
    assert state.pressure_psia == pytest.approx(5.0, abs=0.002)
    assert f":SOUR:PRES {5.0 - AIR:.7f}"[:-2] in " ".join(rig.sent())
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(5.0, abs=0.002)


def test_without_a_barometer_the_bench_says_what_the_atmosphere_is():
    rig = Rig(hardware={"barometer": False}, reference="gauge", ambient_psia=14.5).ready()
    assert rig.pace.read().pressure_psia == pytest.approx(14.5, abs=1e-4)


def test_a_range_that_counts_from_something_else_is_refused():
    with pytest.raises(BadReply, match=r"control range is '15.00psig', but the bench says reference = 'absolute'"):
        Rig(hardware={"reference": "gauge"}).pace.prepare()


def test_a_control_range_changed_at_the_panel_is_neither_read_nor_set(monkeypatch):
    rig = Rig(replace(TRUTH, start_psia=AIR)).ready()
    rig.pace.read()
    rig.twin._gauge = True  # 15.00psig: the line at the atmosphere reads 0
    rig.wire.log.clear()
    with pytest.raises(BadReply, match=r"control range is '15.00psig' \(gauge\); it was '15.00psia' when it was prep"):
        rig.pace.read()
    with pytest.raises(BadReply, match=r"15.00psig"):
        rig.pace.set_pressure(3.0)
    assert not [line for line in rig.sent() if line.startswith((":SOUR:PRES 3", ":OUTP:STAT 1"))]
    rig.twin._gauge = False
    monkeypatch.setattr(rig.twin, "ask_range", lambda: '"35.00bara"')
    with pytest.raises(BadReply, match=r"35.00bara"):
        rig.pace.read()
    monkeypatch.setattr(rig.twin, "ask_range", lambda: '"0.70bara"')
    with pytest.raises(BadReply, match="high_psia = 15, but the control range"):
        rig.pace.prepare()
    with pytest.raises(BadReply, match=r"0.70bara"):  # what prepare refuses has not become the one prepared
        rig.pace.read()


def test_a_control_range_changed_under_pressure_does_not_keep_it_from_being_made_safe():
    rig = Rig(vent_psi_per_s=0.5).ready()
    rig.settle(5.0)
    rig.twin._gauge = True
    rig.pace.make_safe()
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(AIR, abs=0.02)
    assert not rig.line.controlling
    rig = Rig().ready()
    rig.settle(5.0)
    rig.twin._gauge = True
    rig.pace.stop()
    rig.world.sleep(60.0)
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(5.0, abs=0.01)


def test_a_control_range_that_was_not_taken_is_refused(monkeypatch):
    rig = Rig(control_range="2.00bara")
    monkeypatch.setattr(rig.twin, "set_range", lambda name: None)
    with pytest.raises(BadReply, match=r"control range '2.00bara' was selected and it says '15.00psia'"):
        rig.pace.prepare()


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda twin: twin.set_unit("BAR"), "was set to PSI and says 'BAR'"),
        (lambda twin: setattr(twin, "_gauge", True), "range was '15.00psia' and is '15.00psig' after the setpoint"),
    ],
)
def test_a_unit_or_range_changed_just_before_the_setpoint_leaves_control_off(monkeypatch, change, message, held):
    rig = Rig(replace(TRUTH, start_psia=0.5)).ready()
    if held:
        rig.settle(0.5)
    take = rig.twin.set_setpoint

    def changed_first(value):
        change(rig.twin)
        take(value)

    monkeypatch.setattr(rig.twin, "set_setpoint", changed_first)
    with pytest.raises(BadReply, match=message):
        rig.pace.set_pressure(1.0)  # 14.5 psi, in bar
    assert not rig.line.controlling
    rig.world.sleep(60.0)
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(0.5, abs=0.2)


def test_resuming_does_not_disturb_a_pressure_under_control():
    rig = Rig().ready()
    rig.settle(5.0)
    again = DruckPACE("pace", rig.pace._line.address, DruckPACE.Options(), rig.wires, rig.world)
    assert not again.restarted()
    assert again.read().in_limits
    again.prepare()
    state = again.read()
    assert state.in_limits
    assert state.setpoint_psia == 5.0
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(5.0, abs=0.002)


def test_a_power_cut_is_noticed_until_it_has_been_prepared_again():
    rig = Rig()
    assert rig.pace.restarted()
    rig.ready()
    assert not rig.pace.restarted()
    rig.settle(5.0)
    rig.twin.power_cycle()
    assert rig.pace.restarted()
    assert rig.pace.restarted(), "asking does not use the evidence up"
    state = rig.pace.read()
    assert not state.controlling
    assert state.pressure_psia == pytest.approx(5.0, abs=0.01), "in bar now, and understood"
    rig.pace.prepare()
    assert not rig.pace.restarted()


# --- vent and safe state


def test_a_vent_slews_to_the_atmosphere_and_then_opens():
    rig = Rig(vent_psi_per_s=0.5).ready()
    rig.settle(5.0)
    rig.pace.vent()
    began = rig.world.now()
    pressures = []
    while (state := rig.pace.read()).venting:
        pressures.append((rig.world.now(), rig.line.pressure_psia(rig.world.now())))
        assert not state.in_limits
        rig.world.sleep(0.5)
    rates = [abs(b - a) / (t1 - t0) for (t0, a), (t1, b) in itertools.pairwise(pressures)]
    assert max(rates[: int(0.9 * len(rates))]) <= 0.51
    assert rig.world.now() - began < (AIR - 5.0) / 0.5 + 20.0
    assert state.pressure_psia == pytest.approx(AIR, abs=0.02)
    assert not state.controlling
    assert state.faults == ()


def test_a_new_setpoint_gives_up_a_vent():
    rig = Rig().ready()
    rig.settle(5.0)
    rig.pace.vent()
    assert rig.settle(4.0).pressure_psia == pytest.approx(4.0, abs=0.002)
    rig.say(":SOUR:VENT 1")  # somebody at the front panel
    assert rig.pace.read().venting
    assert rig.settle(4.0).pressure_psia == pytest.approx(4.0, abs=0.002)
    assert ":SOUR:PRES:LEV:IMM:AMPL:VENT 0" in rig.sent()


@pytest.mark.parametrize("start", [0.01, 5.0, 14.0])
def test_make_safe_leaves_the_line_at_the_atmosphere_and_control_off(start):
    rig = Rig().ready()
    rig.settle(start)
    began = rig.world.now()
    rig.pace.make_safe()
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(AIR, abs=0.02)
    assert not rig.twin.output
    assert rig.world.now() - began < 1.5 * AIR / 0.2 + 120.0
    again = rig.world.now()
    rig.pace.make_safe()
    assert rig.world.now() - again < 10.0
    assert not rig.twin.output


def test_make_safe_works_in_a_unit_that_nobody_understands():
    rig = Rig().ready()
    rig.settle(5.0)
    rig.say(":UNIT:PRES INHG")
    rig.pace.make_safe()
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(AIR, abs=0.02)


def test_make_safe_works_without_having_prepared_and_after_errors():
    rig = Rig()
    rig.say(":UNIT:PRES PSI;:SOUR:PRES 5;:OUTP 1;" + ";".join([":FRED"] * 9))
    rig.world.sleep(60.0)
    rig.pace.make_safe()
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(AIR, abs=0.02)
    assert not rig.twin.output


@pytest.mark.parametrize("ending", ["make_safe", "set_pressure"])
def test_after_a_power_cut_nothing_goes_faster_than_it_should(ending):
    rig = Rig().ready()
    rig.settle(5.0)
    rig.twin.power_cycle()
    began = rig.world.now()
    here = rig.line.pressure_psia(began)
    seen = []
    rig.world.call_in(20.0, lambda: seen.append(rig.line.pressure_psia(rig.world.now())))
    if ending == "make_safe":
        rig.pace.make_safe()
    else:
        rig.pace.set_pressure(14.0)
        rig.world.sleep(30.0)
    assert here + 1.0 < seen[0] < here + 20.0 * 0.2


@pytest.mark.parametrize(("baud", "frame"), [(19200, "7E1"), (9600, "8O1"), (115200, "8N1")])
def test_other_rates_and_frames(baud, frame):
    assert Rig(baud=baud, frame=frame).ready().settle(12.0).setpoint_psia == 12.0


def test_make_safe_vents_even_when_the_supply_is_lost():
    rig = Rig(replace(TRUTH, supply_lost_h=0.0)).ready()
    rig.settle(5.0)
    rig.pace.make_safe()
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(AIR, abs=0.02)


def test_make_safe_vents_a_range_that_ends_below_the_atmosphere():
    rig = Rig().ready()
    rig.settle(5.0)
    accept = rig.twin.set_setpoint
    rig.twin.set_setpoint = lambda value: accept(value if float(value) < 6.0 else "9999")
    rig.pace.make_safe()
    assert rig.line.pressure_psia(rig.world.now()) == pytest.approx(AIR, abs=0.02)


def test_pressure_left_behind_is_said_and_make_safe_ends():
    rig = Rig().ready()
    rig.settle(5.0)
    rig.line.vent = lambda now, rate: rig.line.control_off(now)  # a blocked vent port
    rig.line.command = lambda *a, **k: None
    began = rig.world.now()
    with pytest.raises(NotReady, match=r"still at 5\.0\d\d psia: pressure may be trapped; open the line by hand"):
        rig.pace.make_safe()
    assert rig.world.now() - began < 1.5 * 10.0 / 0.2 + 180.0
    assert not rig.twin.output


def test_a_vent_that_ends_with_pressure_in_the_line_is_a_fault_until_the_next_command():
    rig = Rig().ready()
    rig.settle(14.5)
    rig.pace.vent()
    rig.line.control_off(rig.world.now())
    rig.line._stretches[-1] = replace(rig.line._stretches[-1], begin=5.0)
    state = rig.wait(lambda s: not s.venting)
    assert "pressure may be trapped" in state.faults[0]
    rig.pace.set_pressure(14.5)
    assert rig.pace.read().faults == ()


# --- faults


def test_a_lost_vacuum_is_named_for_the_technician():
    rig = Rig(replace(TRUTH, vacuum_lost_h=0.1)).ready()
    rig.settle(0.12)
    rig.world.sleep(400.0)
    state = rig.pace.read()
    assert len(state.faults) == 1
    assert state.faults[0].startswith("vacuum lost: the vacuum port reads 14.696 psia and the setpoint is 0.120 psia")
    assert "check vacuum pump" in state.faults[0]


def test_a_lost_supply_is_named_too_and_gone_when_it_is_back():
    rig = Rig(replace(TRUTH, supply_lost_h=0.03, supply_back_h=0.2, start_psia=1.0, ambient_psia=12.0)).ready()
    rig.settle(5.0)
    rig.pace.set_pressure(14.9)
    state = rig.wait(lambda s: s.faults)
    assert state.faults[0].startswith("supply pressure lost: the supply port reads 12.000 psia")
    assert not state.in_limits
    assert rig.wait(lambda s: s.in_limits).faults == ()


def test_a_fast_slew_with_its_valves_open_is_no_fault():
    rig = Rig(slew_psi_per_s=5.0).ready()
    rig.pace.set_pressure(1.0)
    rig.world.sleep(2.5)
    state = rig.pace.read()
    assert state.effort_pct < -80.0
    assert state.faults == ()


def test_a_refused_setting_carries_the_instruments_words():
    rig = Rig()
    with pytest.raises(InstrumentError, match="reports error -222: Data out of range"):
        rig.pace._pace.send(":SOUR:PRES:INL 400")


def test_old_errors_and_a_full_queue_are_not_this_sessions():
    rig = Rig()
    rig.say(";".join([":FRED"] * 9))
    rig.ready()
    rig.settle(5.0)


def test_an_overflowing_queue_is_emptied_and_told_in_one_error():
    rig = Rig().ready()
    rig.say(";".join([":FRED"] * 9))
    with pytest.raises(InstrumentError, match=r"error -113: Undefined header; then -113 .*; then -350 Queue overflow"):
        rig.pace.set_pressure(5.0)
    rig.pace.set_pressure(5.0)


def test_a_garbled_header_is_asked_again_once():
    rig = Rig().ready()
    garbled = iter([b":SENS:PR#S:INL 14.6959490, 0\r\n", b":SENS:PRES:IN\xff 14.6959490, 0\r\n"])
    original = rig.twin.on_rx

    def on_rx(data, tx):
        spoilt = next(garbled, None) if data.startswith(b":SENS:PRES:INL?") else None
        original(data, (lambda answer: tx(spoilt)) if spoilt else tx)

    rig.twin.on_rx = on_rx
    with pytest.raises(BadReply):
        rig.pace.read()
    assert rig.pace.read().pressure_psia == pytest.approx(AIR, abs=1e-4)


def test_a_late_answer_is_not_taken_for_the_next_one():
    rig = Rig(timeout_s=0.5).ready()
    original = rig.twin.on_rx
    late = iter([2.0])

    def on_rx(data, tx):
        delay = next(late, 0.0) if data.startswith(b":UNIT:PRES?") else 0.0
        original(data, lambda answer: rig.world.call_in(delay, lambda: tx(answer)) if delay else tx(answer))

    rig.twin.on_rx = on_rx
    state = rig.pace.read()
    assert state.pressure_psia == pytest.approx(AIR, abs=1e-4)
    assert rig.pace._line.retries >= 1


def test_an_answer_to_another_question_is_recognised_by_its_header():
    rig = Rig().ready()
    rig.settle(5.0)
    rig.twin.reply, kept = (lambda row, answer: ":SENS:PRES 5.0000000"), rig.twin.reply
    with pytest.raises(BadReply, match=r"answered ':SENS:PRES 5.0000000' to ':UNIT:PRES\?'"):
        rig.pace.read()
    rig.twin.reply = kept
    assert rig.pace.read().in_limits


def test_headers_may_be_switched_off():
    rig = Rig()
    rig.twin.reply = lambda row, answer: answer
    rig.ready()
    assert rig.settle(5.0).pressure_psia == pytest.approx(5.0, abs=0.002)


def test_silence_is_named():
    rig = Rig()
    rig.twin.on_rx = lambda data, tx: None
    with pytest.raises(NoReply, match=r"pace at sim://.* answered nothing"):
        rig.pace.identify()


@pytest.mark.parametrize(
    "options",
    [{"slew_psi_per_s": 0}, {"in_limits_s": 1}, {"module": 3}, {"low_psia": 5, "high_psia": 5}, {"reference": "psia"}],
)
def test_options_are_checked(options):
    with pytest.raises(ValidationError):
        DruckPACE.Options(**options)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(st.floats(0.01, 14.9), st.floats(0.0, 120.0)), min_size=1, max_size=4), st.integers(1, 5))
def test_polling_changes_no_pressure(script, polls):
    """The same commands at the same times, looked at or not."""
    seen, alone = Rig().ready(), Rig().ready()
    alone.world.sleep(seen.world.now() - alone.world.now())
    for psia, wait in script:
        start = max(seen.world.now(), alone.world.now())
        for rig in (seen, alone):
            rig.world.sleep(start - rig.world.now())
            rig.pace.set_pressure(psia)
        for _ in range(polls):
            seen.pace.read()
            seen.world.sleep(wait / polls)
    end = max(seen.world.now(), alone.world.now()) + 10.0
    for rig in (seen, alone):
        rig.world.sleep(end - rig.world.now())
    assert seen.line.pressure_psia(end) == alone.line.pressure_psia(end)
    assert seen.twin.in_limits == alone.twin.in_limits


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.sampled_from([*"0123456789;:? ,\n", "SOUR", "PRES", "VENT 1", "OUTP 1", "nan", "\xff", '"']), max_size=30
    )
)
def test_whatever_arrives_it_goes_on(words):
    rig = Rig()
    rig.twin.on_rx("".join(words).encode("latin-1") + b"\n", lambda answer: None)
    rig.world.sleep(1.0)
    assert "Pace5000" in rig.say("*IDN?")


# --- changed at its panel, asked before and after the readings of every point


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda twin: twin.set_unit("BAR"), ":UNIT:PRES? answers BAR, not PSI"),
        (lambda twin: twin.set_setpoint("9.2"), ":SOUR:PRES? answers 9.2000000, not 7.5"),
        (lambda twin: twin.set_slew("MAX"), ":SOUR:PRES:SLEW? answers 5.0000000, not 0.1"),
        (lambda twin: twin.set_slew_mode("MAX"), ":SOUR:PRES:SLEW:MODE? answers MAX, not LIN"),
        (lambda twin: twin.set_overshoot("1"), ":SOUR:PRES:SLEW:OVER? answers 1, not 0"),
        (lambda twin: twin.set_band("1"), ":SOUR:PRES:INL? answers 1.0000000, not 0.01"),
        (lambda twin: twin.set_band_time("9"), ":SOUR:PRES:INL:TIME? answers 9, not 2"),
        (lambda twin: twin.set_output("0"), ":OUTP:STAT? answers 0, not 1"),
        (lambda twin: setattr(twin, "_mode", "GAUG"), ":OUTP:MODE? answers GAUG, not ACT"),
    ],
)
def test_it_says_what_was_changed_at_its_panel_and_is_right_again_when_it_is_set_again(change, said):
    rig = Rig(slew_psi_per_s=0.1, in_limits_s=2).ready()
    assert isinstance(rig.pace, SelfChecking)
    rig.settle(7.5)
    assert rig.pace.wrong() == []
    change(rig.twin)
    assert rig.pace.wrong() == [said]
    rig.pace.prepare()
    rig.pace.set_pressure(7.5)
    assert rig.pace.wrong() == []


def test_another_control_range_is_told_by_its_name():
    rig = Rig().ready()
    rig.twin.ask_range = lambda: '"35.00psia"'
    assert rig.pace.wrong() == [':SOUR:PRES:RANG? answers "35.00psia", not 15.00psia']


def test_what_its_own_driver_changes_is_not_wrong():
    rig = Rig().ready()
    rig.settle(7.5)
    rig.pace.stop()
    assert rig.pace.wrong() == []
    rig.pace.make_safe()
    rig.pace.prepare()
    assert rig.pace.wrong() == []
