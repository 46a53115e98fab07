"""Who is at the wires: serial ports of this machine, and who answers an identity question at a named address."""

from __future__ import annotations

from rig.drivers.clock import RealClock
from rig.drivers.errors import DriverError
from rig.errors import RigError
from rig.unattended.doctor.addresses import serial_ports
from rig.verbs.instrument.scan import scan


def who_is_there(address: str = "") -> list[str]:
    """Serial ports, or who answers at an address, a line each; a sentence if there is nobody. Only identity is asked.

    Args:
        address: where to ask; "" lists serial ports, and opens none.
    """
    if not address:
        return serial_ports() or ["no USB serial port is present"]
    try:
        found = [f"{driver}: {who}" for driver, who in scan(address, RealClock())]
    except (DriverError, RigError) as error:
        return [str(error)]
    return found or ["nobody answers who is known"]
