"""A chamber and a probe on a CAN bus, by python-can and cantools alone: nothing of it is of this project.

`foreign_can.py GROUP DBC SECONDS` is a process of its own on a multicast group that does not leave this machine. The
chamber wants its command every 100 ms and switches off without it; between its messages it sends others, remote frames,
and now and then a frame that is too short.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import can
import cantools.database

_now = time.monotonic  # noqa: TID251 - it is nobody of this project
LOST_S = 0.5
LAG_S = 0.4


def main(group: str, dbc: str, seconds: float) -> None:
    """Send and obey for so long."""
    messages = cantools.database.load_file(dbc)
    bus = can.Bus(group, "udp_multicast", hop_limit=0)
    command = messages.get_message_by_name("Command")
    began = last = told = _now()
    setpoint, actual, on, count = 20.0, 20.0, False, 0
    due = {"State": began, "Product": began, "Noise": began}

    def send(name: str, **values: object) -> None:
        one = messages.get_message_by_name(name)
        bus.send(
            can.Message(
                arbitration_id=one.frame_id,
                is_extended_id=one.is_extended_frame,
                data=messages.encode_message(name, values),
            )
        )

    while (now := _now()) < began + seconds:
        heard = bus.recv(max(0.0, min(due.values()) - now))
        now = _now()
        if heard is not None and heard.arbitration_id == command.frame_id and not heard.is_remote_frame:
            values = command.decode(heard.data)
            setpoint, on, told = float(values["Setpoint"]), bool(values["Enable"]), now
        if now > told + LOST_S:
            on = False
        aim = setpoint if on else 20.0
        actual += (aim - actual) * min(1.0, (now - last) / LAG_S)
        last = now
        if now >= due["State"]:
            due["State"] = now + 0.05
            count += 1
            arrived = on and abs(actual - setpoint) < 0.05
            send("State", Mode="Running" if on else "Idle", Arrived=arrived, Alarm=0, Setpoint=setpoint, Actual=actual)
            send("Probe", Group=0, Count=count % 256, Temperature=actual, Quality="valid" if count % 7 else "settling")
            send("Probe", Group=1, Count=count % 256, Supply=4.98)
        if now >= due["Product"]:
            due["Product"] = now + 0.2
            send("Product", Type="Chamber C7", Serial=4711)
        if now >= due["Noise"]:
            due["Noise"] = now + 0.11
            bus.send(can.Message(arbitration_id=0x200, is_extended_id=True, data=b"\xff" * 8))
            bus.send(can.Message(arbitration_id=0x200, is_extended_id=False, is_remote_frame=True, dlc=8))
            bus.send(can.Message(arbitration_id=0x200, is_extended_id=False, data=b"\x01\xff"))
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=b"\x01"))
    bus.shutdown()


if __name__ == "__main__":
    main(sys.argv[1], str(Path(sys.argv[2])), float(sys.argv[3]))
