"""Our F4T driver against pymodbus's server, over TCP and as RTU over TCP, with units that disagree.

A driver that believed the display wrote 77 for 25 here.
"""

from __future__ import annotations

from typing import Any

import pytest
from buses import REGISTER_MAP
from foreign_modbus import Foreign, serving
from pymodbus import FramerType

from rig.drivers.clock import RealClock
from rig.drivers.errors import BadReply, DriverError
from rig.drivers.watlow_f4t import WatlowF4T
from rig.drivers.wires import Wires

CODES = {"C": 15, "F": 30}
OWN = {FramerType.SOCKET: 6730, FramerType.RTU: 14080}
FRAMERS = [pytest.param(FramerType.SOCKET, id="tcp"), pytest.param(FramerType.RTU, id="rtu-over-tcp")]


def shown(degC: float, unit: str) -> float:
    return degC * 1.8 + 32.0 if unit == "F" else degC


def f4t(display: str, modbus: str, framer: FramerType, temperature_degC: float = 23.0) -> dict[int, int | float]:
    """Registers of a chamber whose numbers are in the unit `modbus`; the other port's is the other one."""
    other = 6730 + 14080 - OWN[framer]
    return {
        1328: CODES[display],
        OWN[framer]: CODES[modbus],
        other: CODES["C" if modbus == "F" else "F"],
        2730: 62,
        2814: 62,
        1356: 61,
        2794: 62,
        2796: 39,
        16594: 62,
        2774: shown(-60.0, modbus),
        2776: shown(150.0, modbus),
        2782: shown(20.0, modbus),
        2798: 1.0,
        2808: 0.0,
        2820: shown(temperature_degC, modbus),
    }


def driver(server: Foreign, **options: Any) -> WatlowF4T:
    given = WatlowF4T.Options(register_map=REGISTER_MAP, alarms=1, timeout_s=5.0, **options)
    clock = RealClock()
    return WatlowF4T("oven", server.address, given, Wires(clock), clock)


@pytest.mark.parametrize("framer", FRAMERS)
@pytest.mark.parametrize("display", ["C", "F"])
@pytest.mark.parametrize("modbus", ["C", "F"])
def test_what_is_written_is_in_the_unit_of_the_wire_whatever_the_display_shows(
    framer: FramerType, display: str, modbus: str
) -> None:
    with serving(f4t(display, modbus, framer), framer) as server:
        oven = driver(server, power="event-1", ramp_degC_per_min=2.0)
        oven.prepare()
        oven.set_temperature(25.0)
        assert server.number(2782) == pytest.approx({"C": 25.0, "F": 77.0}[modbus])
        assert server.number(2798) == pytest.approx({"C": 2.0, "F": 3.6}[modbus])
        assert (server.words(2730, 1), server.words(16594, 1)) == ([10], [63])
        state = oven.read()
        assert state.setpoint_degC == pytest.approx(25.0, abs=1e-4)
        assert state.temperature_degC == pytest.approx(23.0, abs=1e-4)
        assert not state.running, "this server's mode in force (2814) stays off, whatever is asked for"
        oven.make_safe()
        assert server.number(2782) == pytest.approx(shown(23.0, modbus))
        oven.close()


@pytest.mark.parametrize("framer", FRAMERS)
@pytest.mark.parametrize("display", ["C", "F"])
def test_without_the_register_the_display_is_not_believed(framer: FramerType, display: str) -> None:
    registers = f4t(display, "C", framer)
    del registers[OWN[framer]]
    with serving(registers, framer) as server:
        oven = driver(server)
        with pytest.raises(BadReply, match="write units = C or F in the bench file"):
            oven.set_temperature(25.0)
        assert server.number(2782) == pytest.approx(20.0), "nothing was written"
        oven.close()
        told = driver(server, units="C")
        told.set_temperature(25.0)
        assert server.number(2782) == pytest.approx(25.0)
        told.close()


@pytest.mark.parametrize("framer", FRAMERS)
@pytest.mark.parametrize(("says", "truly"), [("C", "F"), ("F", "C")])
def test_a_register_that_the_chamber_itself_contradicts_sets_nothing(framer: FramerType, says: str, truly: str) -> None:
    registers = f4t(says, truly, framer, temperature_degC=35.0) | {OWN[framer]: CODES[says]}
    with serving(registers, framer) as server:
        oven = driver(server, low_degC=22.0, high_degC=70.0)
        before = server.number(2782)
        for action in (oven.prepare, oven.read, oven.stop, oven.make_safe, lambda: oven.set_temperature(25.0)):
            with pytest.raises(DriverError, match="if its unit is"):
                action()
        assert server.number(2782) == before
        oven.close()


def test_a_unit_that_somebody_changes_meanwhile_is_noticed() -> None:
    with serving(f4t("C", "C", FramerType.SOCKET), FramerType.SOCKET) as server:
        oven = driver(server)
        oven.set_temperature(25.0)
        server.write(6730, CODES["F"])
        with pytest.raises(BadReply, match="was C and is F now"):
            oven.set_temperature(26.0)
        assert server.number(2782) == pytest.approx(25.0)
        oven.close()


def test_devices_behind_one_serial_server_share_its_connection() -> None:
    with serving(f4t("C", "C", FramerType.RTU), FramerType.RTU) as server:
        clock = RealClock()
        wires = Wires(clock)
        silent = WatlowF4T.Options(register_map=REGISTER_MAP, timeout_s=0.3)
        one = WatlowF4T("one", server.address, WatlowF4T.Options(register_map=REGISTER_MAP), wires, clock)
        two = WatlowF4T("two", server.address[:-1] + "2", silent, wires, clock)
        one.set_temperature(25.0)
        with pytest.raises(DriverError, match=r"two at modbus-rtu://socket://127\.0\.0\.1"):
            two.set_temperature(25.0)
        one.set_temperature(26.0)
        assert server.number(2782) == pytest.approx(26.0), "a silent neighbour does not spoil the line"
        wires.close()
