"""The CAN data-acquisition unit: its DBC read twice, frames on the wire, and what is lost, stale or silent."""

import random
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from typing import Any

import cantools.database
import pytest
from buses import CONTRACTS, EDS
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from rig.drivers.can_daq import CanDaq
from rig.drivers.cia402 import CiA402Pair
from rig.drivers.errors import BadReply, LimitError, NoReply, NotReady, Unreachable, WrongInstrument
from rig.drivers.roles import OVERLOAD, Identity, Reader
from rig.drivers.wires import Wires
from rig.sims.physics import Plant, WorldError
from rig.sims.twins.can_daq import RANGE, SHORT, CanDaqTwin
from rig.sims.twins.cia402 import CiA402PairTwin
from rig.sims.wires.can_line import CanCable, OnFrame, on_one_bus
from rig.sims.wires.dbc import read_dbc
from rig.sims.world import World

DBC = (CONTRACTS / "can_daq.dbc").read_text(encoding="utf-8")
THEIRS = cantools.database.load_string(DBC, "dbc")
OURS = read_dbc(DBC)

Transmit = Callable[[int, bytes], None]


class Warming:
    """Inputs that say what time it is: 20 degC and a tenth of a degree more every second, the spare one open."""

    class truth:  # noqa: N801
        seed = 7

    def channel_degC(self, instrument: str, channel: str, t: float) -> float:
        assert instrument == "daq"
        return {"sensor_temperature": 20.0 + t / 10.0, "sse_temperature": -60.0 + t / 10.0}.get(channel, inf)

    def channel_V(self, instrument: str, channel: str, t0: float, t1: float) -> float:
        assert channel == "spare_voltage"
        return 1.5


@dataclass
class Bench:
    """A unit on a simulated bus, and what passed on it; `through` may change or drop a frame of the unit's."""

    options: dict[str, Any] = field(default_factory=dict)
    twin_dbc: str = DBC
    through: Callable[[int, bytes], tuple[int, bytes] | None] = lambda can_id, data: (can_id, data)

    def __post_init__(self) -> None:
        self.world = World()
        self.log: list[str] = []
        self.twin = CanDaqTwin("daq", {**self.options, "dbc": self.twin_dbc}, self.world, Warming(), "SN004711")
        self.driver = self.make()

    def make(self) -> CanDaq:
        wires = Wires(
            self.world,
            simulated={"can": lambda address: CanCable(self.world, self._on_frame)},
            tap=lambda name, way, data: self.log.append(f"{way} {data[:2].hex()[1:].upper()} {data[2:].hex()}"),
        )
        options = CanDaq.Options.model_validate({"dbc": DBC, **self.options})
        return CanDaq("daq", "sim://w/daq", options, wires, self.world)

    def _on_frame(self, can_id: int, data: bytes, tx: Transmit) -> None:
        def changed(can_id: int, data: bytes) -> None:
            if frame := self.through(can_id, data):
                tx(*frame)

        self.twin.on_frame(can_id, data, changed)

    def measured(self, count: int) -> dict[str, list[float]]:
        self.world.sleep(self.driver.start(count))
        return {label: list(values) for label, values in self.driver.fetch().items()}

    def bytes_of(self, action: Callable[[], object]) -> list[str]:
        self.log.clear()
        action()
        return list(self.log)


def test_it_plays_the_role_of_a_reader() -> None:
    bench = Bench()
    assert isinstance(bench.driver, Reader)
    assert bench.driver.channels() == ("sensor_temperature", "sse_temperature", "spare_temperature", "spare_voltage")


# --- the DBC, read by two readers that share no code


def test_every_signal_is_read_from_the_dbc_as_cantools_reads_it() -> None:
    assert set(OURS) == {message.name for message in THEIRS.messages}
    for message in THEIRS.messages:
        ours = OURS[message.name]
        assert (ours.can_id, ours.length) == (message.frame_id, message.length)
        assert set(ours.signals) == {signal.name for signal in message.signals}
        for signal in message.signals:
            found = ours.signals[signal.name]
            assert (found.begin, found.bits, found.signed) == (signal.start, signal.length, signal.is_signed)
            assert (found.factor, found.offset) == (signal.scale, signal.offset)
            assert (found.low, found.high, found.unit) == (signal.minimum, signal.maximum, signal.unit or "")
            assert found.group == (signal.multiplexer_ids or [None])[0]
            assert found.multiplexor == signal.is_multiplexer
            assert found.names == {n: str(text) for n, text in (signal.choices or {}).items()}


@given(st.randoms(use_true_random=False))
def test_frames_are_packed_and_unpacked_as_cantools_does(pick: random.Random) -> None:
    for message in THEIRS.messages:
        ours, group = OURS[message.name], pick.randint(0, 1)
        values = {}
        for name, signal in ours.signals.items():
            if signal.group in (None, group):
                value = group if signal.multiplexor else pick.uniform(signal.low, signal.high)
                values[name] = round(value) if signal.factor == 1.0 else round(value / signal.factor) * signal.factor
        frame = message.encode(values, strict=False)
        assert ours.pack(values) == frame
        unpacked = ours.unpack(frame)
        for name, value in message.decode(frame, decode_choices=False).items():
            assert unpacked[name] == pytest.approx(value, abs=1e-9)


def test_identifiers_are_those_that_canopen_leaves_free() -> None:
    assert all(0x680 <= message.frame_id <= 0x6DF for message in THEIRS.messages)


@pytest.mark.parametrize("seed", range(20))
def test_frames_in_both_byte_orders_and_with_floats_are_those_of_cantools(seed: int) -> None:
    """Our reader of DBC files, which shares no code with the drivers', against cantools."""
    text = """VERSION ""
BO_ 2566834709 Mixed: 8 Node
 SG_ A : 7|12@0- (0.1,-3) [-200|200] "degC" Other
 SG_ B : 11|10@0+ (1,0) [0|1023] "" Other
 SG_ C : 24|7@1- (0.5,1) [-31|32.5] "" Other
 SG_ F : 39|32@0- (1,0) [0|0] "V" Other
BO_ 12 Floats: 8 Node
 SG_ G : 0|64@1- (1,0) [0|0] "V" Other
SIG_VALTYPE_ 2566834709 F : 1;
SIG_VALTYPE_ 12 G : 2;
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_ "GenMsgCycleTime" BO_ 12 250;
"""
    theirs, ours, pick = cantools.database.load_string(text, "dbc"), read_dbc(text), random.Random(seed)
    assert ours["Mixed"].can_id == theirs.get_message_by_name("Mixed").frame_id | 1 << 31
    assert (ours["Mixed"].cycle_s, ours["Floats"].cycle_s) == (0.0, 0.25)
    for name, message in ours.items():
        values = {
            key: pick.uniform(-9e3, 9e3) if one.is_float else round(pick.uniform(0, 60)) * one.factor + one.offset
            for key, one in message.signals.items()
        }
        frame = theirs.encode_message(name, values)
        assert message.pack(values) == frame
        assert message.unpack(frame) == pytest.approx(theirs.decode_message(name, frame))


# --- the wire


def test_preparing_ends_what_is_under_way() -> None:
    bench = Bench()
    bench.make().start(1000)
    bench.world.sleep(0.25)
    assert bench.bytes_of(bench.driver.prepare)[-2:] == ["tx 6A0 000100006400", "rx 6A2 100010"]
    assert bench.bytes_of(lambda: bench.world.sleep(5.0)) == []
    assert bench.world.next_due() is None, "nothing is scheduled, so a simulated week costs nothing"


def test_a_sweep_is_status_and_two_groups_of_readings() -> None:
    bench = Bench()
    log = bench.bytes_of(lambda: bench.measured(2))
    assert log[0] == "tx 6A0 010102006400", "acquire in session 1, 2 sweeps, 100 ms"
    assert [line[:6] for line in log[1:]] == ["rx 6A2", "rx 6A3", "rx 6A3"] * 2
    assert log[1] == "rx 6A2 100110", "session 1, sweep 1, spare temperature open"
    assert log[4] == "rx 6A2 100210"
    group, sweep, *low = struct.unpack("<BB3s3s", bytes.fromhex(log[5].split()[2]))
    counts = [int.from_bytes(b, "little", signed=True) for b in low]
    assert (group, sweep) == (0x10, 2)
    assert counts == pytest.approx([200150, -599850], abs=100)
    assert [THEIRS.decode_message(0x6A3, bytes.fromhex(line.split()[2]))["Group"] for line in log[2:4]] == [0, 1]


def test_readings_are_the_inputs_over_their_own_windows() -> None:
    bench = Bench()
    bench.world.sleep(1000.0)
    readings = bench.measured(300)
    middles = [1000.0 + 0.1 * (k + 0.5) for k in range(300)]
    assert readings["sensor_temperature"] == pytest.approx([20.0 + t / 10.0 for t in middles], abs=0.01)
    assert readings["sse_temperature"] == pytest.approx([-60.0 + t / 10.0 for t in middles], abs=0.01)
    assert readings["spare_voltage"] == pytest.approx([1.5] * 300, abs=3e-5)
    assert readings["spare_temperature"] == [OVERLOAD] * 300
    assert bench.driver.retries == 0


def test_readings_do_not_depend_on_when_they_are_fetched() -> None:
    one, other = Bench(), Bench()
    expected = one.measured(5)
    other.driver.start(5)
    assert other.driver.fetch() == expected, "waiting takes frames as they come"
    assert other.world.now() == pytest.approx(0.5)


@pytest.mark.parametrize("count", [0, -1, 65_536])
def test_nothing_is_sent_for_a_count_it_cannot_take(count: int) -> None:
    bench = Bench()
    with pytest.raises(LimitError, match="can take 1 to 65535 sweeps at once"):
        bench.driver.start(count)
    assert bench.log == []


def test_a_unit_that_counts_to_less_is_asked_for_less() -> None:
    eight_bits = DBC.replace('16|16@1+ (1,0) [0|65535] "" Daq', '16|8@1+ (1,0) [0|255] "" Daq')
    bench = Bench({"dbc": eight_bits}, twin_dbc=eight_bits)
    assert len(bench.measured(255)["spare_voltage"]) == 255
    with pytest.raises(LimitError, match="can take 1 to 255 sweeps at once, not 256"):
        bench.driver.start(256)


def test_nothing_started_is_nothing_to_fetch() -> None:
    with pytest.raises(NotReady, match="daq at sim://w/daq: there is nothing to fetch"):
        Bench().driver.fetch()


# --- stale, lost, silent


def test_what_an_earlier_start_brought_does_not_count() -> None:
    bench = Bench()
    bench.driver.start(100)
    bench.world.sleep(3.0)
    readings = bench.measured(2)["sensor_temperature"]
    assert readings == pytest.approx([20.305, 20.315], abs=0.01)


def test_a_measurement_of_a_controller_that_is_gone_does_not_count() -> None:
    bench = Bench()
    bench.make().start(100)
    bench.world.sleep(3.05)
    successor = bench.make()
    successor.prepare()
    bench.world.sleep(1.0)
    successor.start(2)
    assert successor.fetch()["sensor_temperature"] == pytest.approx([20.41, 20.42], abs=0.01)


def test_frames_that_a_gateway_holds_back_belong_to_their_own_start() -> None:
    class Gateway(Bench):
        def _on_frame(self, can_id: int, data: bytes, tx: Transmit) -> None:
            self.twin.on_frame(can_id, data, lambda *frame: self.world.call_in(0.35, lambda: tx(*frame)))

    bench = Gateway()
    bench.driver.start(100)
    bench.world.sleep(3.0)
    bench.driver.start(4)
    assert bench.driver.fetch()["sensor_temperature"] == pytest.approx([20.305, 20.315, 20.325, 20.335], abs=0.008)
    assert bench.driver.retries == 0


def losing(*numbers: int) -> Callable[[int, bytes], tuple[int, bytes] | None]:
    """Drops the first, second, ... frame of all that the unit sends."""
    count = 0

    def through(can_id: int, data: bytes) -> tuple[int, bytes] | None:
        nonlocal count
        count += 1
        return None if count in numbers else (can_id, data)

    return through


@pytest.mark.parametrize("lost", [(1,), (2,), (9,), (30,), (28, 29, 30), (4, 11, 15)])
def test_what_is_lost_is_measured_again(lost: tuple[int, ...]) -> None:
    bench = Bench(through=losing(*lost))
    readings = bench.measured(10)
    assert {label: len(values) for label, values in readings.items()} == dict.fromkeys(bench.driver.channels(), 10)
    assert bench.driver.retries == 1
    again = [line for line in bench.log if line.startswith("tx")][1]
    missing = len({(number - 1) // 3 for number in lost if (number - 1) % 3 in (0, 1)}) or 1
    assert again == f"tx 6A0 0102{missing:02x}006400"


@given(st.lists(st.sampled_from(["", "", "", "lose", "twice", "cut"]), min_size=60, max_size=60))
def test_whatever_the_bus_does_readings_are_new_and_each_is_one_sweeps(fates: list[str]) -> None:
    left = list(fates)

    class Bus(Bench):
        def _on_frame(self, can_id: int, data: bytes, tx: Transmit) -> None:
            def through(can_id: int, data: bytes) -> None:
                fate = left.pop() if left and can_id != 0x6A1 else ""
                for _ in range({"lose": 0, "twice": 2}.get(fate, 1)):
                    tx(can_id, data[:2] if fate == "cut" else data)

            self.twin.on_frame(can_id, data, through)

    bench = Bus()
    bench.world.sleep(50.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rig.sims.twins.can_daq._NOISE", {"degC": 0.0, "V": 0.0})
        try:
            readings = bench.measured(8)
        except (NoReply, BadReply):
            return
    for label, offset in (("sensor_temperature", 20.0), ("sse_temperature", -60.0)):
        times = [(value - offset) * 10.0 - 50.0 for value in readings[label]]
        assert len(times) == 8
        assert min(times) > 0.0
        assert all(later - sooner > 0.099 for sooner, later in pairwise(times)), "none is taken twice"


def test_a_unit_that_keeps_losing_frames_is_reported() -> None:
    bench = Bench(through=lambda can_id, data: None if data[:2] in (b"\x10\x03", b"\x20\x01") else (can_id, data))
    with pytest.raises(
        BadReply, match=r"9 of 10 readings of sensor_temperature came in 6A3h \(Readings\); frames were lost: check bus"
    ):
        bench.measured(10)


def test_a_silent_unit_is_asked_twice_and_named_with_its_identifiers() -> None:
    bench = Bench(through=lambda can_id, data: None)
    expected = r"daq at sim://w/daq: no frame 6A1h \(Identity\) came within 0.5 s; is the unit powered, terminated"
    with pytest.raises(NoReply, match=expected):
        bench.driver.identify()
    assert len(bench.log) == 2
    assert bench.driver.retries == 1
    with pytest.raises(NoReply, match=r"no frame 6A2h \(Status\)"):
        bench.driver.prepare()
    with pytest.raises(NoReply, match=r"no frame 6A3h \(Readings\), 6A2h \(Status\)"):
        bench.measured(3)
    assert bench.world.now() < 10.0


def test_a_unit_that_does_not_send_its_status_gives_no_readings() -> None:
    bench = Bench(through=lambda can_id, data: None if can_id == 0x6A2 else (can_id, data))
    with pytest.raises(NoReply, match=r"no frame 6A2h \(Status\) came"):
        bench.measured(3)


def test_a_unit_with_other_identifiers_is_silent() -> None:
    bench = Bench(twin_dbc=DBC.replace("BO_ 1697", "BO_ 1713").replace("BO_ 1699", "BO_ 1715"))
    with pytest.raises(NoReply, match=r"no frame 6A1h .* set to these identifiers"):
        bench.driver.identify()
    with pytest.raises(NoReply, match=r"no frame 6A3h \(Readings\) came"):
        bench.measured(3)


def test_a_counter_that_stands_still_is_no_new_reading() -> None:
    def frozen(can_id: int, data: bytes) -> tuple[int, bytes]:
        return can_id, data if can_id == 0x6A1 else data[:1] + b"\x01" + data[2:]

    bench = Bench(through=frozen)
    with pytest.raises(BadReply, match=r"2 of 5 readings .* frames repeat their counter: it has stopped measuring"):
        bench.measured(5)


def test_the_counter_may_go_round() -> None:
    bench = Bench({"period_s": 0.01})
    assert len(bench.measured(600)["sensor_temperature"]) == 600
    assert bench.driver.retries == 0


def test_frames_that_do_not_fit_the_dbc_are_no_readings() -> None:
    bench = Bench(through=lambda can_id, data: (can_id, data[:4] if can_id == 0x6A3 else data))
    with pytest.raises(NoReply, match=r"6A3h .*\(6A3h \(Readings\) [0-9a-f]{8} does not fit the DBC"):
        bench.measured(2)
    bench = Bench(through=lambda can_id, data: (can_id, data[:1] if can_id == 0x6A2 else data))
    with pytest.raises(NoReply, match=r"no frame 6A2h .* does not fit the DBC"):
        bench.driver.prepare()


def test_an_unknown_product_is_the_wrong_instrument() -> None:
    bench = Bench(through=lambda can_id, data: (can_id, b"\x09" + data[1:]))
    with pytest.raises(WrongInstrument, match=r"is product 9; the DBC describes 4 \(Four-input unit\)"):
        bench.driver.identify()


def test_switched_off_and_on_in_the_middle_the_rest_is_measured_again() -> None:
    bench = Bench()
    bench.driver.start(10)
    bench.world.sleep(0.45)
    bench.twin.power_cycle()
    readings = bench.driver.fetch()["sensor_temperature"]
    assert len(readings) == 10
    assert bench.driver.retries == 1
    assert readings[4] - readings[3] > 0.1, "0.55 s and the timeout were lost"


@pytest.mark.parametrize("fault", [SHORT, RANGE])
def test_a_faulty_sensor_is_an_overload_and_the_others_are_not(fault: int) -> None:
    bench = Bench()
    bench.twin.wrong["SseTemperature"] = fault
    readings = bench.measured(2)
    assert readings["sse_temperature"] == [OVERLOAD, OVERLOAD]
    assert readings["sensor_temperature"] == pytest.approx([20.005, 20.015], abs=0.01)


def test_a_fault_concerns_its_own_sweep() -> None:
    bench = Bench()
    bench.driver.start(4)
    bench.world.sleep(0.15)
    bench.twin.wrong["SensorTemperature"] = SHORT
    bench.world.sleep(0.1)
    bench.twin.wrong.clear()
    values = bench.driver.fetch()["sensor_temperature"]
    assert [value == OVERLOAD for value in values] == [False, True, False, False]


def test_making_safe_ends_the_measurement() -> None:
    bench = Bench()
    bench.driver.start(100)
    bench.driver.make_safe()
    bench.driver.make_safe()
    bench.log.clear()
    bench.world.sleep(20.0)
    assert bench.world.next_due() is None
    with pytest.raises(NotReady):
        bench.driver.fetch()


def test_a_bus_that_is_lost_is_unreachable_and_opens_again() -> None:
    bench = Bench()
    broken = [True]

    def through(can_id: int, data: bytes) -> tuple[int, bytes]:
        if broken[0]:
            raise OSError("adapter unplugged")
        return can_id, data

    bench.through = through
    with pytest.raises(Unreachable, match=r"daq at sim://w/daq was lost \(adapter unplugged\)"):
        bench.driver.prepare()
    broken[0] = False
    bench.driver.prepare()
    bench.driver.close()
    bench.driver.close()


# --- a unit that sends by itself, with a DBC of its own

FOREIGN = """VERSION ""

BU_: Logger

BO_ 512 Fast: 4 Logger
 SG_ T1 : 7|16@0- (0.01,0) [-327|327] "degC" Vector__XXX
 SG_ Alive : 16|4@1+ (1,0) [0|15] "" Vector__XXX

BO_ 513 Slow: 3 Logger
 SG_ T2 : 0|16@1+ (0.1,-100) [0|0] "degC" Vector__XXX
 SG_ T2State : 16|8@1+ (1,0) [0|255] "" Vector__XXX

BO_ 514 Late: 2 Logger
 SG_ T3 : 0|16@1- (0.1,0) [0|0] "degC" Vector__XXX
"""
LOGGER = cantools.database.load_string(FOREIGN, "dbc")


class Logger:
    """Sends Fast every 50 ms and Slow every 200 ms, whoever listens; what came unread waits in its buffer."""

    def __init__(self, world: World) -> None:
        self._world, self._frames = world, []
        self.alive, self.state, self.quiet = 0, 0, False
        self._fast()
        self._slow()
        world.call_in(0.15, self._late)

    def _fast(self) -> None:
        values = {"T1": round(self._world.now(), 2), "Alive": self.alive % 16}
        self._queue("Fast", values)
        self.alive += 1
        self._world.call_in(0.05, self._fast)

    def _slow(self) -> None:
        self._queue("Slow", {"T2": round(self._world.now(), 1), "T2State": self.state})
        self._world.call_in(0.2, self._slow)

    def _late(self) -> None:
        self._queue("Late", {"T3": 0.0})
        self._world.call_in(0.2, self._late)

    def _queue(self, name: str, values: dict[str, float]) -> None:
        if not self.quiet:
            message = LOGGER.get_message_by_name(name)
            self._frames.append((message.frame_id, message.encode(values)))

    def send(self, can_id: int, data: bytes) -> None:
        raise AssertionError("it takes no commands")

    def recv(self, seconds: float) -> tuple[int, bytes] | None:
        self._world.run_until(self._world.now() + seconds, lambda: bool(self._frames))
        return self._frames.pop(0) if self._frames else None

    def close(self) -> None:
        self._frames.clear()


def logger(**options: Any) -> tuple[World, Logger, CanDaq]:
    world = World()
    unit = Logger(world)
    given = {
        "dbc": FOREIGN, "on_command": False, "counter": "Alive", "period_s": 0.2,
        "channels": {"sensor": "Fast.T1", "sse": "Slow.T2"}, "faults": {"sse": "Slow.T2State"},
    }  # fmt: skip
    wires = Wires(world, simulated={"can": lambda address: unit})
    return world, unit, CanDaq("daq", "sim://w/daq", CanDaq.Options(**(given | options)), wires, world)


def test_a_unit_that_sends_by_itself_is_known_by_its_frames() -> None:
    _, unit, driver = logger()
    assert driver.identify() == Identity("", "Logger", "", "")
    assert not driver.identify().confirmed
    driver.prepare()
    unit.quiet = True
    with pytest.raises(NoReply, match=r"no frame 200h \(Fast\), 201h \(Slow\) came"):
        driver.prepare()


def test_only_its_frames_after_start_count() -> None:
    world, _, driver = logger()
    world.sleep(100.01)
    expected_s = driver.start(3)
    assert expected_s == pytest.approx(0.6)
    world.sleep(expected_s)
    readings = driver.fetch()
    assert readings["sensor"] == pytest.approx([100.05, 100.1, 100.15], abs=0.006)
    assert readings["sse"] == pytest.approx([100.2, 100.4, 100.6], abs=0.06)
    assert world.now() < 101.0
    driver.make_safe()


def test_nothing_counts_before_it_is_known_whether_the_sensor_is_well() -> None:
    world, unit, driver = logger(channels={"sensor": "Fast.T1"}, faults={"sensor": "Slow.T2State"})
    unit.state = 3
    world.sleep(100.01)
    driver.start(4)
    world.sleep(0.3)
    assert driver.fetch()["sensor"] == [OVERLOAD] * 4
    world, _, driver = logger(channels={"sse": "Slow.T2"}, faults={"sse": "Late.T3"}, timeout_s=0.02)
    world.sleep(100.17)
    driver.start(2)
    assert driver.fetch()["sse"] == pytest.approx([100.4, 100.6], abs=0.06), "that of 100.2 came before the first word"


def test_its_counter_and_its_faults_are_seen() -> None:
    world, unit, driver = logger()
    unit.state = 3
    driver.start(2)
    assert driver.fetch()["sse"] == [OVERLOAD, OVERLOAD]
    unit.alive = 7
    driver.start(40)
    world.sleep(0.3)
    unit._fast = lambda: None  # type: ignore[method-assign]  # its measuring stops
    with pytest.raises(BadReply, match=r"of 40 readings of"):
        driver.fetch()


def test_a_frozen_counter_of_a_unit_that_sends_by_itself_is_reported() -> None:
    world, unit, driver = logger(channels={"sensor": "Fast.T1"})
    type(unit).alive = property(lambda self: 5, lambda self, value: None)  # type: ignore[assignment]  # it hangs
    try:
        driver.start(3)
        with pytest.raises(BadReply, match=r"1 of 3 readings of sensor .* frames repeat their counter"):
            driver.fetch()
    finally:
        del type(unit).alive
    assert world.now() < 5.0


# --- together with others on one bus


def test_head_and_unit_share_a_bus() -> None:
    world = World()
    plant = Plant(world, {}, {})
    drives = CiA402PairTwin("head", {"eds": EDS}, world, plant, "SN000001")
    unit = CanDaqTwin("daq", {"dbc": DBC}, world, Warming(), "SN000002")
    shared: OnFrame = on_one_bus(drives.on_frame, unit.on_frame)
    wires = Wires(world, simulated={"can": lambda address: CanCable(world, shared)})
    head = CiA402Pair("head", "sim://w/bus", CiA402Pair.Options(eds=EDS), wires, world)
    daq = CanDaq("daq", "sim://w/bus", CanDaq.Options(dbc=DBC), wires, world)
    assert head.identify().serial == "11+12"
    assert daq.identify().serial == "2"
    head.prepare()
    daq.prepare()
    daq.start(10)
    polls = 0
    while world.now() < 1.2:
        head.read()  # takes the unit's frames off the bus, which must not be lost
        polls += 1
    assert polls > 50
    assert len(daq.fetch()["sensor_temperature"]) == 10
    assert daq.retries == 0
    with pytest.raises(Unreachable, match="identifier 6A3h is already declared on this bus"):
        CanDaq("other", "sim://w/bus", CanDaq.Options(dbc=DBC), wires, world)


# --- configuration


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"dbc": "nonsense"}, "the DBC cannot be read"),
        ({"dbc": 'VERSION ""'}, "the DBC describes no messages"),
        ({"dbc": DBC, "channels": {"t": "Readings.T9"}}, r"t = 'Readings.T9' is not in the DBC; it has Readings.Group"),
        ({"dbc": DBC, "channels": {"t": "T9"}}, r"t = 'T9' is not in the DBC; it has Command.Action, "),
        ({"dbc": DBC, "channels": {}}, "at least 1 item"),
        ({"dbc": FOREIGN, "channels": {"t": "Fast.T1"}}, "has a message Command with Action, Period, Session, Sweeps"),
        ({"dbc": FOREIGN.replace("BO_ 512", "BO_ 2147484160"), "channels": {"t": "Fast.T1"}, "on_command": False},
         "Fast.T1: only classic frames with 11-bit identifiers"),
        ({"dbc": DBC.replace('1 "Acquire"', '1 "Go"')}, "the unit's Command cannot be sent: "),
        ({"dbc": DBC.replace("[10|60000]", "[200|60000]")}, "the unit's Command cannot be sent: .*Period"),
        ({"dbc": DBC, "period_s": 0.001}, "greater than or equal to 0.01"),
        ({"dbc": DBC, "nplc": 1}, "Extra inputs"),
    ],
)  # fmt: skip
def test_options_are_strict(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        CanDaq.Options.model_validate(options)


def test_a_unit_that_sends_by_itself_has_no_twin() -> None:
    with pytest.raises(WorldError, match="daq: only a unit that measures on command can be simulated"):
        CanDaqTwin("daq", {"dbc": FOREIGN}, World(), Warming(), "")


def test_who_has_no_such_unit_does_not_wait_for_cantools() -> None:
    """16 ms of an interpreter's start, measured; only a bench that names the driver loads it."""
    code = "import sys, rig.cli, rig.instruments.opening, rig.drivers.wires; sys.exit('cantools' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_lost_answer_of_a_drive_is_got_over_while_the_unit_goes_on_sending():
    """After a lost answer the line is drained until quiet; a neighbour that never is quiet must not count."""
    world = World()
    drives = CiA402PairTwin("head", {"eds": EDS}, world, Plant(world, {}, {}), "SN000001")
    unit = CanDaqTwin("daq", {"dbc": DBC}, world, Warming(), "SN000002")
    to_lose = []

    def deaf_once(identifier: int, data: bytes, transmit: Transmit) -> None:
        if to_lose and identifier == 0x601:
            to_lose.clear()
        else:
            drives.on_frame(identifier, data, transmit)

    shared = on_one_bus(deaf_once, unit.on_frame)
    wires = Wires(world, simulated={"can": lambda address: CanCable(world, shared)})
    head = CiA402Pair("head", "sim://w/bus", CiA402Pair.Options(eds=EDS), wires, world)
    daq = CanDaq("daq", "sim://w/bus", CanDaq.Options(dbc=DBC, period_s=0.02), wires, world)
    head.prepare()
    daq.prepare()
    daq.start(1000)
    to_lose.append(True)
    began = world.now()
    assert set(head.read()) == {"pitch", "roll"}
    assert not to_lose
    assert world.now() - began < 1.0
