"""Watlow F4T: the registers on the wire, and driver and twin as a chamber."""

import re
import struct

import pytest
from buses import REGISTER_MAP, oven
from pydantic import ValidationError
from pymodbus.client import ModbusTcpClient

from rig.drivers.errors import BadReply, InstrumentError, LimitError, WrongInstrument
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires import Wires
from rig.sims.wires.modbus_line import ModbusCable
from rig.sims.wires.modbus_slave import Refused

WITHOUT_MORE = re.sub(r"(?ms)^(limit_\w+ = .*?$|\[cascade\].*?(?=^\[))", "", REGISTER_MAP)
"""The map of a controller without cascades and limit controllers."""
NO_RAMP = re.sub(r"(?m)^ramp_\w+ = \{ address = 40.*?$", "", REGISTER_MAP)


class Independent(ModbusTcpClient):
    """pymodbus's client on the twin, without our driver."""

    def __init__(self, cable: ModbusCable) -> None:
        super().__init__("", retries=0)
        self.cable = cable

    def connect(self) -> bool:
        return True

    def send(self, request: bytes, addr: object = None) -> int:
        self.cable.send(request)
        return len(request)

    def recv(self, size: int | None) -> bytes:
        return self.cable.recv(1.0)

    def close(self) -> None:
        pass

    def number(self, address: int) -> float:
        words = self.read_holding_registers(address, count=2).registers
        return float(self.convert_from_registers(words, self.DATATYPE.FLOAT32, word_order="little"))  # type: ignore[arg-type]  # one number

    def set(self, address: int, value: float) -> bool:
        words = self.convert_to_registers(value, self.DATATYPE.FLOAT32, word_order="little")
        return not self.write_registers(address, words).isError()


def adu(transaction: int, pdu: bytes) -> str:
    return (struct.pack(">HHHB", transaction, 0, 1 + len(pdu), 1) + pdu).hex()


def pdus(lines: list[str]) -> list[str]:
    """Without MBAP heads."""
    return [f"{line[:3]}{line[3 + 14 :]}" for line in lines]


def test_setting_a_temperature_is_the_manuals_registers_low_word_first() -> None:
    bench = oven(modbus_units="C")
    bench.driver.prepare()  # the unit's other witnesses are asked once
    assert pdus(bench.bytes_of(lambda: bench.driver.set_temperature(23.5))) == [
        "tx 031a4a0001",  # 6730: unit of Modbus TCP
        "rx 0302000f",
        "tx 030ade0002",  # 2782: the earlier set point, to go back to
        "rx 0304000041b8",
        "tx 100ade000204000041bc",  # 2782: set point
        "rx 100ade0002",
        "tx 030ade0002",
        "rx 0304000041bc",
        "tx 031a4a0001",  # the unit once more
        "rx 0302000f",
        "tx 030aaa0001",  # 2730: control mode, 10 auto
        "rx 0302000a",
    ]


def test_reading_asks_for_set_point_process_value_power_mode_and_alarms() -> None:
    bench = oven(modbus_units="C", alarms=2, loop=3)
    bench.driver.prepare()
    bench.world.sleep(1.0)
    sent = [line for line in bench.bytes_of(bench.driver.read) if line.startswith("tx")]
    addresses = [int(line[-8:-4], 16) for line in sent]
    assert addresses == [6730, 2782 + 320, 2820 + 320, 2808 + 320, 2814 + 320, 1356, 1456]


def test_the_enclosure_goes_to_the_setpoint_and_the_readings_say_so() -> None:
    bench = oven()
    bench.driver.prepare()
    bench.driver.set_temperature(27.0)
    bench.world.sleep(3600.0)
    state = bench.driver.read()
    assert state.setpoint_degC == pytest.approx(27.0, abs=1e-4)
    assert state.temperature_degC == pytest.approx(
        bench.plant.temperature_degC("enclosure", bench.world.now()), abs=0.02
    )
    assert state.temperature_degC == pytest.approx(27.0, abs=0.5)
    assert 0 < state.power_pct < 100
    assert state.running
    assert state.alarms == ()


def test_a_ramp_is_set_and_followed() -> None:
    bench = oven(ramp_degC_per_min=0.5, modbus_units="C")
    client = Independent(ModbusCable(bench.world, bench.twin.on_rx))
    client.write_register(6730, 15)
    bench.driver.prepare()
    assert [client.read_holding_registers(a).registers[0] for a in (2794, 2796)] == [85, 57]
    assert client.number(2798) == pytest.approx(0.5)
    bench.driver.set_temperature(28.0)
    bench.world.sleep(240.0)
    assert client.number(2810) == pytest.approx(25.0, abs=0.01)
    assert bench.driver.read().setpoint_degC == 28.0
    bench.world.sleep(400.0)
    assert client.number(2810) == pytest.approx(28.0)


def test_control_switched_off_is_seen_and_switched_on_again() -> None:
    bench = oven()
    client = Independent(ModbusCable(bench.world, bench.twin.on_rx))
    client.write_register(2730, 62)
    assert not bench.driver.read().running
    assert bench.driver.read().power_pct == 0.0
    bench.driver.set_temperature(23.0)
    assert bench.driver.read().running


def test_stop_holds_where_it_is() -> None:
    bench = oven()
    bench.driver.set_temperature(30.0)
    bench.world.sleep(300.0)
    here = bench.driver.read().temperature_degC
    bench.driver.stop()
    assert bench.driver.read().setpoint_degC == pytest.approx(here, abs=0.05)


def test_the_safe_state_is_about_ambient_under_control() -> None:
    bench = oven(safe_degC=22.0)
    bench.driver.set_temperature(60.0)
    bench.driver.make_safe()
    state = bench.driver.read()
    assert state.setpoint_degC == pytest.approx(22.0, abs=1e-4)
    assert state.running


@pytest.mark.parametrize("degC", [9.999, 40.001, float("nan"), float("inf")])
def test_nothing_is_sent_outside_the_limits(degC: float) -> None:
    bench = oven(low_degC=10.0, high_degC=40.0)
    assert bench.driver.limits() == (10.0, 40.0)
    with pytest.raises(LimitError, match=r"oven at sim://w/oven: .* is outside 10 to 40 degC"):
        bench.driver.set_temperature(degC)
    assert bench.log == []


def test_a_controller_that_allows_less_than_the_bench_is_told() -> None:
    bench = oven(low_degC=-140.0)
    bench.driver.prepare()
    client = Independent(ModbusCable(bench.world, bench.twin.on_rx))
    client.set(2774, -58.0)  # degrees Fahrenheit
    with pytest.raises(LimitError, match="the controller's own setpoint range is -50 to 150 degC"):
        bench.driver.prepare()


@pytest.mark.parametrize("units", ["C", "F"])
def test_alarms_are_named_with_the_limit_that_was_passed(units: str) -> None:
    bench = oven()
    Independent(ModbusCable(bench.world, bench.twin.on_rx)).write_register(6730, {"C": 15, "F": 30}[units])
    bench.twin.set_alarm(1, "low", "process", -10.0)
    bench.twin.set_alarm(2, "high", "deviation", 5.0)
    bench.twin.set_alarm(3, "blocked")
    bench.twin.set_alarm(4, "error")
    assert bench.driver.read().alarms == (
        "alarm 1: below -10 degC",
        "alarm 2: above 5 degC from the setpoint",
        "alarm 4: its sensor cannot be read",
    )


def test_alarms_have_the_manuals_registers() -> None:
    bench = oven()
    client = Independent(ModbusCable(bench.world, bench.twin.on_rx))
    bench.twin.set_alarm(3, "high", "process", 60.0)
    assert [client.read_holding_registers(a).registers for a in (1330 + 200, 1356 + 200, 1356)] == [[76], [37], [61]]
    assert client.number(1334 + 200) == pytest.approx(140.0)


def test_an_alarm_of_a_map_that_knows_no_more_is_its_state() -> None:
    lines = [line for line in REGISTER_MAP.splitlines() if not line.startswith(("alarm_type", "alarm_high"))]
    bench = oven()
    bench.twin.set_alarm(2, "high")
    known = WatlowF4T.Options(register_map="\n".join(lines))
    wires = Wires(bench.world, simulated={"modbus": lambda address: ModbusCable(bench.world, bench.twin.on_rx)})
    assert WatlowF4T("oven", "sim://w/oven", known, wires, bench.world).read().alarms == ("alarm 2: high",)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({}, ()),
        ({"state": "error"}, ("limit controller in slot 5: tripped; reset it at the chamber",)),
        ({"state": "error", "error": "open"}, ("limit controller in slot 5: its sensor: open",)),
        ({"status": "fail"}, ("limit controller in slot 5: failed",)),
    ],
)
def test_a_limit_controller_is_an_alarm_if_it_is_watched(fault: dict[str, str], words: tuple[str, ...]) -> None:
    bench = oven(limit_modules=[5])
    bench.twin.set_limit(5, **fault)
    assert bench.driver.read().alarms == words
    other = oven()
    other.twin.set_limit(5, **fault)
    assert other.driver.read().alarms == ()


def test_a_broken_sensor_gives_no_temperature() -> None:
    bench = oven()
    bench.twin.sensor_broken = True
    with pytest.raises(BadReply, match="process_value reads nan; look at the controller's sensor"):
        bench.driver.read()
    with pytest.raises(BadReply):
        bench.driver.stop()
    bench.driver.make_safe()


# --- the second loop, and cascades


def test_the_second_loop_is_160_registers_on_and_its_alarms_are_the_controllers() -> None:
    bench = oven(modbus_units="C", loop=2, alarms=1)
    client = Independent(ModbusCable(bench.world, bench.twin.on_rx))
    client.write_register(6730, 15)
    bench.driver.prepare()
    bench.driver.set_temperature(-20.0)
    assert client.number(2782 + 160) == -20.0
    assert client.read_holding_registers(2730 + 160).registers == [10]
    assert client.read_holding_registers(2782).isError(), "the first loop is not this twin's"
    sent = [line for line in bench.bytes_of(bench.driver.read) if line.startswith("tx")]
    assert [int(line[-8:-4], 16) for line in sent] == [6730, 2942, 2980, 2968, 2974, 1356]


def test_a_cascade_is_set_and_read_at_its_own_registers() -> None:
    bench = oven(modbus_units="C", cascade=True, alarms=1)
    bench.driver.prepare()
    sent = [line for line in pdus(bench.bytes_of(lambda: bench.driver.set_temperature(30.0))) if line.startswith("tx")]
    assert sent.pop(3) == "tx 100fca000204000041f0", "4042: the part's set point"
    assert [int(line[-8:-4], 16) for line in sent] == [6730, 4200, 4042, 4042, 6730, 4010]
    sent = [line for line in bench.bytes_of(bench.driver.read) if line.startswith("tx")]
    assert [int(line[-8:-4], 16) for line in sent] == [6730, 4200, 4042, 4180, 4178, 4012, 1356]
    second = oven(modbus_units="C", cascade=True, alarms=0, loop=2)
    second.driver.prepare()
    sent = [line for line in second.bytes_of(second.driver.read) if line.startswith("tx")]
    assert [int(line[-8:-4], 16) for line in sent] == [6730, 4400, 4242, 4380, 4378, 4212]


def test_in_a_cascade_the_temperature_is_the_parts_which_follows_the_air() -> None:
    bench = oven(cascade=True)
    client = Independent(ModbusCable(bench.world, bench.twin.on_rx))
    client.write_register(6730, 15)
    bench.driver.prepare()
    bench.driver.set_temperature(40.0)
    bench.world.sleep(900.0)
    state, now = bench.driver.read(), bench.world.now()
    part, air = (bench.plant.temperature_degC(place, now) for place in ("package", "enclosure"))
    assert state.temperature_degC == pytest.approx(part, abs=0.02)
    assert client.number(4182) == pytest.approx(air, abs=0.02)
    leading = bench.plant.chamber("oven").active_setpoint_degC(now)
    assert client.number(4188) == pytest.approx(leading, abs=0.02), "the inner loop's set point"
    assert air - part > 1.0
    assert (state.setpoint_degC, state.running) == (pytest.approx(40.0, abs=1e-4), True)
    bench.driver.stop()
    assert bench.driver.read().setpoint_degC == pytest.approx(part, abs=0.1)
    bench.driver.make_safe()
    assert bench.driver.read().setpoint_degC == pytest.approx(23.0, abs=1e-4)


def test_the_range_of_a_cascade_is_checked() -> None:
    bench = oven(cascade=True, high_degC=120.0)
    client = Independent(ModbusCable(bench.world, bench.twin.on_rx))
    client.write_register(6730, 15)
    client.set(4036, 110.0)
    with pytest.raises(LimitError, match="the controller's own setpoint range is -40 to 110 degC"):
        bench.driver.prepare()


def test_a_setpoint_that_reads_back_differently_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = oven()
    monkeypatch.setattr(bench.plant.enclosure, "command", lambda *args, **kwargs: None)
    with pytest.raises(BadReply, match=r"setpoint was set to 86 and reads back 73\.4"):
        bench.driver.set_temperature(30.0)


def test_another_modbus_device_is_the_wrong_instrument() -> None:
    bench = oven(register_map=REGISTER_MAP.replace('model = "F4T"', 'model = "D4T"'))
    with pytest.raises(WrongInstrument, match="should be a Watlow D4T; its part number is 'F4T1A2CAA1A1AAA'"):
        bench.driver.identify()
    bench = oven()
    bench.twin.registers.read = lambda address, count: (_ for _ in ()).throw(Refused(2))  # type: ignore[method-assign]  # has none
    with pytest.raises(WrongInstrument, match="its part number is ''"):
        bench.driver.identify()


@pytest.mark.parametrize(
    ("pdu", "answer"),
    [
        ("03 0001 0001", "83 02"),  # no such register
        ("03 0ADD 0002", "83 02"),  # one of the two
        ("06 0AF8 0000", "86 02"),  # power is read only
        ("06 0ADE 0000", "86 02"),  # half of a number
        ("06 0AAA 0007", "86 03"),  # no such mode
        ("10 0ADE 0002 04 0000 4479", "90 03"),  # 996 degrees
        ("05 0001 FF00", "85 01"),  # no coils
    ],
)
def test_what_the_twin_refuses(pdu: str, answer: str) -> None:
    bench = oven()
    cable = ModbusCable(bench.world, bench.twin.on_rx)
    cable.send(bytes.fromhex(adu(1, bytes.fromhex(pdu))))
    assert cable.recv(1.0).hex() == adu(1, bytes.fromhex(answer))


def test_a_refusal_reaches_the_operator_with_its_meaning() -> None:
    bench = oven(high_degC=400.0)
    Independent(ModbusCable(bench.world, bench.twin.on_rx)).set(2776, 300.0)
    with pytest.raises(InstrumentError, match=r"oven at sim://w/oven reports error 3: writing 2 word.s. at 2782"):
        bench.driver.set_temperature(399.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"register_map": "nonsense"}, "the register map cannot be read"),
        ({"register_map": "maker = 'x'"}, "the register map cannot be read"),
        ({"register_map": REGISTER_MAP, "low_degC": 50.0, "high_degC": 40.0}, "low_degC 50 is not below high_degC 40"),
        ({"register_map": REGISTER_MAP, "safe_degC": 400.0}, "safe_degC 400 is outside"),
        ({"register_map": REGISTER_MAP, "setpoint": 1}, "Extra inputs"),
        ({"register_map": REGISTER_MAP, "limit_modules": [7]}, "a controller has slots 1 to 6"),
        ({"register_map": NO_RAMP, "cascade": True, "ramp_degC_per_min": 2.0}, "the register map knows no ramp"),
        ({"register_map": REGISTER_MAP.replace("event_2", "event_x"), "power": "event-2"}, "knows no event-2"),
        ({"register_map": REGISTER_MAP, "power": "event-9"}, "should match pattern"),
        ({"register_map": REGISTER_MAP, "units": "display"}, "the display's unit is not that of Modbus"),
        ({"register_map": WITHOUT_MORE, "cascade": True}, "the register map knows no cascade"),
        ({"register_map": WITHOUT_MORE, "limit_modules": [5]}, "the register map knows no limit_modules"),
    ],
)
def test_options_are_strict(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        WatlowF4T.Options.model_validate(options)


@pytest.mark.parametrize(("address", "count"), [(2782, 1), (2783, 1), (2783, 2), (2821, 1), (2782, 3), (5, 1)])
def test_the_twin_refuses_halves_of_numbers(address: int, count: int) -> None:
    bank = oven().twin.registers
    with pytest.raises(Refused) as caught:
        bank.read(address, count)
    assert caught.value.code == 2
    assert len(bank.read(18, 5)) == 5, "a part of a text is none"
