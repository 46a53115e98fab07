"""CiA 402 drives: frames on the wire, the state machine, and driver and twin as a head."""

import math
from typing import Any

import pytest
from buses import EDS, Simulated, head, without_objects
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from rig.drivers.cia402 import CiA402Pair
from rig.drivers.errors import BadReply, LimitError, NotReady, Unreachable, WrongInstrument
from rig.drivers.roles import AxisState, Head
from rig.drivers.wires import Wires
from rig.sims.twins.cia402 import CiA402PairTwin
from rig.sims.twins.cia402_drive import FOLLOWING_ERROR, Drive
from rig.sims.wires.can_line import CanCable
from rig.sims.wires.sdo_server import (
    NO_OBJECT,
    NO_SUBINDEX,
    NOT_IN_THIS_STATE,
    OUT_OF_RANGE,
    READ_ONLY,
    TOO_HIGH,
    TOO_LONG,
    TOO_LOW,
    TOO_SHORT,
    Aborted,
)
from rig.sims.world import World

Bench = Simulated[CiA402Pair, CiA402PairTwin]


def until_still(bench: Bench, poll_s: float = 0.1, longest_s: float = 200.0) -> dict[str, AxisState]:
    end = bench.world.now() + longest_s
    while True:
        states = dict(bench.driver.read())
        if not any(state.moving for state in states.values()):
            return states
        assert bench.world.now() < end, states
        bench.world.sleep(poll_s)


def homed(**options: Any) -> Bench:
    bench = head(**options)
    bench.driver.prepare()
    bench.driver.home()
    until_still(bench)
    return bench


def ask(index: int, answer: str, node: int = 1, sub: int = 0) -> list[str]:
    request = f"40{index & 0xFF:02x}{index >> 8:02x}{sub:02x}00000000"
    size = {1: "4f", 2: "4b", 4: "43"}[len(answer) // 2]
    return [f"tx 060{node}{request}", f"rx 058{node}{size}{request[2:8]}{answer.ljust(8, '0')}"]


def tell(index: int, value: str, node: int = 1) -> list[str]:
    place = f"{index & 0xFF:02x}{index >> 8:02x}00"
    size = {1: "2f", 2: "2b", 4: "23"}[len(value) // 2]
    return [f"tx 060{node}{size}{place}{value.ljust(8, '0')}", f"rx 058{node}60{place}00000000"]


def test_it_plays_the_role_of_a_head() -> None:
    assert isinstance(head().driver, Head)


def test_a_move_is_target_then_new_setpoint_at_once_acknowledged_then_dropped() -> None:
    bench = homed()
    sent = bench.bytes_of(lambda: bench.driver.move({"pitch": 10.0, "roll": -1.0}))
    assert sent == [
        *tell(0x607A, "407e0500"),  # 360000 counts
        *tell(0x607A, "6073ffff", node=2),
        *tell(0x6040, "3f00"),
        *tell(0x6040, "3f00", node=2),
        *ask(0x6041, "3792"),  # enabled, not reached, acknowledged, homed
        *tell(0x6040, "0f00"),
        *ask(0x6041, "3792", node=2),
        *tell(0x6040, "0f00", node=2),
    ]


def test_reading_costs_two_exchanges_an_axis() -> None:
    bench = homed()
    bench.driver.move({"pitch": 30.0})
    until_still(bench)
    bench.world.sleep(10.0)
    assert bench.bytes_of(bench.driver.read) == [
        *ask(0x6041, "3786"),
        *ask(0x6064, "c07a1000"),
        *ask(0x6041, "3786", node=2),
        *ask(0x6064, "00000000", node=2),
    ]


def test_enabling_goes_through_the_states_with_06_07_0f() -> None:
    bench = head()
    words = [line[-8:-4] for line in bench.bytes_of(bench.driver.prepare) if line.startswith("tx 06012b4060")]
    assert words == ["0600", "0700", "0f00"]


def test_a_slow_computer_is_not_taken_for_a_drive_that_stays_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = head()
    slow = bench.driver._clock.sleep
    monkeypatch.setattr(bench.driver._clock, "sleep", lambda dt: slow(dt + 3.0))
    bench.driver.prepare()
    words = [int.from_bytes(drive.read(0x6041, 0), "little") for drive in bench.twin.drives.values()]
    assert [word & 0x6F for word in words] == [0x27, 0x27]


def test_a_drive_without_supply_is_told_by_its_state(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = head()
    drive = bench.twin.drives["pitch"]
    write = drive.write
    monkeypatch.setattr(drive, "write", lambda index, *rest: None if index == 0x6040 else write(index, *rest))
    with pytest.raises(NotReady, match="the pitch drive stays disabled; check its enable input and supply"):
        bench.driver.prepare()


def test_settings_reach_the_drives_in_counts() -> None:
    bench = head(speed_deg_per_s=2.0, acceleration_deg_per_s2=4.0, counts_per_degree=10000.0, pitch_deg=(-90.0, 45.0))
    bench.driver.prepare()
    drive = bench.twin.drives["pitch"]

    def value(index: int, sub: int = 0) -> int:
        return int.from_bytes(drive.read(index, sub), "little", signed=True)

    assert [value(i) for i in (0x6081, 0x6083, 0x6084, 0x6085)] == [20000, 40000, 40000, 160000]
    assert [value(0x607D, 1), value(0x607D, 2)] == [-900000, 450000]
    assert [value(0x6067), value(0x6068), value(0x6065)] == [3, 50, 5000]


def test_after_power_on_the_position_is_unknown_until_homing_finds_the_mark() -> None:
    bench = head({"head": {"start_pitch_deg": 12.0, "start_roll_deg": -31.0}})
    bench.driver.prepare()
    before = bench.driver.read()
    assert before["pitch"] == AxisState(0.0, moving=before["pitch"].moving, homed=False, enabled=True)
    with pytest.raises(NotReady, match="pitch must be homed before it can go to an angle"):
        bench.driver.move({"pitch": 1.0})
    bench.driver.home()
    assert bench.driver.read()["roll"].moving
    after = until_still(bench)
    assert all(state.homed and not state.fault for state in after.values())
    bench.world.sleep(5.0)
    assert bench.plant.head.true_deg("pitch", bench.world.now()) == pytest.approx(0.0, abs=1e-4)
    assert bench.driver.read()["pitch"].position_deg == pytest.approx(0.0, abs=1e-4)


def test_homing_is_not_repeated_for_an_axis_that_is_homed() -> None:
    bench = homed()
    assert [line for line in bench.bytes_of(bench.driver.home) if line.startswith("tx 06012b4060")] == []
    until_still(bench)


def test_another_controller_process_finds_the_axes_homed_and_power_loss_unhomes_them() -> None:
    bench = homed()
    bench.driver.move({"pitch": 20.0})
    until_still(bench)
    second = bench.make()
    assert second.read()["pitch"].homed
    second.prepare()
    bench.world.sleep(1.0)
    assert second.read()["pitch"].position_deg == pytest.approx(20.0, abs=1e-4)
    bench.twin.power_cycle()
    states = bench.make().read()
    assert not any(state.homed or state.enabled for state in states.values())
    assert bench.plant.head.encoder_deg("pitch", bench.world.now()) == pytest.approx(20.0, abs=1e-4)


def test_a_drive_that_does_not_tell_is_homed_in_every_session_and_after_every_loss_of_power() -> None:
    bench = homed(homed_bit=0)
    assert all(state.homed for state in bench.driver.read().values())
    bench.driver.move({"pitch": 2.0})
    until_still(bench)
    second = bench.make()
    second.prepare()
    assert not second.read()["pitch"].homed
    bench.twin.power_cycle()
    assert not bench.driver.read()["pitch"].homed
    bench.driver.prepare()
    bench.driver.home()
    assert until_still(bench)["pitch"].homed
    bench.twin.power_cycle()
    bench.driver.prepare()  # nobody has looked in between
    assert not bench.driver.read()["pitch"].homed


def test_another_makers_statusword_bit_15_is_not_taken_to_mean_homed() -> None:
    """CiA 402 leaves the bit to the maker; with some it says that the loop is closed."""
    theirs = EDS.replace("VendorNumber=0x00000000", "VendorNumber=0x00000009")
    bench = homed(eds=theirs, counts_per_degree=36000.0)
    assert all(state.homed for state in bench.driver.read().values())
    second = bench.make()
    assert not second.read()["pitch"].homed, "the drive sets bit 15, but nobody said what that means"
    assert homed(eds=theirs, counts_per_degree=36000.0, homed_bit=15).make().read()["pitch"].homed


@settings(max_examples=20)
@given(st.floats(-180, 180), st.floats(-180, 180))
def test_the_table_goes_where_it_is_sent(pitch: float, roll: float) -> None:
    bench = homed(speed_deg_per_s=20.0, acceleration_deg_per_s2=40.0)
    bench.driver.move({"pitch": pitch, "roll": roll})
    states = until_still(bench)
    assert states["pitch"].position_deg == pytest.approx(pitch, abs=4e-4)
    bench.world.sleep(10.0)
    for axis, target in (("pitch", pitch), ("roll", roll)):
        assert bench.plant.head.true_deg(axis, bench.world.now()) == pytest.approx(target, abs=0.5 / 36000 + 1e-9)


def test_in_position_means_inside_the_window_not_merely_that_the_profile_has_ended() -> None:
    bench = homed(in_position_deg=2e-4)
    bench.driver.move({"pitch": 10.0})
    while bench.plant.head.moving("pitch", bench.world.now()):
        bench.world.sleep(0.01)
    assert bench.driver.read()["pitch"].moving
    assert abs(until_still(bench, 0.01)["pitch"].position_deg - 10.0) <= 2e-4 + 1e-9


def test_a_new_target_during_a_move_replaces_the_old_one() -> None:
    bench = homed()
    bench.driver.move({"pitch": 60.0})
    bench.world.sleep(3.0)
    bench.driver.move({"pitch": 5.0})
    assert until_still(bench)["pitch"].position_deg == pytest.approx(5.0, abs=4e-4)


def test_stop_halts_with_drives_enabled_and_the_old_target_is_forgotten() -> None:
    bench = homed()
    bench.driver.move({"pitch": 60.0, "roll": -60.0})
    bench.world.sleep(4.0)
    bench.driver.stop()
    states = until_still(bench)
    assert all(state.enabled and state.homed for state in states.values())
    where = states["pitch"].position_deg
    assert 5.0 < where < 30.0
    bench.driver.prepare()
    bench.world.sleep(20.0)
    assert bench.driver.read()["pitch"].position_deg == pytest.approx(where, abs=1e-3), "preparing moves nothing"
    bench.driver.move({"roll": 0.0})
    until_still(bench)
    assert bench.driver.read()["pitch"].position_deg == pytest.approx(where, abs=1e-3)


def test_a_killed_controller_s_move_is_stopped_by_the_next_one() -> None:
    bench = homed()
    bench.driver.move({"pitch": 120.0})
    bench.world.sleep(3.0)
    second = bench.make()
    second.stop()
    second.prepare()
    bench.world.sleep(60.0)
    assert abs(second.read()["pitch"].position_deg) < 30.0


def test_a_quick_stop_brakes_four_times_as_hard_and_disables() -> None:
    bench = homed()
    bench.driver.move({"pitch": 60.0})
    bench.world.sleep(4.0)
    before = bench.driver.read()["pitch"].position_deg
    bench.driver.quick_stop()
    bench.world.sleep(2.0)
    state = bench.driver.read()["pitch"]
    assert state.position_deg - before == pytest.approx(5.0**2 / (2 * 20.0), abs=0.02)
    assert not state.enabled
    bench.driver.prepare()
    assert bench.driver.read()["pitch"].enabled


def test_stopping_a_home_search_leaves_the_axis_unhomed_and_it_can_be_repeated() -> None:
    bench = head({"head": {"start_pitch_deg": 90.0}})
    bench.driver.prepare()
    bench.driver.home()
    bench.world.sleep(3.0)
    bench.driver.stop()
    states = until_still(bench)
    assert not states["pitch"].homed
    bench.driver.home()
    assert until_still(bench)["pitch"].homed


def test_a_following_error_is_reported_with_its_code_and_reset_by_preparing() -> None:
    bench = homed()
    bench.driver.move({"pitch": 60.0})
    bench.world.sleep(2.0)
    bench.twin.drives["pitch"].fault(FOLLOWING_ERROR)
    bench.world.sleep(0.1)
    sent = bench.bytes_of(bench.driver.read)
    assert "rx 0081118621" + "00" * 5 in sent, "an emergency message tells of it"
    state = bench.driver.read()["pitch"]
    assert (state.fault, state.moving, state.enabled) == ("following error (error 8611h)", False, False)
    assert bench.driver.read()["roll"].fault == ""
    with pytest.raises(NotReady, match=r"pitch does not take the set-point; it is fault: following error"):
        bench.driver.move({"pitch": 0.0})
    bench.driver.prepare()
    assert bench.driver.read()["pitch"].fault == ""


@pytest.mark.parametrize("target", [-90.001, 45.1, math.nan, math.inf])
def test_nothing_is_sent_outside_the_limits(target: float) -> None:
    bench = homed(pitch_deg=(-90.0, 45.0))
    assert bench.driver.axes() == {"pitch": (-90.0, 45.0), "roll": (-190.0, 190.0)}

    def move() -> None:
        with pytest.raises(LimitError, match=r"pitch to .* deg is outside -90 to 45"):
            bench.driver.move({"roll": 1.0, "pitch": target})

    assert bench.bytes_of(move) == []


def test_drives_that_the_eds_does_not_describe_are_the_wrong_instrument() -> None:
    bench = head()
    other = EDS.replace("ProductNumber=0x00000402", "ProductNumber=0x00000777")
    driver = CiA402Pair(
        "head",
        "sim://w/head",
        CiA402Pair.Options(eds=other, counts_per_degree=36000.0),
        Wires(bench.world, simulated={"can": lambda address: CanCable(bench.world, bench.twin.on_frame)}),
        bench.world,
    )
    with pytest.raises(WrongInstrument, match=r"the pitch drive is vendor 0h product 402h; the EDS describes .* 777h"):
        driver.identify()


def test_a_setting_that_reads_back_differently_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = head()
    true_write = Drive.write

    def stubborn(drive: Drive, index: int, subindex: int, data: bytes) -> None:
        true_write(drive, index, subindex, b"\x10\x27\0\0" if index == 0x6081 else data)

    monkeypatch.setattr(Drive, "write", stubborn)
    with pytest.raises(BadReply, match="6081h:00 was set to 180000 and reads back 10000"):
        bench.driver.prepare()


def test_a_node_on_two_instruments_is_refused() -> None:
    bench = head()
    wires = Wires(bench.world, simulated={"can": lambda address: CanCable(bench.world, bench.twin.on_frame)})
    CiA402Pair("head", "sim://w/head", CiA402Pair.Options(eds=EDS), wires, bench.world)
    with pytest.raises(Unreachable, match="second at sim://w/head: node 1 is already declared"):
        CiA402Pair("second", "sim://w/head", CiA402Pair.Options(eds=EDS), wires, bench.world)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"eds": "nonsense"}, "the EDS"),
        ({"eds": EDS, "pitch_node": 2}, "pitch_node and roll_node are both 2"),
        ({"eds": EDS, "pitch_deg": (5.0, 5.0)}, "pitch_deg: 5 is not below 5"),
        ({"eds": EDS, "counts_per_degree": 2e7}, "exceeds 32 bits"),
        ({"eds": EDS.replace("=0x00000402", "=0x7")}, "counts_per_degree is needed: the EDS is not the supplied one"),
        (
            {"eds": without_objects(EDS, 0x607A, 0x6061)},
            "the EDS has no 6061h, 607Ah: the drive has no profile position",
        ),
        ({"eds": EDS, "speed": 1.0}, "Extra inputs"),
    ],
)
def test_options_are_strict(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        CiA402Pair.Options.model_validate(options)


# The twin alone, by the letters of CiA 402.


def drive(**truth: Any) -> tuple[Drive, World]:
    bench = head(dict(truth))
    return bench.twin.drives["pitch"], bench.world


def word(value: int) -> bytes:
    return value.to_bytes(2, "little")


def state_of(axis: Drive) -> int:
    status = int.from_bytes(axis.read(0x6041, 0), "little")
    return status & (0x4F if status & 0x48 else 0x6F)


@pytest.mark.parametrize(
    ("words", "state"),
    [
        ([], 0x40),
        ([0x07], 0x40),
        ([0x0F], 0x40),
        ([0x06], 0x21),
        ([0x06, 0x07], 0x23),
        ([0x06, 0x07, 0x0F], 0x27),
        ([0x06, 0x0F], 0x27),
        ([0x06, 0x07, 0x0F, 0x07], 0x23),
        ([0x06, 0x07, 0x0F, 0x06], 0x21),
        ([0x06, 0x07, 0x0F, 0x00], 0x40),
        ([0x06, 0x07, 0x0F, 0x02], 0x40),
        ([0x06, 0x07, 0x02], 0x40),
        ([0x06, 0x00], 0x40),
    ],
)
def test_the_power_state_machine(words: list[int], state: int) -> None:
    axis, world = drive()
    for value in words:
        axis.write(0x6040, 0, word(value))
        world.sleep(0.1)
    assert state_of(axis) == state


def test_a_fault_stays_until_a_rising_edge_of_bit_7() -> None:
    axis, world = drive()
    axis.fault(0x2310)
    for value in (0x06, 0x0F, 0x00):
        axis.write(0x6040, 0, word(value))
        assert state_of(axis) == 0x08
    assert axis.read(0x603F, 0) == word(0x2310)
    axis.write(0x6040, 0, word(0x80))
    assert state_of(axis) == 0x40
    assert axis.read(0x603F, 0) == word(0)
    axis.fault(0x2310)
    axis.write(0x6040, 0, word(0x80))
    assert state_of(axis) == 0x08, "bit 7 was not low in between"
    assert world.now() == 0.0


def enabled() -> tuple[Drive, World]:
    axis, world = drive()
    axis.write(0x6060, 0, b"\x01")
    for value in (0x06, 0x07, 0x0F):
        axis.write(0x6040, 0, word(value))
        world.sleep(0.1)
    return axis, world


def status(axis: Drive) -> int:
    return int.from_bytes(axis.read(0x6041, 0), "little")


def counts(axis: Drive) -> int:
    return int.from_bytes(axis.read(0x6064, 0), "little", signed=True)


def test_set_points_queue_one_deep_unless_they_are_to_change_at_once() -> None:
    axis, world = enabled()
    for target in (36000, 72000):
        axis.write(0x607A, 0, target.to_bytes(4, "little"))
        axis.write(0x6040, 0, word(0x1F))
        assert status(axis) & 1 << 12
        axis.write(0x6040, 0, word(0x0F))
    assert status(axis) & 1 << 12, "the second waits, so there is no room for a third"
    world.sleep(1.0)
    first_stop = max(counts(axis), 0)
    assert 0 < first_stop <= 36000
    world.sleep(10.0)
    assert not status(axis) & 1 << 12
    assert status(axis) & 1 << 10
    assert counts(axis) == 72000


def test_relative_set_points_add_to_the_last_target() -> None:
    axis, world = enabled()
    for _ in range(3):
        axis.write(0x607A, 0, (36000).to_bytes(4, "little"))
        axis.write(0x6040, 0, word(0x7F))
        axis.write(0x6040, 0, word(0x0F))
        world.sleep(10.0)
    assert counts(axis) == 3 * 36000


def test_releasing_halt_resumes_the_move() -> None:
    axis, world = enabled()
    axis.write(0x607A, 0, (360000).to_bytes(4, "little"))
    axis.write(0x6040, 0, word(0x3F))
    axis.write(0x6040, 0, word(0x0F))
    world.sleep(1.0)
    axis.write(0x6040, 0, word(0x10F))
    world.sleep(5.0)
    assert status(axis) & 1 << 10, "standing still in halt"
    assert 0 < counts(axis) < 200000
    axis.write(0x6040, 0, word(0x0F))
    world.sleep(20.0)
    assert counts(axis) == 360000


def test_a_target_beyond_the_software_limits_ends_at_the_limit_with_bit_11() -> None:
    axis, world = enabled()
    axis.write(0x607D, 2, (18000).to_bytes(4, "little"))
    axis.write(0x607A, 0, (36000).to_bytes(4, "little"))
    axis.write(0x6040, 0, word(0x3F))
    world.sleep(10.0)
    assert status(axis) & 1 << 11
    assert counts(axis) == 18000


@pytest.mark.parametrize(
    ("index", "subindex", "data", "code"),
    [
        (0x2000, 0, b"\0", NO_OBJECT),
        (0x607D, 3, b"\0\0\0\0", NO_SUBINDEX),
        (0x6041, 0, b"\0\0", READ_ONLY),
        (0x1008, 0, b"abcd", READ_ONLY),
        (0x6040, 0, b"\0\0\0", TOO_LONG),
        (0x607A, 0, b"\0\0", TOO_SHORT),
        (0x6081, 0, b"\0\0\0\0", TOO_LOW),
        (0x6081, 0, b"\xff\xff\xff\x7f", TOO_HIGH),
        (0x6060, 0, b"\x03", OUT_OF_RANGE),
        (0x6098, 0, b"\x11", OUT_OF_RANGE),
    ],
)
def test_abort_codes(index: int, subindex: int, data: bytes, code: int) -> None:
    axis, _ = drive()
    with pytest.raises(Aborted) as caught:
        axis.write(index, subindex, data)
    assert caught.value.code == code


def test_the_mode_does_not_change_during_a_move() -> None:
    axis, world = enabled()
    axis.write(0x607A, 0, (360000).to_bytes(4, "little"))
    axis.write(0x6040, 0, word(0x3F))
    world.sleep(1.0)
    with pytest.raises(Aborted) as caught:
        axis.write(0x6060, 0, b"\x06")
    assert caught.value.code == NOT_IN_THIS_STATE


def test_a_node_reset_by_network_management_boots_again() -> None:
    bench = homed()
    cable = CanCable(bench.world, bench.twin.on_frame)
    cable.send(0x000, b"\x81\x01")
    assert cable.recv(1.0) == (0x701, b"\0")
    states = bench.driver.read()
    assert not states["pitch"].homed
    assert states["roll"].homed
