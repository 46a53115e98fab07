"""Our CiA 402 driver against drives on canopen's LocalNode, as strangers' drives are: few objects, late, in rpm."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import canopen
import pytest
from buses import EDS, without_objects
from foreign_drive import ForeignDrive
from pydantic import ValidationError

from rig.drivers.cia402 import CiA402Pair
from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, NotReady
from rig.drivers.roles import AxisState, Remarking
from rig.drivers.wires import Wires
from rig.drivers.wires.can_node import read_eds
from rig.sims.wires.can_line import CanCable, on_one_bus
from rig.sims.world import World

# What a Schunk ERB (Schunk_0_63.dcf, public) lacks: no window, no deceleration, no homing speeds, no units.
GAPS = (0x6067, 0x6068, 0x6084, 0x6085, 0x6099, 0x609A, 0x60A8, 0x60A9, 0x60AA)
SPARSE = without_objects(EDS, *GAPS)
COUNTS_PER_TURN, GEAR = 4096, 100
RPM = {"velocity_unit": "rpm", "acceleration_unit": "rpm/s", "turns_per_table_turn": GEAR}
COUNTS_PER_DEGREE = COUNTS_PER_TURN * GEAR / 360.0


class Bench:
    """Two foreign drives on one bus and our driver."""

    def __init__(
        self,
        eds: str = SPARSE,
        values: dict[tuple[int, int], int] | None = None,
        mode_late_s: float = 0.05,
        **options: Any,
    ) -> None:
        self.world = World()
        self.drives = [ForeignDrive(self.world, n, eds, COUNTS_PER_TURN, values, mode_late_s) for n in (1, 2)]
        given = {"counts_per_degree": COUNTS_PER_DEGREE, "homed_bit": 0, "in_position_deg": 0.002, **options}
        cable: Callable[[str], CanCable] = lambda address: CanCable(  # noqa: E731
            self.world, on_one_bus(*(drive.on_frame for drive in self.drives))
        )
        self.wires = Wires(self.world, simulated={"can": cable})
        self.driver = CiA402Pair("head", "sim://w/head", CiA402Pair.Options(eds=eds, **given), self.wires, self.world)

    def homed(self) -> Bench:
        self.driver.prepare()
        self.driver.home()
        self.until_still()
        return self

    def until_still(self, longest_s: float = 100.0) -> dict[str, AxisState]:
        end = self.world.now() + longest_s
        while True:
            states = dict(self.driver.read())
            if not any(state.moving for state in states.values()):
                return states
            assert self.world.now() < end, states
            self.world.sleep(0.05)


def test_a_drive_without_the_optional_objects_is_identified_prepared_homed_and_moved() -> None:
    bench = Bench(**RPM)
    assert bench.driver.identify().model == "Rotary axis drive"
    bench.homed()
    began = bench.world.now()
    bench.driver.move({"pitch": 30.0, "roll": -10.0})
    states = bench.until_still()
    assert states["pitch"].position_deg == pytest.approx(30.0, abs=0.002)
    assert states["roll"].position_deg == pytest.approx(-10.0, abs=0.002)
    assert bench.world.now() - began == pytest.approx(30.0 / 5.0, abs=0.3), "30 deg at 5 deg/s"
    assert not set(GAPS) & {index for drive in bench.drives for index, _ in drive.written}


def test_speeds_are_in_the_unit_that_the_drive_counts_in() -> None:
    bench = Bench(**RPM)
    bench.driver.prepare()
    drive = bench.drives[0]
    assert drive.speed_rpm == round(5.0 / 360.0 * 60.0 * GEAR) == 83, "5 deg/s of the table, gear 100"
    assert drive.written[0x6083, 0] == 83


def test_what_the_gaps_cost_is_said_before_anything_is_sent() -> None:
    driver = Bench(**RPM).driver
    assert isinstance(driver, Remarking)
    said = driver.remarks()
    for index, words in (
        ("6067h", "this program judges whether a target is reached, by in_position_deg and in_position_s"),
        ("6084h", "it brakes with the drive's own deceleration"),
        ("6085h", "a quick stop brakes with the drive's own deceleration"),
        ("6099h", "home_speed_deg_per_s is not used"),
    ):
        assert any(index in text and words in text for text in said), (index, said)
    assert len(said) == len({index for index in GAPS if index < 0x60A0})


def test_a_target_is_reached_when_the_table_is_there_and_not_when_the_profile_has_ended() -> None:
    bench = Bench(**RPM, in_position_s=0.5).homed()
    bench.drives[0].settles_off_by = round(0.01 * COUNTS_PER_DEGREE)
    bench.driver.move({"pitch": 10.0})
    bench.world.sleep(60.0)
    assert bench.driver.read()["pitch"].moving, "0.01 deg off is outside in_position_deg, whatever bit 10 says"
    bench.drives[0].settles_off_by = 0
    bench.driver.move({"pitch": 20.0})
    bench.world.sleep(2.1)
    assert bench.driver.read()["pitch"].moving, "there for less than in_position_s"
    bench.world.sleep(0.6)
    assert not bench.driver.read()["pitch"].moving


def test_a_mode_that_is_shown_late_is_waited_for_and_one_that_never_comes_is_refused() -> None:
    bench = Bench(**RPM, mode_late_s=0.4).homed()
    assert not any(state.fault for state in bench.driver.read().values())
    with pytest.raises(NotReady, match=r"mode 1 \(6060h\) and still shows mode 0 \(6061h\) after 1 s"):
        Bench(**RPM, mode_late_s=float("inf")).driver.prepare()


@pytest.mark.parametrize(
    ("options", "key"),
    [({}, "velocity_unit"), ({"velocity_unit": "rpm", "turns_per_table_turn": 100}, "acceleration_unit")],
)
def test_a_unit_that_neither_the_eds_nor_the_bench_tells_is_refused_with_the_key_to_write(
    options: dict[str, Any], key: str
) -> None:
    with pytest.raises(ValidationError, match=f"{key} is needed: the EDS has no 60A.h"):
        CiA402Pair.Options(eds=SPARSE, **options)


TOLD_RPM = without_objects(EDS, *(index for index in GAPS if index < 0x60A0))


def test_the_unit_is_what_the_drive_itself_says_not_what_its_eds_has_as_default() -> None:
    values = {(0x60A9, 0): 0xFFB44700, (0x60AA, 0): 0x00C00300}  # 0.1 rpm; rpm/s
    bench = Bench(TOLD_RPM, values, turns_per_table_turn=GEAR)
    bench.driver.prepare()
    assert bench.drives[0].written[0x6081, 0] == round(5.0 / 6.0 * GEAR * 10.0)
    assert bench.drives[0].written[0x6083, 0] == round(5.0 / 6.0 * GEAR)


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        ({(0x60A9, 0): 0}, {}, r"60A9h does not name one\); look it up in its manual and write velocity_unit ="),
        ({(0x60A9, 0): 0x00010300}, {}, r"its 60A9h is 00010300h, which is unknown\); .* velocity_unit ="),
        ({(0x60A9, 0): 0x00B44700}, {"velocity_unit": "counts/s"}, r"says velocity_unit = 'counts/s' and .* says rpm"),
        ({(0x60A9, 0): 0x00B44700}, {}, r"write turns_per_table_turn = N in the bench file"),
    ],
)
def test_a_drive_whose_units_are_unknown_or_contradict_the_bench_is_not_driven(
    values: dict[tuple[int, int], int], options: dict[str, Any], message: str
) -> None:
    bench = Bench(TOLD_RPM, values, **options)
    with pytest.raises(BadReply, match=message):
        bench.driver.prepare()
    assert not any(index == 0x6081 for index, _ in bench.drives[0].written), "nothing was set"


def test_a_unit_too_coarse_for_a_speed_is_refused_and_a_rounded_one_is_said() -> None:
    direct = {**RPM, "turns_per_table_turn": 1}
    with pytest.raises(BadReply, match=r"speed_deg_per_s = 5 deg/s is less than one rpm"):
        Bench(**direct, acceleration_deg_per_s2=12.0).driver.prepare()
    bench = Bench(**direct, speed_deg_per_s=10.0, acceleration_deg_per_s2=12.0, home_speed_deg_per_s=24.0)
    bench.driver.prepare()
    assert bench.drives[0].speed_rpm == 1, "never faster than declared"
    said = bench.driver.remarks()
    assert "speed_deg_per_s is 6 deg/s instead of 10: the drive counts in whole rpm" in said


def test_two_foreign_nodes_answer_on_python_cans_own_loopback_bus() -> None:
    """Frames of python-can, the library's thread on the other side, our clock running."""
    channel = "calibration-rig-foreign-nodes"
    network = canopen.Network()
    network.connect(interface="virtual", channel=channel)
    try:
        for node in (1, 2):
            network[node] = canopen.LocalNode(node, read_eds(SPARSE, node))
        clock = RealClock()
        wires = Wires(clock)
        driver = CiA402Pair("head", f"can:virtual/{channel}", CiA402Pair.Options(eds=SPARSE, **RPM), wires, clock)
        try:
            assert driver.identify().maker == "CiA 402"
        finally:
            driver.close()
            wires.close()
    finally:
        network.disconnect()


def with_ratios(eds: str, *indices: int) -> str:
    """A data sheet with records of two numbers: encoder resolution, gear ratio, feed constant."""
    sections = [
        f"[{index:04X}{sub}]\nParameterName=Ratio\nObjectType=0x{kind}\n{rest}\n"
        for index in indices
        for sub, kind, rest in (
            ("", 9, "SubNumber=3\n"),
            ("sub0", 7, "DataType=0x0005\nAccessType=const\nDefaultValue=2\nPDOMapping=0\n"),
            ("sub1", 7, "DataType=0x0007\nAccessType=rw\nDefaultValue=1\nPDOMapping=0\n"),
            ("sub2", 7, "DataType=0x0007\nAccessType=rw\nDefaultValue=1\nPDOMapping=0\n"),
        )
    ]
    return eds + "\n" + "\n".join(sections)


RATIOS = with_ratios(SPARSE, 0x608F, 0x6091, 0x6092)
RPM_ALONE = {key: unit for key, unit in RPM.items() if key != "turns_per_table_turn"}
ENCODER = {(0x608F, 1): COUNTS_PER_TURN, (0x608F, 2): 1}


@pytest.mark.parametrize("values", [ENCODER, {(0x6092, 1): 2 * COUNTS_PER_TURN, (0x6092, 2): 2}])
@pytest.mark.parametrize("declared", [{}, {"turns_per_table_turn": GEAR}])
def test_turns_of_the_motor_come_from_the_drives_own_resolution(
    values: dict[tuple[int, int], int], declared: dict[str, Any]
) -> None:
    bench = Bench(RATIOS, values, **RPM_ALONE, **declared)
    bench.driver.prepare()
    assert bench.drives[0].speed_rpm == 83


@pytest.mark.parametrize(
    ("values", "declared", "message"),
    [
        ({}, {}, "write turns_per_table_turn = N"),  # all ratios 1: nobody has set them
        ({**ENCODER, (0x6091, 1): 5}, {}, "write turns_per_table_turn = N"),  # at which of the gear's shafts?
        (ENCODER, {"turns_per_table_turn": 50}, r"turns_per_table_turn = 50; .* 4096 .* \(6092h, 608Fh\) it is 100;"),
    ],
)
def test_turns_that_are_unknown_or_contradict_the_drive_are_refused(
    values: dict[tuple[int, int], int], declared: dict[str, Any], message: str
) -> None:
    with pytest.raises(BadReply, match=message):
        Bench(RATIOS, values, **RPM_ALONE, **declared).driver.prepare()
