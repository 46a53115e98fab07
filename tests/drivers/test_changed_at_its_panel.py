"""What chambers and drives say when somebody has changed them at their panels (`rig.drivers.roles.SelfChecking`).

They are asked before and after the readings of every point. Other instruments: in the tests of their drivers.
"""

from __future__ import annotations

import pytest
from buses import EDS, head, oven

from rig.drivers.errors import NotReady
from rig.drivers.roles import SelfChecking


@pytest.fixture(params=["C", "F"])
def chamber(request):
    bench = oven(modbus_units=request.param, power="event-1", ramp_degC_per_min=2.0, alarms=0)
    bench.driver.prepare()
    bench.driver.set_temperature(25.0)
    return bench


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("setpoint", 30.0, "setpoint reads 30 degC, not 25 degC"),
        ("mode", "off", "mode reads off, not auto"),
        ("ramp_action", "off", "ramp_action reads off, not setpoint"),
        ("ramp_scale", "hours", "ramp_scale reads hours, not minutes"),
        ("ramp_rate", 1.0, "ramp_rate reads 1 K, not 2 K"),
        ("profile_state", "running", "its profile is running, and sets the setpoint"),
    ],
)
def test_a_chamber_says_which_setting_is_not_as_it_was_set(chamber, name, value, said):
    driver, twin = chamber.driver, chamber.twin
    assert isinstance(driver, SelfChecking)
    assert list(driver.wrong()) == []
    twin.set_at_panel(name, value)
    (words,) = driver.wrong()
    assert words.startswith(said)
    if name == "profile_state":
        with pytest.raises(NotReady, match="its profile is running"):
            driver.prepare()
        twin.set_at_panel(name, "terminated")
    driver.prepare()
    driver.set_temperature(25.0)
    assert list(driver.wrong()) == []


def test_a_chamber_says_that_its_unit_was_changed_and_nothing_that_follows_from_it(chamber):
    unit = "F" if chamber.twin.registers.read(6730, 1) == [30] else "C"
    other = "C" if unit == "F" else "F"
    chamber.twin.set_units(tcp=other)
    assert list(chamber.driver.wrong()) == [f"the unit of its Modbus temperatures is {other}, not {unit}"]
    chamber.twin.set_units(tcp=unit, display=other)
    assert list(chamber.driver.wrong()) == [], "its display has a unit of its own"


def test_a_chamber_says_that_its_power_was_switched_off(chamber):
    chamber.twin.switch("event_1", on=False)
    assert "event-1 reads off, not on" in chamber.driver.wrong()


def test_a_cascade_that_controls_the_air_is_told():
    bench = oven(cascade=True, alarms=0)
    bench.driver.prepare()
    bench.driver.set_temperature(25.0)
    assert list(bench.driver.wrong()) == []
    bench.twin.set_at_panel("air_control", "on")
    (words,) = bench.driver.wrong()
    assert "its Air Control is on" in words


def test_nothing_is_wrong_with_a_chamber_that_was_only_read():
    bench = oven()
    bench.twin.set_at_panel("setpoint", 30.0)
    bench.driver.read()
    assert list(bench.driver.wrong()) == []


@pytest.mark.parametrize(
    ("index", "subindex", "value", "said"),
    [
        (0x6060, 0, 6, "pitch: 6061h:00 reads 6, not 1"),
        (0x6081, 0, 7200, "pitch: 6081h:00 reads 7200, not 180000"),
        (0x6067, 0, 360, "pitch: 6067h:00 reads 360, not 11"),
        (0x607D, 2, 100, "pitch: 607Dh:02 reads 100, not 6840000"),
        (0x607C, 0, 36000, "pitch: 607Ch:00 reads 36000, not 0"),
    ],
)
def test_a_drive_says_which_object_is_not_as_it_was_prepared(index, subindex, value, said):
    bench = head()
    driver, drive = bench.driver, bench.twin.drives["pitch"]
    driver.prepare()
    assert isinstance(driver, SelfChecking)
    assert driver.wrong() == []
    size = len(drive.read(index, subindex))
    drive.write(index, subindex, value.to_bytes(size, "little"))
    bench.world.sleep(0.1)
    assert driver.wrong() == [said]
    if index != 0x607C:
        driver.prepare()
        assert driver.wrong() == []


def test_gear_and_encoder_of_a_drive_stay_as_they_were_prepared():
    entry = "\n[6091sub{}]\nParameterName=x\nObjectType=7\nDataType={}\nAccessType={}\nDefaultValue={}\nPDOMapping=0\n"
    gear = "\n[6091]\nParameterName=Gear ratio\nObjectType=8\nSubNumber=3\n" + entry.format(0, 5, "const", 2)
    bench = head(eds=EDS + gear + entry.format(1, 7, "rw", 1) + entry.format(2, 7, "rw", 1))
    bench.driver.prepare()
    bench.twin.drives["roll"].write(0x6091, 1, (3).to_bytes(4, "little"))
    assert bench.driver.wrong() == ["roll: 6091h:01 reads 3, not 1"]


def test_a_homed_drive_is_not_wrong():
    bench = head()
    bench.driver.prepare()
    bench.driver.home()
    while any(state.moving for state in bench.driver.read().values()):
        bench.world.sleep(0.5)
    bench.driver.move({"pitch": 10.0})
    bench.world.sleep(20.0)
    assert bench.driver.wrong() == []
