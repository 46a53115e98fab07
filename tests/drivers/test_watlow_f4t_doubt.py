"""Watlow F4T: what it says that cannot be, and what somebody changes while the driver is at work."""

from __future__ import annotations

import pytest
from buses import Simulated, oven

from rig.drivers.errors import BadReply, NotReady
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires.modbus import words_of_float
from rig.sims.twins.watlow_f4t import WatlowF4TTwin

Oven = Simulated[WatlowF4T, WatlowF4TTwin]


def says(bench: Oven, address: int, words: list[int]) -> None:
    """Have a register read as these words."""
    bank = bench.twin.ports["tcp"]
    honest = bank.read
    bank.read = lambda at, count: words if at == address else honest(at, count)  # type: ignore[method-assign]  # it lies


def test_an_unknown_alarm_state_is_an_alarm() -> None:
    bench = oven(alarms=1)
    says(bench, 1356, [777])
    assert bench.driver.read().alarms == ("alarm 1: unknown alarm state 777",)


@pytest.mark.parametrize("state", ["startup", "none", "blocked"])
def test_states_that_are_no_alarm(state: str) -> None:
    bench = oven(alarms=1)
    bench.twin.set_alarm(1, state)
    assert bench.driver.read().alarms == ()


@pytest.mark.parametrize("degC", [-1e38, -274.0, 2001.0, 1e38])
def test_a_temperature_that_cannot_be_is_refused_wherever_it_is_read(degC: float) -> None:
    bench = oven(modbus_units="C")
    bench.driver.prepare()
    bench.driver.set_temperature(60.0)
    says(bench, 2820, words_of_float(degC))
    for action in (bench.driver.prepare, bench.driver.read, bench.driver.stop):
        with pytest.raises(BadReply, match="which no chamber can be at; its setpoint stays as it is"):
            action()
        assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(60.0, abs=1e-4)
    bench.driver.make_safe()
    assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(23.0, abs=1e-4)


@pytest.mark.parametrize("degC", [-200.0, 850.0])
def test_stop_does_not_command_a_limit_for_a_broken_sensors_sake(degC: float) -> None:
    """A platinum sensor with a broken wire reads as about 850 degC: the high limit was commanded."""
    bench = oven(modbus_units="C")
    bench.driver.prepare()
    bench.driver.set_temperature(60.0)
    says(bench, 2820, words_of_float(degC))
    with pytest.raises(BadReply, match=r"far outside -40 to 100 degC; its setpoint stays as it is"):
        bench.driver.stop()
    assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(60.0, abs=1e-4)
    says(bench, 2820, words_of_float(105.0))
    bench.driver.stop()
    assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(100.0, abs=1e-4), "a little outside"


def test_air_control_that_is_switched_on_in_mid_run_is_told() -> None:
    bench = oven(cascade=True)
    bench.driver.prepare()
    bench.driver.set_temperature(30.0)
    assert bench.driver.read().running
    bench.twin.registers.write(4200, [63])
    state = bench.driver.read()
    assert not state.running
    assert state.alarms == ("its Air Control is on, so it is not a cascade; switch it off there",)
    with pytest.raises(NotReady, match="its Air Control is on"):
        bench.driver.set_temperature(50.0)
    assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(30.0, abs=1e-4)


@pytest.mark.parametrize(("found", "left"), [(54, 10), (62, 62), (10, 10)])
def test_stop_ends_a_power_that_was_set_by_hand_and_starts_nothing_that_is_off(found: int, left: int) -> None:
    bench = oven()
    bench.driver.prepare()
    bench.driver.set_temperature(60.0)
    bench.world.sleep(300.0)
    bench.twin.registers.write(2730, [found])
    assert bench.driver.read().running == (found == 10)
    here = bench.driver.read().temperature_degC
    bench.driver.stop()
    assert bench.twin.registers.read(2730, 1) == [left]
    assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(here, abs=0.5)


@pytest.mark.parametrize(("was", "becomes"), [("C", "F"), ("F", "C")])
@pytest.mark.parametrize("when", ["before the setpoint", "after its readback"])
def test_a_unit_that_changes_while_the_setpoint_is_set_is_refused_and_starts_nothing(
    was: str, becomes: str, when: str
) -> None:
    bench = oven(modbus_units=was, power="event-1")
    bench.driver.prepare()
    bench.driver.set_temperature(30.0)
    bench.twin.switch("event_1", on=False)
    bank = bench.twin.ports["tcp"]
    write, read = bank.write, bank.read
    done: list[int] = []

    def change_and_write(address: int, words: list[int]) -> None:
        if address == 2782 and not done:
            done.append(address)
            if when == "before the setpoint":
                bench.twin.set_units(tcp=becomes)
        write(address, words)

    def read_and_change(address: int, count: int) -> list[int]:
        words = read(address, count)
        if address == 2782 and done and when == "after its readback":
            bench.twin.set_units(tcp=becomes)
        return words

    bank.write, bank.read = change_and_write, read_and_change  # type: ignore[method-assign,assignment]  # the panel
    with pytest.raises(BadReply, match=f"became {becomes} while the setpoint was set; the earlier setpoint, 30 degC"):
        bench.driver.set_temperature(40.0)
    assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(30.0, abs=1e-3)
    assert not bench.plant.chamber("oven").controlled
    done.clear()
    bench.twin.set_units(tcp=was)
    bench.driver.make_safe()
    assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(23.0, abs=1e-3), "in whichever unit"
