"""What goes wrong on a simulated bench: every kind on every instrument it may hit, and what the driver makes of it."""

from __future__ import annotations

import tomllib

import pytest
from faulty_bench import ATTITUDE, PRESSURE, faulty, up

from rig.bench.config import parse_bench
from rig.drivers.errors import DriverError
from rig.drivers.wires.modbus import float_of_words
from rig.errors import ConfigurationError
from rig.sims.faults import Fault, kinds_of, read_faults
from rig.sims.physics import WorldError
from rig.simulated.dry_run import DryBench, twin_class

SERIAL, MODBUS, CAN = ("esp301", "dvm", "scanner", "pace"), ("enclosure", "chamber"), ("cia402", "daq")
METERS = ("dvm", "scanner")
ASKS = 4
EVERYTHING = (*SERIAL, *MODBUS, *CAN)

# (kind, options, times or None, instruments): what may come of asking ASKS times, besides the right answer.
Row = tuple[str, dict[str, object], tuple[str, ...], set[str]]
WIRES: list[Row] = [
    ("no-reply", {}, EVERYTHING, {"NoReply"}),
    ("no-reply", {"times": 3}, EVERYTHING, {"NoReply"}),
    ("no-reply", {"lost": "request"}, EVERYTHING, {"NoReply", "BadReply"}),
    ("no-reply", {"lost": "request", "times": 3}, EVERYTHING, {"NoReply", "BadReply"}),
    ("late-reply", {}, EVERYTHING, {"NoReply", "BadReply"}),
    ("late-reply", {"times": 3}, EVERYTHING, {"NoReply", "BadReply"}),
    ("late-reply", {"delay_s": 31.0}, EVERYTHING, {"NoReply", "BadReply"}),
    ("late-reply", {"delay_s": 1.1}, EVERYTHING, {"NoReply", "BadReply"}),
    ("garbled", {}, (*SERIAL, *MODBUS), {"NoReply", "BadReply"}),
    ("garbled", {"times": 3}, (*SERIAL, *MODBUS), {"NoReply", "BadReply"}),
    ("truncated", {"times": 3}, (*SERIAL, *MODBUS), {"NoReply", "BadReply"}),
    ("truncated", {"lost": "head", "times": 3}, (*SERIAL, *MODBUS), {"NoReply", "BadReply"}),
    ("truncated", {"lost": "middle", "times": 3}, ("dvm", "scanner", *MODBUS), {"NoReply", "BadReply"}),
    ("duplicated", {"times": 3}, (*SERIAL, *MODBUS), {"BadReply"}),
    ("duplicated", {"what": "byte", "times": 3}, ("dvm", "scanner", *MODBUS), {"BadReply"}),
    ("wrong-reply", {"times": 3}, ("dvm", "scanner", *MODBUS, *CAN), {"NoReply", "BadReply"}),
    ("unplugged", {"for_s": 40.0}, EVERYTHING, {"Unreachable"}),
    ("modbus-exception", {"times": 2}, MODBUS, {"InstrumentError"}),
    ("modbus-exception", {"code": 6.0, "times": 2}, MODBUS, set()),
    ("wrong-unit", {"times": 3}, MODBUS, {"BadReply"}),
    ("bus-off", {"for_s": 20.0}, CAN, {"Unreachable"}),
    ("lost-frame", {}, CAN, {"NoReply"}),
    ("lost-frame", {"times": 8}, CAN, {"NoReply", "BadReply"}),
    ("lost-frame", {"skip": 2.0}, CAN, {"NoReply", "BadReply"}),
    ("repeated-frame", {"times": 4}, CAN, set()),
]
INSTRUMENTS: list[Row] = [
    ("drive-fault", {}, ("esp301", "cia402"), {"NotReady"}),
    ("drive-fault", {"axis": "roll"}, ("esp301", "cia402"), {"NotReady"}),
    ("following-error", {}, ("esp301", "cia402"), {"NotReady"}),
    ("power-cycle", {"for_s": 20.0}, EVERYTHING, {"NoReply", "NotReady", "InstrumentError", "Unreachable", "BadReply"}),
    ("error-queue-overflow", {}, ("esp301", *METERS, "pace"), {"InstrumentError"}),
    ("supply-failure", {}, ("pace",), {"NotReady"}),
    ("chamber-alarm", {}, MODBUS, {"NotReady"}),
    ("chamber-alarm", {"state": "error", "number": 3.0}, MODBUS, {"NotReady"}),
    ("open-circuit", {}, MODBUS, {"BadReply"}),
]


def table(rows: list[Row]) -> list[object]:
    return [
        pytest.param(name, kind, given, errors, id=f"{kind} {' '.join(map(str, given.values()))} {name}")
        for kind, given, names, errors in rows
        for name in names
    ]


@pytest.mark.parametrize(("name", "kind", "given", "errors"), table(WIRES))
def test_a_fault_of_the_wire_is_an_error_of_ours_and_never_a_wrong_answer(name, kind, given, errors):
    rig = up(name)
    rig.strike(kind, **given)
    found = rig.outcomes(ASKS)
    assert set(found) <= {"right"} | errors, found
    assert rig.happened(), "the fault did not happen"
    rig.dry.world.sleep(60.0)
    rig.bring_up()
    assert rig.outcomes(2) == ["right", "right"]


SETTLES_S = {"dvm": 4.0, "scanner": 4.0, "pace": 15.0}
"""After a change, until a reading is what it will be; of the others it is at once."""


@pytest.mark.parametrize("name", EVERYTHING)
def test_however_late_an_answer_is_it_answers_nothing_else(name):
    """Delays on a grid finer than an exchange lasts, so that late answers come while others are awaited."""
    rig, settle_s = up(name), SETTLES_S.get(name, 0.0)
    finest = {"esp301": 0.03, "cia402": 0.0004, "daq": 0.05}.get(name, 0.11)
    for n in range(45):
        base = (0.3, 1.0, 2.0)[n % 3] if name != "cia402" else (0.3, 0.65, 0.66)[n % 3]
        rig.strike("late-reply", delay_s=base + n * finest, times=1 + n % 3)
        found = rig.outcomes(3, settle_s)
        assert set(found) <= {"right", "NoReply", "BadReply"}, (n, found)
        rig.dry.world.sleep(10.0)
        for _ in range(2):  # what was owed is settled with the first
            last = rig.outcomes(1, settle_s)
        assert last == ["right"], n


def test_a_late_confirmation_is_not_that_of_another_write():
    """Later than the quiet that the bus is listened for: only the object that it names tells."""
    rig = up("cia402")
    node = rig.driver._axes["pitch"].node
    rig.strike("late-reply", delay_s=0.36)
    with pytest.raises(DriverError, match="did not answer writing"):
        node.write(0x6081, 180_000)
    rig.strike("no-reply", lost="request")
    with pytest.raises(DriverError, match="it answered about 6081h:00 instead"):
        node.write(0x6083, 180_000)


def test_a_late_register_is_not_another_one_after_two_failures():
    """Transaction numbers go on after an error; were they to begin again, two late replies would have the same."""
    rig = up("chamber")
    rig.driver.set_temperature(35.0)
    line, process_value, setpoint = rig.driver._line, 2820, 2782
    rig.strike("no-reply")
    rig.dry.world.call_in(1.2, lambda: rig.strike("late-reply", delay_s=1.7))
    with pytest.raises(DriverError, match="did not answer"):
        line.read(process_value, 2)
    assert float_of_words(line.read(setpoint, 2)) == pytest.approx(35.0 * 1.8 + 32.0, abs=1e-3)


def test_a_late_value_is_not_that_of_now():
    rig = up("cia402")
    node, axis = rig.driver._axes["pitch"].node, rig.sim.plant.head.axes["pitch"]
    before = node.number(0x6064)
    rig.strike("late-reply", delay_s=0.36)
    rig.dry.world.call_in(0.34, lambda: axis.slip(2.0, encoder=True))
    assert node.number(0x6064) == pytest.approx(before + 72_000, abs=2)


@pytest.mark.parametrize(("name", "kind", "given", "errors"), table(INSTRUMENTS))
def test_a_fault_of_an_instrument_is_told_and_the_instrument_works_again(name, kind, given, errors):
    rig = up(name)
    rig.strike(kind, **given)
    found = rig.outcomes(2)
    if kind == "error-queue-overflow" or name in ("daq", "enclosure", "chamber"):
        assert set(found) <= {"right"} | errors, found
    else:
        assert set(found) <= errors, found
    assert rig.happened()
    rig.dry.world.sleep(kinds_of(rig.sim.twin(name))[kind].lasts_s + 40.0)
    rig.bring_up()
    assert rig.outcomes(2) == ["right", "right"]


@pytest.mark.parametrize("name", ["dvm", "scanner", "daq"])
def test_readings_go_wrong_as_they_do_and_are_right_again(name):
    """Nothing on the wire tells: these are the engine's to judge. What happened says what would have been right."""
    rig = up(name)
    rig.strike("spike", amount_V=0.5, amount_degC=5.0)
    (wrong,) = rig.outcomes(1)
    assert wrong not in ("", "right")
    assert "instead of" in rig.happened()[-1].what
    assert rig.outcomes(1) == ["right"]
    rig.strike("frozen-reading", for_s=20.0)
    frozen, *after = rig.outcomes(3)
    assert frozen != "right"
    assert after[-1] == "right"


@pytest.mark.parametrize(
    ("name", "channel"), [("dvm", "input"), ("scanner", "101"), ("scanner", "104"), ("daq", "sse_temperature")]
)
def test_an_overload_is_the_reading_that_says_so(name, channel):
    rig = up(name)
    rig.strike("overload", channel=channel, times=2)
    rig.driver.start(3)
    *over, last = rig.driver.fetch()[channel]
    assert over == [9.9e37, 9.9e37]
    assert abs(last) < 100.0


@pytest.mark.parametrize(
    ("name", "channel"), [("scanner", "104"), ("daq", "sensor_temperature"), ("daq", "spare_voltage")]
)
def test_an_open_circuit_reads_as_open_where_the_instrument_can_tell(name, channel):
    rig = up(name)
    rig.strike("open-circuit", for_s=5.0, channel=channel)
    rig.driver.start(1)
    assert list(rig.driver.fetch()[channel]) == [9.9e37]
    rig.dry.world.sleep(10.0)
    assert rig.ask() == ""


@pytest.mark.parametrize(("name", "channel"), [("dvm", "input"), ("scanner", "101")])
def test_an_open_voltage_input_wanders_much_more_than_any_sensor(name, channel):
    rig = up(name)
    rig.strike("open-circuit")
    rig.driver.start(8)
    readings = rig.driver.fetch()[channel]
    assert max(readings) - min(readings) > 0.01
    assert all(abs(value) < 1.0 for value in readings)


@pytest.mark.parametrize("name", ["esp301", "cia402"])
@pytest.mark.parametrize("encoder", ["blind", "sees"])
def test_a_slip_moves_the_table_and_the_encoder_only_if_it_sees(name, encoder):
    rig = up(name)
    head, before = rig.sim.plant.head, rig.driver.read()["pitch"].position_deg
    rig.strike("slip", amount_deg=0.25, encoder=encoder)
    rig.dry.world.sleep(1.0)
    moved = rig.driver.read()["pitch"].position_deg - before
    assert moved == pytest.approx(0.25 if encoder == "sees" else 0.0, abs=1e-3)
    assert head.true_deg("pitch", rig.dry.world.now()) == pytest.approx(before + 0.25, abs=2e-3)


@pytest.mark.parametrize("name", ["esp301", "cia402"])
def test_a_stalled_axis_stays_behind_and_goes_again_afterwards(name):
    rig = up(name)
    rig.driver.move({"pitch": 60.0, "roll": 30.0})
    rig.dry.world.sleep(3.0)
    rig.strike("stall", for_s=30.0)
    stalled = rig.driver.read()["pitch"].position_deg
    rig.dry.world.sleep(15.0)
    states = rig.driver.read()
    assert states["pitch"].position_deg == pytest.approx(stalled, abs=0.01)
    assert states["roll"].position_deg == pytest.approx(30.0, abs=2e-3)
    rig.driver.move({"pitch": 50.0})
    rig.dry.world.sleep(5.0)
    assert rig.driver.read()["pitch"].position_deg == pytest.approx(stalled, abs=0.01)
    rig.dry.world.sleep(20.0)
    rig.driver.move({"pitch": 50.0})
    rig.dry.world.sleep(20.0)
    assert rig.driver.read()["pitch"].position_deg == pytest.approx(50.0, abs=2e-3)


@pytest.mark.parametrize(("name", "truth"), [("enclosure", {}), ("chamber", {})])
def test_an_open_door_lets_the_laboratory_in_and_a_closed_one_recovers(name, truth):
    rig = up(name, truth)
    chamber = rig.sim.plant.chamber(name)
    rig.driver.set_temperature(40.0)
    rig.dry.world.sleep(4 * 3600.0)
    assert rig.driver.read().temperature_degC == pytest.approx(40.0, abs=0.1)
    rig.strike("door-open", for_s=300.0, time_constant_s=120.0)
    rig.dry.world.sleep(299.0)
    state = rig.driver.read()
    assert 21.5 < state.temperature_degC < 26.0
    assert (state.power_pct, state.running, state.setpoint_degC) == (0.0, True, pytest.approx(40.0, abs=1e-3))
    rig.dry.world.sleep(6 * 3600.0)
    assert chamber.air_degC(rig.dry.world.now()) == pytest.approx(40.0, abs=0.1)
    assert rig.driver.read().power_pct > 0.0


def test_a_lost_vacuum_is_named_and_the_pressure_comes_down_when_it_is_back():
    rig = up("pace")
    rig.strike("supply-failure", source="vacuum", for_s=600.0)
    rig.driver.set_pressure(0.2)
    rig.dry.world.sleep(60.0)
    state = rig.driver.read()
    assert state.faults
    assert state.faults[0].startswith("vacuum lost")
    assert state.pressure_psia > 0.9
    rig.dry.world.sleep(700.0)
    state = rig.driver.read()
    assert (state.faults, state.in_limits) == ((), True)


# When.


def test_the_nth_exchange_is_hit_and_no_other():
    rig = faulty("pace", {"faults": [{"kind": "no-reply", "on": "pace", "exchange": 3}]})
    for _ in range(4):
        rig.driver.restarted()
    (happening,) = rig.happened()
    assert "*ESE" in happening.what
    assert rig.driver._line.retries == 1
    assert rig.driver._line.exchanges == 6  # four questions, one asked again, one that brings the line into step


def test_a_moment_is_hit_whoever_talks_then():
    rig = faulty("pace", {"faults": [{"kind": "unplugged", "on": "pace", "at_s": 100.0, "for_s": 5.0}]})
    assert rig.driver.restarted()
    rig.dry.world.sleep(101.0)
    with pytest.raises(DriverError, match="was lost"):
        rig.driver.restarted()
    with pytest.raises(DriverError, match="cannot be opened"):
        rig.driver.restarted()
    rig.dry.world.sleep(5.0)
    assert rig.driver.restarted()


def chances(seed: int, start: float = 0.0) -> list[float]:
    entry = {"kind": "error-queue-overflow", "on": "pace", "probability": 0.3}
    rig = faulty("pace", {"seed": seed, "faults": [entry]}, start=start)
    for _ in range(40):
        rig.driver.restarted()
    return [round(h.t_s - start, 6) for h in rig.happened()]


def test_chance_is_the_seeds_and_the_exchanges_and_every_session_has_its_own():
    first = chances(1)
    assert 4 <= len(first) <= 22
    assert chances(1) == first
    assert chances(2) != first
    assert chances(1, start=500.0) != first


def test_what_was_before_a_resumed_session_is_past_unless_it_lasts():
    entries = [
        {"kind": "drive-fault", "on": "cia402", "at_s": 10.0},
        {"kind": "no-reply", "on": "pace", "at_s": 10.0},
        {"kind": "chamber-alarm", "on": "chamber", "at_s": 10.0, "for_s": 50.0},
        {"kind": "chamber-alarm", "on": "other", "at_s": 10.0, "for_s": 500.0},
        {"kind": "clock-step", "at_s": 10.0, "amount_s": -7200.0},
    ]
    rig = faulty("chamber", {"faults": entries}, text=PRESSURE, start=100.0)
    assert sorted(h.fault.kind for h in rig.happened()) == ["chamber-alarm", "clock-step"]
    assert not rig.driver.read().alarms
    assert rig.bench.instruments["other"].read().alarms
    rig.dry.world.sleep(411.0)
    assert not rig.bench.instruments["other"].read().alarms


def test_utc_steps_and_is_set_right_while_durations_go_on():
    entries = [
        {"kind": "clock-step", "at_s": 10.0, "amount_s": -3600.0, "for_s": 20.0},
        {"kind": "dst", "at_s": 15.0, "amount_s": 3600.0},
    ]
    world = faulty("pace", {"faults": entries}).dry.world
    epoch = world.utc()
    world.sleep(12.0)
    assert (world.now(), world.utc() - epoch) == (12.0, pytest.approx(12.0 - 3600.0))
    world.sleep(8.0)
    assert (world.utc() - epoch, world.local_offset_s) == (pytest.approx(20.0 - 3600.0), 3600.0)
    world.sleep(20.0)
    assert (world.now(), world.utc() - epoch) == (40.0, pytest.approx(40.0))


# What a world file may say.


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'kind = "no-replay"\non = "pace"\nexchange = 1',
            r"faults\[1\].kind.no-replay is not known; did you mean no-reply",
        ),
        ('on = "pace"\nexchange = 1', r"faults\[1\].kind is missing"),
        (
            'kind = "no-reply"\non = "pane"\nexchange = 1',
            r"faults\[1\].on must be an instrument of the bench \(cia402, pace",
        ),
        ('kind = "no-reply"\nexchange = 1', r"faults\[1\].on must be an instrument"),
        (
            'kind = "no-reply"\non = "pace"',
            r"faults\[1\] \(no-reply\) must say when, by exactly one of at_s, exchange, probability",
        ),
        ('kind = "no-reply"\non = "pace"\nexchange = 1\nat_s = 3', r"must say when, by exactly one of"),
        ('kind = "no-reply"\non = "pace"\nexchange = 0', r"faults\[1\].exchange must be a whole number from 1 on"),
        ('kind = "no-reply"\non = "pace"\nprobability = 1.5', r"faults\[1\].probability = 1.5 is outside 0 to 1"),
        ('kind = "no-reply"\non = "pace"\nat_s = 1\ntimes = 0', r"faults\[1\].times must be a whole number from 1 on"),
        (
            'kind = "no-reply"\non = "pace"\nat_s = 1\ndelay_s = 0',
            r"faults\[1\].delay_s is not known .*keys of no-reply",
        ),
        ('kind = "late-reply"\non = "pace"\nat_s = 1\ndelay_s = "x"', r"faults\[1\].delay_s must be a number"),
        ('kind = "slip"\non = "cia402"\nat_s = 1\nencoder = "x"', r"faults\[1\].encoder must be one of blind, sees"),
        (
            'kind = "bus-off"\non = "pace"\nat_s = 1',
            r"bus-off cannot happen to pace; it may hit cia402, daq. What can happen to pace: no-reply, .*supply",
        ),
        ('kind = "door-open"\non = "pace"\nat_s = 1', r"door-open cannot happen to pace; it may hit chamber, other"),
        ('kind = "clock-step"\non = "pace"\nat_s = 1', r"faults\[1\].on: clock-step happens to the bench as a whole"),
        ('kind = "clock-step"\nexchange = 1', r"faults\[1\].exchange: clock-step happens at a time"),
        ('kind = "drive-fault"\non = "cia402"\nat_s = 1\nfor_s = 5', r"faults\[1\].for_s: drive-fault does not last"),
        (
            'kind = "chamber-alarm"\non = "pace"\nat_s = 1',
            r"chamber-alarm cannot happen to pace; it may hit chamber, other",
        ),
        ('kind = "unplugged"\non = "pace"\nat_s = 1\ntimes = 5', r"faults\[1\].times: unplugged is not counted"),
    ],
)
def test_what_cannot_be_is_refused_by_entry_and_key(text, message):
    truth = tomllib.loads(f"[[faults]]\n{text}\n")
    with pytest.raises(ConfigurationError, match=message):
        DryBench(parse_bench(PRESSURE, "bench.toml"), truth)


def test_faults_that_are_no_array_of_tables_are_refused():
    with pytest.raises(WorldError, match=r"each under \[\[faults\]\]"):
        read_faults({"kind": "no-reply"}, {})


def test_every_entry_goes_back_into_a_world_file_as_it_was():
    entries = [
        {"kind": "late-reply", "on": "pace", "exchange": 40, "delay_s": 2.0},
        {"kind": "clock-step", "at_s": 5.0},
        {"kind": "unplugged", "on": "daq", "probability": 0.001, "for_s": 7.0},
        {"kind": "no-reply", "on": "daq", "at_s": 3.0, "times": 2, "lost": "request"},
    ]
    twins = {"pace": twin_class("druck-pace"), "daq": twin_class("can-daq")}
    faults = read_faults(entries, twins)
    assert [fault.table() for fault in faults] == entries
    assert read_faults(faults, twins) == faults
    assert str(faults[0]) == "late-reply on pace at exchange 40 (delay_s 2.0)"
    assert read_faults([Fault(kinds_of(twins["pace"])["unplugged"], "pace", at_s=1.0)], twins)[0].for_s == 20.0


# The tape.


def test_the_tape_has_what_was_true_and_what_was_given():
    rig = up("scanner", record_tape=True)
    rig.strike("spike", channel="101", amount_V=0.25)
    rig.driver.start(2)
    given = rig.driver.fetch()
    volts = [r for r in rig.sim.tape.readings if (r.instrument, r.channel) == ("scanner", "101")][-2:]
    assert [r.given for r in volts] == pytest.approx(given["101"], abs=1e-6)
    assert volts[0].given - volts[0].true == pytest.approx(0.25, abs=1e-3)
    assert volts[1].given - volts[1].true == pytest.approx(0.0, abs=1e-3)
    head, (_, reading) = rig.sim.plant.head, volts
    middle = (reading.t_s + reading.end_s) / 2.0
    assert reading.factors["pitch_deg"] == pytest.approx(head.true_deg("pitch", middle))
    assert set(reading.factors) == {"pitch_deg", "roll_deg", "sensor_temperature_degC"}
    assert volts[0].found == pytest.approx(volts[0].given - 0.25)
    assert volts[1].found == volts[1].given


def test_the_tape_has_what_was_commanded_and_reached():
    rig = up("esp301", record_tape=True)
    rig.sim.tape.changes.clear()
    rig.driver.move({"pitch": 20.0})
    rig.dry.world.sleep(30.0)
    rig.driver.move({"pitch": 40.0})
    rig.dry.world.sleep(1.0)
    rig.driver.stop()
    rig.dry.world.sleep(30.0)
    whats = [(c.what, c.value) for c in rig.sim.tape.changes]
    assert whats[:3] == [("pitch target_deg", 20.0), ("pitch reached_deg", 20.0), ("pitch target_deg", 40.0)]
    assert whats[3][0] == "pitch stopped_deg"
    assert len(whats) == 4

    rig = up("pace", record_tape=True)
    rig.sim.tape.changes.clear()
    rig.driver.set_pressure(2.0)
    rig.dry.world.sleep(60.0)
    rig.driver.make_safe()
    whats = [(c.what, c.value) for c in rig.sim.tape.changes if c.instrument == "pace"]
    assert ("setpoint_psia", 2.0) in whats
    assert whats[-2:] == [("vent", "open"), ("vent", "complete")] or ("vent", "complete") in whats


def test_the_tape_has_from_which_side_an_axis_came():
    rig = up("esp301", record_tape=True)
    scanner = rig.sim.twin("scanner")
    for target, side in ((20.0, 1), (10.0, -1)):
        rig.driver.move({"pitch": target})
        rig.dry.world.sleep(30.0)
        now = rig.dry.world.now()
        scanner.inputs.given("101", "V", now - 0.2, now, 0.0)
        reading = rig.sim.tape.readings[-1]
        assert reading.sides["pitch_deg"] == side
        assert reading.factors["pitch_deg"] == pytest.approx(target, abs=0.003)
        assert reading.stay == 0


def test_the_tape_has_a_target_that_a_stalled_axis_does_not_go_to():
    rig = up("esp301", record_tape=True)
    rig.sim.plant.head.axes["pitch"].stall(rig.dry.world.now() + 60.0)
    rig.sim.tape.changes.clear()
    rig.driver.move({"pitch": 20.0})
    rig.dry.world.sleep(30.0)
    assert [(c.what, c.value) for c in rig.sim.tape.changes] == [("pitch target_deg", 20.0)]


def test_the_tape_has_every_command_to_vent_and_every_pressure_read():
    rig = up("pace", record_tape=True)
    rig.driver.set_pressure(2.0)
    rig.dry.world.sleep(60.0)
    rig.sim.tape.readbacks.clear()
    rig.strike("spike", amount_psi=0.5)
    said = [rig.driver.read().pressure_psia for _ in range(2)]
    assert [b.given for b in rig.sim.tape.readbacks][:2] == pytest.approx(said, abs=1e-6)
    assert [b.given - b.true for b in rig.sim.tape.readbacks][:2] == pytest.approx([0.5, 0.0], abs=1e-4)
    line = rig.sim.plant.pressure_line("pace")
    rig.sim.tape.changes.clear()
    for _ in range(2):
        line.vent(rig.dry.world.now(), 0.1)
        rig.dry.world.sleep(1.0)
    assert [(c.what, c.value) for c in rig.sim.tape.changes].count(("vent", "open")) == 2


def test_a_bench_without_faults_does_what_it_did():
    for text in (ATTITUDE, PRESSURE):
        dry = DryBench(parse_bench(text, "bench.toml"), {})
        assert dry.sim.tape is None
        assert dry.sim.faults.happened == []
