"""The ESP301 driver and twin: the manual's commands on the wire, homing, limits, errors, and an independent client."""

from __future__ import annotations

import pytest
from pydantic import ValidationError
from serial_bench import FakePlant, plug_in, wires

from rig.drivers.errors import BadReply, InstrumentError, LimitError, NotReady, WrongInstrument
from rig.drivers.newport_esp301 import NewportESP301
from rig.drivers.roles import Head, SelfChecking
from rig.sims.twins.newport_esp301 import NewportESP301Twin
from rig.sims.world import World


class Rig:
    def __init__(self, **options):
        self.world = World()
        self.plant = FakePlant(self.world)
        self.twin = NewportESP301Twin("head", options, self.world, self.plant, "SN000042")
        self.address = plug_in(self.world, self.twin)
        self.wires, self.wire = wires(self.world)
        checked = NewportESP301.Options(**options)
        self.head = NewportESP301("head", self.address, checked, self.wires, self.world)

    def until_still(self):
        for _ in range(1000):
            states = self.head.read()
            if not any(s.moving for s in states.values()):
                return states
            self.world.sleep(0.5)
        raise AssertionError("never came to rest")

    def ready(self):
        self.head.prepare()
        self.head.home()
        self.until_still()
        self.wire.log.clear()
        return self


def test_it_is_a_head():
    assert isinstance(Rig().head, Head)


def test_nothing_is_sent_on_opening():
    rig = Rig()
    rig.world.sleep(1.0)
    assert rig.wire.log == []


def test_another_controller_is_refused():
    rig = Rig()
    rig.twin._execute_without_axis = lambda mnemonic: "SMC100 v2"
    with pytest.raises(WrongInstrument, match=r"head at sim://.* should be a Newport ESP301; it answers 'SMC100 v2'"):
        rig.head.identify()


def test_prepare_sets_and_reads_back_every_setting():
    rig = Rig(pitch_deg=(-95.0, 100.0), speed_deg_per_s=5.0)
    rig.head.prepare()
    assert rig.wire.sent()[:5] == [
        b"TB?\r",
        b"1MO;1SN7;1VA5;1AC16;1AG16;1OH4;1SL-95;1SR100\r",
        b"TB?\r",
        b"1MO?;1SN?;1VA?;1AC?;1AG?;1OH?;1SL?;1SR?\r",
        b"2MO;2SN7;2VA5;2AC16;2AG16;2OH4;2SL-190;2SR190\r",
    ]
    assert all(len(line) <= 80 for line in rig.wire.sent())
    assert rig.plant.head.commands == []


def test_a_unit_or_a_limit_that_was_changed_at_its_panel_is_told():
    """It is asked before and after the readings of every point (`rig.drivers.roles.SelfChecking`)."""
    rig = Rig().ready()
    assert isinstance(rig.head, SelfChecking)
    assert rig.head.wrong() == []
    assert rig.wire.sent() == [b"1SN?;1SL?;1SR?;2SN?;2SL?;2SR?\r"]
    rig.twin._axes[2].values["SN"] = 10.0
    rig.twin._axes[1].values["SR"] = 45.0
    units, limits = sorted(rig.head.wrong(), reverse=True)
    assert "2SN? is 10 and should be 7" in units
    assert "1SR? is 45 and should be 190" in limits
    rig.head.prepare()
    assert rig.head.wrong() == []


def test_no_line_is_longer_than_the_controller_takes():
    """80 characters (manual, page 3-8), whatever digits the bench file has."""
    rig = Rig(
        speed_deg_per_s=8.12345678,
        acceleration_deg_per_s2=16.1234567,
        home_speed_deg_per_s=4.12345678,
        pitch_deg=(-179.123456, 179.123456),
        roll_deg=(-179.123456, 179.123456),
        line_end="crlf",
    )
    rig.head.prepare()
    assert max(map(len, rig.wire.sent())) <= 80
    assert rig.twin._axes[2].values["SR"] == pytest.approx(179.123456)


def test_the_controller_refuses_a_line_of_more_than_80_characters():
    rig = Rig()
    line = rig.head._line
    line.write("1SR100".rjust(80))
    assert [line.query("1SR?"), line.query("TB?").partition(",")[0]] == ["100", "0"]
    line.write("1SR200".rjust(81))
    assert [line.query("1SR?"), line.query("TB?").partition(",")[0]] == ["100", "6"]


def test_the_controller_answers_what_other_clients_ask():
    """Axes of two digits as EPICS writes them; statuses in the forms of the manual's examples."""
    rig = Rig()
    line = rig.head._line
    assert [line.query(q) for q in ("01SN?", "01ZB?", "01SU?", "01MD", "01MO?")] == ["7", "300H", "0.0001", "1", "0"]
    assert line.query("TS") == "@"
    line.write("01MO;01PA20.000000;")
    rig.world.sleep(1.0)
    assert [line.query("TS"), line.query("TX")] == ["Q", "P"]
    assert float(line.query("1TV")) == pytest.approx(4.0)
    rig.world.sleep(10.0)
    assert [line.query("TS"), line.query("TX"), float(line.query("1TV"))] == ["P", "@", 0.0]
    first, second = line.query("01PH").split(",")
    assert first.endswith("H")
    assert [int(word.strip().removesuffix("H"), 16) for word in (first, second)] == [0x18000000, 0]
    asked = [f"1{name}?" for name in ("ZA", "ZE", "ZH", "ZF", "ZS", "QM", "FE", "AE", "DH", "VB")]
    assert all(line.query(question) for question in asked)
    line.write("1ZH0F25H")
    assert line.query("1ZH?") == "F25H"
    line.write("1ZHF25H")
    assert line.query("TB?").partition(",")[0] == "6", "a letter first is taken for a command"
    assert line.query("TB?").partition(",")[0] == "0"


def test_limits_are_sent_with_all_their_digits():
    rig = Rig(roll_deg=(-179.98765, 180.00001))
    rig.head.prepare()
    assert b"2MO;2SN7;2VA8;2AC16;2AG16;2OH4;2SL-179.98765;2SR180.00001\r" in rig.wire.sent()


def test_a_limit_that_reads_back_otherwise_is_reported():
    rig = Rig()
    rig.twin._set = lambda axis, number, name, parameter, text: axis.values.update({name: min(180.0, float(text))})
    with pytest.raises(BadReply, match="pitch was set to SR 190 and reads back 180"):
        rig.head.prepare()


def test_prepare_reports_a_setting_the_stage_cannot_do():
    rig = Rig(speed_deg_per_s=60.0)
    with pytest.raises(InstrumentError, match="error 110: AXIS-1 MAXIMUM VELOCITY EXCEEDED") as caught:
        rig.head.prepare()
    assert caught.value.code == 110


def test_homing_marks_the_axes_and_survives_a_new_driver_but_not_a_power_cycle():
    rig = Rig()
    rig.head.prepare()
    assert not any(s.homed for s in rig.head.read().values())
    rig.head.home()
    moving = rig.head.read()
    assert all(s.moving and not s.homed for s in moving.values())
    states = rig.until_still()
    assert all(s.homed and s.enabled and not s.fault for s in states.values())
    assert [s.position_deg for s in states.values()] == pytest.approx([0.0, 0.0], abs=1e-3)
    assert rig.plant.head.encoder_deg("pitch", rig.world.now()) == pytest.approx(0.0, abs=1e-9)
    rig.wires.close()
    again = NewportESP301("head", rig.address, NewportESP301.Options(), rig.wires, rig.world)
    assert all(s.homed for s in again.read().values())
    rig.twin.power_cycle()
    assert not any(s.homed or s.enabled for s in again.read().values())


def test_a_power_cut_just_before_the_motors_are_switched_on_again_is_not_hidden_by_that():
    rig = Rig().ready()
    assert all(s.homed for s in rig.head.read().values())
    rig.twin.power_cycle()
    rig.head.prepare()
    states = rig.head.read()
    assert all(s.enabled for s in states.values())
    assert not any(s.homed for s in states.values())


def test_a_search_that_has_not_begun_to_move_is_not_taken_for_one_that_ended_at_zero():
    """After power-on the count is zero wherever the axis stands."""
    rig = Rig()
    rig.head.prepare()
    rig.twin._search_home = lambda axis, number, text: None
    rig.twin._commands["OR"] = rig.twin._search_home
    rig.head.home()
    early = rig.head.read()
    assert early["pitch"].position_deg == 0.0
    assert early["pitch"].moving
    assert not early["pitch"].homed


def test_the_home_mark_alone_does_not_come_from_an_interrupted_search():
    rig = Rig()
    rig.head.prepare()
    rig.head.home()
    rig.world.sleep(1.0)
    rig.head.stop()
    states = rig.until_still()
    assert not any(s.homed for s in states.values())
    assert states["pitch"].fault == "AXIS-1 HOMING ABORTED (error 120)"


def test_a_controller_switched_off_in_a_search_has_not_found_its_zero():
    """It stands still at what it calls zero; somebody may even have switched the motors on again."""
    rig = Rig()
    rig.head.prepare()
    rig.head.home()
    rig.world.sleep(1.0)
    rig.twin.power_cycle()
    states = rig.until_still()
    assert states["pitch"].position_deg == 0.0
    assert not any(s.homed for s in states.values())
    rig.head.home()
    rig.world.sleep(1.0)
    rig.twin.power_cycle()
    rig.head.prepare()
    states = rig.until_still()
    assert all(s.enabled for s in states.values())
    assert not any(s.homed for s in states.values())


def test_move_starts_both_axes_with_one_line():
    rig = Rig().ready()
    rig.head.move({"pitch": 12.5, "roll": -30.0})
    assert rig.wire.sent() == [b"1PA12.50000;2PA-30.00000\r"]
    states = rig.until_still()
    assert [s.position_deg for s in states.values()] == pytest.approx([12.5, -30.0], abs=1e-4)
    assert rig.plant.head.commands[-2:] == [("pitch", 12.5, 8.0, 16.0), ("roll", -30.0, 8.0, 16.0)]


def test_read_is_one_exchange_while_moving():
    rig = Rig().ready()
    rig.head.move({"pitch": 12.5})
    rig.world.sleep(0.5)
    rig.wire.log.clear()
    states = rig.head.read()
    assert rig.wire.sent() == [b"1MO?;1MD?;1TP?;2TP?;2MD?;2MO?\r"]
    assert states["pitch"].moving
    assert not states["roll"].moving


def test_errors_are_asked_for_once_after_motion_ends():
    rig = Rig().ready()
    rig.head.move({"pitch": 1.0})
    rig.until_still()
    rig.head.read()
    rig.head.read()
    assert rig.wire.sent().count(b"TB?\r") == 1


@pytest.mark.parametrize("target", [190.001, -190.001, float("nan"), float("inf")])
def test_targets_outside_the_limits_are_refused_before_anything_is_sent(target):
    rig = Rig().ready()
    with pytest.raises(LimitError, match=r"roll to .* deg is outside -190 to 190"):
        rig.head.move({"pitch": 0.0, "roll": target})
    assert rig.wire.sent() == []


def test_an_axis_that_is_not_homed_does_not_move():
    rig = Rig()
    rig.head.prepare()
    with pytest.raises(NotReady, match="pitch must be homed"):
        rig.head.move({"pitch": 1.0})
    assert rig.plant.head.commands == []


def test_stop_stops_all_axes():
    rig = Rig().ready()
    rig.head.move({"pitch": 90.0, "roll": 90.0})
    rig.world.sleep(2.0)
    rig.head.stop()
    states = rig.until_still()
    assert b"1ST;2ST\r" in rig.wire.sent()
    assert all(0 < s.position_deg < 80 for s in states.values())


def test_a_motor_that_goes_off_is_a_fault_of_its_axis():
    rig = Rig().ready()
    rig.twin._axes[2].powered = False
    rig.twin._fail(203)
    states = rig.head.read()
    assert not states["roll"].enabled
    assert states["roll"].fault == "AXIS-2 FOLLOWING ERROR THRESHOLD EXCEEDED (error 203)"
    assert states["pitch"].fault == ""
    assert rig.head.read()["roll"].fault, "the fault stays until the head is prepared again"
    rig.head.prepare()
    assert rig.head.read()["roll"].fault == ""


def test_an_error_of_no_axis_is_raised():
    rig = Rig().ready()
    rig.twin._fail(6)
    rig.head.move({"pitch": 0.0})
    with pytest.raises(InstrumentError, match="error 6: COMMAND DOES NOT EXIST"):
        rig.until_still()


@pytest.mark.parametrize(
    ("commands", "code"),
    [
        ("1XX", 6),
        ("1VA-1", 7),
        ("3TP?", 9),
        ("TP?", 37),
        ("1PA", 38),
        ("1PA1", 113),
        ("1MO;1PA361", 106),
        ("1MO;1PA-361", 107),
        ("2VA41", 210),
        ("2AC161", 211),
        ("1MO;1OR1;1PA1", 130),
    ],
)
def test_the_controller_refuses_with_the_manuals_error_numbers(commands, code):
    rig = Rig()
    line = rig.head._line
    line.write(commands)
    assert line.query("TE?") == str(code)
    assert line.query("TE?") == "0"


def test_the_error_queue_keeps_the_last_ten():
    rig = Rig()
    rig.head._line.write(";".join(["1XX"] * 4 + ["3TP"] * 8))
    codes = [rig.head._line.query("TE?") for _ in range(11)]
    assert codes == ["6"] * 2 + ["9"] * 8 + ["0"]


def test_pitch_and_roll_may_be_on_other_axes():
    rig = Rig(pitch_axis=3, roll_axis=1).ready()
    rig.head.move({"pitch": 2.0})
    assert rig.wire.sent() == [b"3PA2.00000\r"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"pitch_axis": 2}, "both 2"),
        ({"pitch_deg": (10, -10)}, "10 is not below -10"),
        ({"speed": 3}, "speed"),
        ({"speed_deg_per_s": 0}, "greater than 0"),
    ],
)
def test_options_are_checked(options, words):
    with pytest.raises(ValidationError, match=words):
        NewportESP301.Options(**options)


@pytest.mark.parametrize("command", ["forget_zeros", "home", "move", "prepare", "stop"])
def test_axes_that_stand_are_read_once_and_again_after_every_command(command):
    """The same answers have another meaning after a command; every reading is asked of the controller."""
    rig = Rig().ready()
    rig.head.read()
    before = len(rig.wire.sent())
    standing = rig.head.read()
    assert rig.head.read() is standing
    assert len(rig.wire.sent()) == before + 2
    if command == "move":
        rig.head.move({axis: state.position_deg for axis, state in standing.items()})
    else:
        getattr(rig.head, command)()
    assert rig.head.read() is not standing


def test_zeros_that_are_forgotten_are_unknown_although_the_axes_answer_as_before():
    rig = Rig().ready()
    rig.head.read()
    assert all(state.homed for state in rig.head.read().values())
    rig.head.forget_zeros()
    assert not any(state.homed for state in rig.head.read().values())


def test_an_error_at_a_stop_is_noticed_although_the_axes_answer_as_before():
    rig = Rig().ready()
    rig.head.read()
    assert not any(state.fault for state in rig.head.read().values())
    rig.twin._fail(103)
    rig.head.stop()
    assert "FOLLOWING ERROR" in rig.head.read()["pitch"].fault
    assert "FOLLOWING ERROR" in rig.head.read()["pitch"].fault
