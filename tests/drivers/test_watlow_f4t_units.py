"""Watlow F4T: which unit a number on the wire is in, and what is refused where the evidence disagrees."""

from __future__ import annotations

import re
from typing import Any, Literal

import pytest
from buses import REGISTER_MAP, Simulated, oven

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.drivers.errors import BadReply
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires import Wires
from rig.errors import ConfigurationError
from rig.sims.twins.watlow_f4t import WatlowF4TTwin
from rig.sims.wires.modbus_line import ModbusCable, ModbusEndpoint
from rig.simulated.dry_run import DryBench

OLD_MAP = re.sub(r"(?m)^modbus_units_\w+ = .*?$", "", REGISTER_MAP)
"""The map of a controller whose firmware has no Modbus unit of its own."""

Oven = Simulated[WatlowF4T, WatlowF4TTwin]


def over(bench: Oven, port: Literal["tcp", "rtu"], **options: Any) -> WatlowF4T:
    """A driver at one of the controller's ports."""
    address = {"tcp": "sim://w/oven", "rtu": "modbus-rtu://sim://w/oven/1"}[port]
    endpoint = ModbusEndpoint(bench.world, {1: bench.twin.ports[port]})
    wires = Wires(bench.world, simulated={"modbus": lambda _: ModbusCable(bench.world, endpoint.on_rx)})
    return WatlowF4T("oven", address, WatlowF4T.Options(register_map=REGISTER_MAP, **options), wires, bench.world)


@pytest.mark.parametrize("display", ["C", "F"])
@pytest.mark.parametrize("tcp", ["C", "F"])
@pytest.mark.parametrize("rtu", ["C", "F"])
def test_each_port_has_its_own_unit_and_the_display_none_of_theirs(display: str, tcp: str, rtu: str) -> None:
    bench = oven()
    bench.twin.set_units(display=display, tcp=tcp, rtu=rtu)
    for port in ("tcp", "rtu"):
        driver = over(bench, port)  # type: ignore[arg-type]  # one of the two
        driver.prepare()
        driver.set_temperature(25.0)
        assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(25.0, abs=1e-4)
        assert driver.read().setpoint_degC == pytest.approx(25.0, abs=1e-4)
        driver.set_temperature(30.0)
        driver.make_safe()
        assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(23.0, abs=1e-4)


def test_a_dry_run_asks_the_port_that_the_bench_file_names() -> None:
    text = """
name = "lab"
[instruments.oven]
driver = "watlow-f4t"
address = "{}"
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
[sensors.x]
axis = "x"
reader = "dvm"
"""
    for address, register in (
        ("modbus-tcp://192.0.2.10:502/1", 6730),
        ("modbus-rtu:///dev/rig/chambers/2", 14080),
        ("modbus-rtu://socket://192.0.2.10:4001/1", 14080),
    ):
        sent: list[bytes] = []
        dry = DryBench(
            parse_bench(text.format(address), "bench.toml"),
            {},
            tap=lambda _, way, data, sent=sent: sent.append(data) if way == "tx" else None,  # type: ignore[misc]  # bound now
        )
        dry.sim.twin("oven").set_units(tcp="C" if register == 14080 else "F", rtu="F" if register == 14080 else "C")
        values = dry.sim.twin("oven"), dry.config.instruments["oven"].address
        options = WatlowF4T.Options(register_map=REGISTER_MAP)
        driver = WatlowF4T("oven", values[1], options, dry.wires, dry.world)
        driver.set_temperature(25.0)
        assert int.from_bytes(sent[0][8:10], "big") == register
        assert dry.sim.plant.chamber("oven").setpoint_degC == pytest.approx(25.0, abs=1e-4)
        dry.close()


@pytest.mark.parametrize("modbus", ["C", "F"])
def test_a_controller_that_does_not_tell_its_unit_needs_it_in_the_bench_file(modbus: str) -> None:
    for bench, given in ((oven(register_map=OLD_MAP), OLD_MAP), (oven(register_map=OLD_MAP), REGISTER_MAP)):
        bench.twin.set_units(display="C", tcp=modbus)
        cable = ModbusCable(bench.world, bench.twin.on_rx)
        wires = Wires(bench.world, simulated={"modbus": lambda _, cable=cable: cable})  # type: ignore[misc]  # bound now

        def driver(wires: Wires = wires, given: str = given, bench: Oven = bench, **options: Any) -> WatlowF4T:
            return WatlowF4T(
                "oven", "sim://w/oven", WatlowF4T.Options(register_map=given, **options), wires, bench.world
            )

        with pytest.raises(BadReply, match=r"does not report the unit .*; write units = C or F in the bench file"):
            driver().set_temperature(25.0)
        assert bench.plant.chamber("oven").setpoint_degC == 23.0, "nothing was set"
        driver(units=modbus).set_temperature(25.0)
        assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(25.0, abs=1e-4)


@pytest.mark.parametrize(("declared", "own"), [("C", "F"), ("F", "C")])
def test_a_declared_unit_that_contradicts_the_controllers_own_is_refused(declared: str, own: str) -> None:
    bench = oven(modbus_units=own, units=declared)
    for action in (bench.driver.prepare, bench.driver.read, bench.driver.make_safe, bench.driver.stop):
        with pytest.raises(BadReply, match=f"says units = {declared}, .* is {own}; correct one of them"):
            action()
    assert bench.plant.chamber("oven").setpoint_degC == 23.0


def test_units_that_make_no_sense_set_no_temperature(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reply cut on its way had the code 1 for the units, and 23 degC were sent as 23 degF."""
    bench = oven()
    monkeypatch.setattr(bench.driver, "_words", lambda name, number=0: [1])
    with pytest.raises(BadReply, match="modbus_units_tcp read code 1, neither C nor F"):
        bench.driver.set_temperature(23.0)


def test_a_unit_that_changes_in_mid_run_is_refused_and_the_safe_state_is_reached_in_the_new_one() -> None:
    bench = oven(modbus_units="C")
    bench.driver.prepare()
    bench.driver.set_temperature(60.0)
    bench.twin.set_units(tcp="F")
    for action in (bench.driver.read, bench.driver.stop, lambda: bench.driver.set_temperature(50.0)):
        with pytest.raises(BadReply, match="was C and is F now; set it back, or resume the run"):
            action()
    assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(60.0, abs=1e-4)
    bench.driver.make_safe()
    assert bench.plant.chamber("oven").setpoint_degC == pytest.approx(23.0, abs=1e-4)
    assert bench.driver.read().setpoint_degC == pytest.approx(23.0, abs=1e-4)


def lying(bench: Oven, says: str) -> None:
    """Have the unit's register say something else than what the numbers are in."""
    code = {"C": 15, "F": 30}[says]
    bank = bench.twin.ports["tcp"]
    honest = bank.read
    bank.read = lambda address, count: [code] if address == 6730 else honest(address, count)  # type: ignore[method-assign]  # it lies


@pytest.mark.parametrize(
    ("limits", "truth", "says", "sentence"),
    [
        ((10.0, 40.0), "F", "C", r"it reads 7\d\.\d+, which is 7\d\.\d+ degC if its unit is C, no temperature of this"),
        ((-40.0, 100.0), "C", "F", r"its setpoint range is -40 to 65\.56 degC if its unit is F, which does not hold"),
    ],
)
def test_a_chamber_that_makes_no_sense_in_its_unit_but_in_the_other_is_refused(
    limits: tuple[float, float], truth: str, says: str, sentence: str
) -> None:
    bench = oven(modbus_units=truth, low_degC=limits[0], high_degC=limits[1])
    lying(bench, says)
    for action in (bench.driver.prepare, bench.driver.make_safe, lambda: bench.driver.set_temperature(25.0)):
        with pytest.raises(BadReply, match=sentence):
            action()
    assert bench.plant.chamber("oven").setpoint_degC == 23.0, "nothing was set"


def test_a_chamber_that_runs_away_is_not_taken_for_one_in_another_unit() -> None:
    """Once the unit is known by its witnesses, a temperature far outside the limits is one, and is told."""
    bench = oven(modbus_units="C", low_degC=10.0, high_degC=40.0)
    bench.driver.prepare()
    bench.plant.chamber("oven").command(bench.world.now(), 75.0)
    bench.world.sleep(4 * 3600.0)
    assert bench.driver.read().temperature_degC > 65.0
    bench.driver.make_safe()
    assert bench.driver.read().setpoint_degC == pytest.approx(23.0, abs=1e-4)


def test_a_chamber_a_little_outside_its_limits_is_not_taken_for_one_in_another_unit() -> None:
    bench = oven(modbus_units="C", low_degC=5.0, high_degC=40.0)
    bench.plant.chamber("oven").command(bench.world.now(), 43.0)
    bench.world.sleep(4 * 3600.0)
    assert bench.driver.read().temperature_degC == pytest.approx(43.0, abs=0.5), "43 degF would be 6 degC"


def test_a_broken_sensor_bears_witness_once_it_is_mended() -> None:
    bench = oven(modbus_units="F", low_degC=10.0, high_degC=40.0)
    lying(bench, "C")
    bench.twin.sensor_broken = True
    with pytest.raises(BadReply, match="process_value reads nan"):
        bench.driver.read()
    bench.twin.sensor_broken = False
    with pytest.raises(BadReply, match="no temperature of this chamber"):
        bench.driver.read()


def test_the_display_is_no_unit_for_a_new_bench_and_means_modbus_in_a_run_that_was_begun_with_it() -> None:
    text = """
name = "lab"
[instruments.oven]
driver = "watlow-f4t"
address = "modbus-tcp://192.0.2.10:502/1"
units = "display"
[instruments.dvm]
driver = "keysight-34401a"
address = "/dev/rig/dvm"
[sensors.x]
axis = "x"
reader = "dvm"
"""
    config = parse_bench(text, "bench.toml")
    with pytest.raises(ConfigurationError, match=r"instruments\.oven.*the display's unit is not that of Modbus"):
        check_options(config, "bench.toml")
    checked = check_options(config, "bench.toml", strict=False)["oven"]
    assert isinstance(checked, WatlowF4T.Options)
    assert checked.units == "modbus"
