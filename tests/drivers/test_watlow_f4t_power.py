"""Watlow F4T: chambers whose power is an event output or a key, and the ramp of a cascade."""

from __future__ import annotations

from pathlib import Path

import pytest
from buses import oven
from dry import LAB, dry

from rig.drivers.errors import BadReply, NotReady
from rig.run_file.read.reader import RunReader
from rig.simulated.dry_run import DryBench

REGISTERS = {"event_1": 16594, "event_4": 16600, "event_8": 16828, "key_2": 6864}


@pytest.mark.parametrize("power", ["event-1", "event-4", "event-8", "key-2"])
def test_without_power_a_loop_in_automatic_mode_controls_nothing(power: str) -> None:
    name = power.replace("-", "_")
    bench = oven(power=power)
    bench.twin.switch(name, on=False)
    bench.driver.prepare()
    assert bench.twin.registers.read(2814, 1) == [10], "the loop's mode says nothing of it"
    assert not bench.driver.read().running
    assert bench.twin.registers.read(
        {"event_1": 16594, "event_4": 16600, "event_8": 16828, "key_2": 6864}[name], 1
    ) == [62]
    bench.driver.set_temperature(30.0)
    assert bench.driver.read().running
    bench.world.sleep(3 * 3600.0)
    assert bench.driver.read().temperature_degC == pytest.approx(30.0, abs=0.5)
    bench.twin.switch(name, on=False)
    bench.world.sleep(6 * 3600.0)
    state = bench.driver.read()
    assert not state.running
    assert state.temperature_degC < 25.0, "it has gone back to the laboratory's"


def test_power_comes_on_after_the_setpoint_and_only_if_it_is_off() -> None:
    bench = oven(power="event-1", alarms=0)
    bench.driver.prepare()
    bench.twin.switch("event_1", on=False)
    sent = [line[3 + 14 :] for line in bench.bytes_of(lambda: bench.driver.set_temperature(30.0)) if line[0] == "t"]
    assert next(pdu for pdu in sent if pdu[:2] != "03").startswith("100ade"), "2782, the set point, first"
    assert sent[-2:] == ["0640d2003f", "0340d20001"], "16594: on, and read back"
    again = [line for line in bench.bytes_of(lambda: bench.driver.set_temperature(31.0)) if "0640d2" in line]
    assert again == []


def test_preparing_switches_nothing_on() -> None:
    bench = oven(power="event-1")
    bench.driver.set_temperature(60.0)
    bench.twin.switch("event_1", on=False)
    bench.driver.prepare()
    assert not bench.plant.chamber("oven").controlled


def test_the_safe_state_starts_no_chamber_that_is_off_and_keeps_one_that_is_on() -> None:
    bench = oven(power="event-1")
    bench.driver.set_temperature(60.0)
    bench.driver.make_safe()
    assert bench.driver.read().running
    assert bench.driver.read().setpoint_degC == pytest.approx(23.0, abs=1e-4)
    bench.driver.set_temperature(60.0)
    bench.twin.switch("event_1", on=False)
    bench.driver.make_safe()
    bench.driver.stop()
    assert not bench.driver.read().running
    bench.driver.make_safe()
    assert bench.driver.read().setpoint_degC == pytest.approx(23.0, abs=1e-4)
    without = oven()
    without.twin.registers.write(2730, [62])
    without.driver.make_safe()
    assert not without.driver.read().running
    without.twin.registers.write(2730, [54])
    without.driver.make_safe()
    assert without.driver.read().running, "a power that somebody has set by hand is no safe state"
    bench.twin.registers.write(2730, [54])
    bench.driver.make_safe()
    assert bench.twin.registers.read(2730, 1) == [10], "nor is it when the chamber's power comes back"


def test_an_output_that_does_not_switch_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = oven(power="event-1")
    bench.twin.switch("event_1", on=False)
    monkeypatch.setattr(bench.twin, "switch", lambda *_, **__: None)
    with pytest.raises(BadReply, match="event_1 was set to on and reads back off"):
        bench.driver.set_temperature(30.0)


def test_a_key_that_does_not_stay_on_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = oven(power="key-1")
    bench.twin.switch("key_1", on=False)
    monkeypatch.setattr(bench.twin, "switch", lambda *_, **__: None)
    with pytest.raises(BadReply, match=r"key-1 was pressed and reads off; a key that does not stay on"):
        bench.driver.set_temperature(30.0)


def test_a_bench_that_declares_no_power_does_not_start_a_chamber_that_has_it() -> None:
    """What the declaration is for: the loop's mode alone does not start such a chamber."""
    bench = oven(wiring="event-1")
    bench.twin.switch("event_1", on=False)
    bench.driver.set_temperature(30.0)
    assert bench.driver.read().running, "all that this driver can see"
    assert not bench.plant.chamber("oven").controlled


@pytest.mark.parametrize("modbus_units", ["C", "F"])
def test_a_cascades_ramp_is_set_and_followed(modbus_units: str) -> None:
    bench = oven(modbus_units=modbus_units, cascade=True, ramp_degC_per_min=0.5)
    bench.driver.prepare()
    bank = bench.twin.registers
    assert [bank.read(address, 1)[0] for address in (4054, 4056)] == [85, 57]
    assert [bank.read(address, 1)[0] for address in (2794, 2796)] == [62, 57], "the loop's own is left alone"
    bench.driver.set_temperature(28.0)
    bench.world.sleep(240.0)
    assert bench.plant.chamber("oven").active_setpoint_degC(bench.world.now()) == pytest.approx(25.0, abs=0.01)


def test_a_cascade_with_air_control_on_is_none() -> None:
    bench = oven(cascade=True)
    bench.twin.registers.write(4200, [63])
    with pytest.raises(NotReady, match="Air Control is on, so it is not a cascade"):
        bench.driver.prepare()


def test_the_twin_answers_what_public_clients_ask() -> None:
    bench = oven()
    bank = bench.twin.registers
    hour, _, minute, _, second, _, month, _, day, _, year, _ = bank.read(14664, 12)
    assert (year, month, day, hour, minute, second) == (2026, 1, 15, 18, 0, 0), "twelve words, every other one empty"
    assert bank.read(16568, 1) == [251], "no profile was started"
    assert bank.read(2784, 2) == [0, 0], "open-loop power"
    assert [bank.read(a, 1) for a in (16594, 16596, 16598, 16600, 16822)] == [[62]] * 5
    assert bank.identity == b"Watlow F4T1A2CAA1A1AAA"


def test_a_dry_run_behind_a_serial_server_starts_a_chamber_by_its_event_and_leaves_it_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, world = tmp_path / "bench.toml", tmp_path / "world.toml"
    text = (LAB / "bench.toml").read_text()
    address = 'address = "modbus-tcp://192.0.2.10:502/1"'
    assert address in text
    bench.write_text(text.replace(address, 'address = "modbus-rtu://socket://192.0.2.10:4001/1"\npower = "event-1"'))
    world.write_text("[enclosure]\nstart_controlled = false\n")
    events: list[int] = []
    close = DryBench.close

    def look(self: DryBench) -> None:
        events.extend(self.sim.twin("enclosure").ports["rtu"].read(16594, 1))
        close(self)

    monkeypatch.setattr(DryBench, "close", look)
    with RunReader.open(dry(tmp_path, bench=bench, world=world)) as run:
        running = [c["enclosure"]["running"] for r in run.records() if (c := r.data.get("chambers"))]
    assert running == [False], "as it was found"
    assert events == [63], "as it was left"
