"""Instruments of no twin of this project, on loopback sockets: their commands are from the makers' manuals.

- Agilent 34970A user's guide: `UNIT:TEMP C|F`; `FORM:READ:UNIT ON` prints the unit after each reading, as in
  `+2.61950000E+01 C`; `ROUT:SCAN (@101)`; readings are `SD.DDDDDDDDESDD`.
- Keysight Truevolt operating and service guide: `ROUT:TERM?` tells which input terminals the switch at the front panel
  has chosen, FRON or REAR; no command changes it.
- IEEE 488.2: *IDN?, *ESE, *SRE, *PSC; SCPI-1999: `SYST:ERR?`.
"""

from __future__ import annotations

import socketserver
from collections.abc import Callable
from contextlib import ExitStack
from typing import ClassVar

from fake_lines import answering


class Foreign:
    """A source and a meter, one port each. The meter reads the source's setting, in degrees Celsius.

    Attributes:
        at_panel: called before each reading, with its number from 1 and the instrument; changes what it likes.
        unit: of the readings, C or F.
        with_unit: whether the unit is printed.
        terminals: FRON or REAR; the rear ones have another sensor.
        told: errors in its queue.
        tripped: whether the source has tripped.
        values: a reading from the source's setting.
        heard: called with each command to the source.
        printed: what is printed for a reading.

    """

    def __init__(self, at_panel: Callable[[int, Foreign], None] = lambda n, it: None) -> None:
        self.at_panel = at_panel
        self.unit, self.with_unit, self.terminals, self.tripped = "C", False, "FRON", 0
        self.told: list[str] = []
        self.set_to, self.on, self.taken = 20.0, 0, 0
        self.values: Callable[[float], float] = lambda true: true
        self.heard: Callable[[str], None] = lambda command: None
        self.printed: Callable[[str], str] = lambda text: text
        self._served = ExitStack()
        self.ports = [self._serve(self._source), self._serve(self._meter)]

    def close(self) -> None:
        self._served.close()

    def _serve(self, answer: Callable[[str, dict[str, str]], str | None]) -> int:
        class Lines(socketserver.StreamRequestHandler):
            status: ClassVar = {"*ESE": "0", "*SRE": "0", "*PSC": "1"}

            def handle(self) -> None:
                for line in self.rfile:
                    answers = (answer(unit.strip(), self.status) for unit in line.decode().strip().split(";"))
                    said = [one for one in answers if one is not None]
                    if said:
                        self.wfile.write((";".join(said) + "\r\n").encode())

        return self._served.enter_context(answering(Lines))

    def _common(self, command: str, status: dict[str, str], identity: str) -> str | None:
        name, _, value = command.partition(" ")
        if command == "*IDN?":
            return identity
        if name.removesuffix("?") in status:
            if name.endswith("?"):
                return status[name[:-1]]
            status[name] = value
            return None
        if command == "SYST:ERR?":
            return self.told.pop(0) if self.told else '+0,"No error"'
        self.told.append('-113,"Undefined header"')
        return None

    def _source(self, command: str, status: dict[str, str]) -> str | None:
        self.heard(command)
        name, _, value = command.partition(" ")
        if name == "SOUR:TEMP":
            self.set_to = float(value)
        elif name == "OUTP":
            self.on = int(value)
        elif command in ("SOUR:TEMP?", "MEAS:TEMP?"):
            return f"{self.set_to:+.8E}"
        elif command == "OUTP?":
            return str(self.on)
        elif command == "STAT:TRIP?":
            return str(self.tripped)
        else:
            return self._common(command, status, "STRANGER,TC 1,7,1.0")
        return None

    def _meter(self, command: str, status: dict[str, str]) -> str | None:
        name, _, value = command.partition(" ")
        if name == "UNIT:TEMP":
            self.unit = value
        elif command == "UNIT:TEMP?":
            return self.unit
        elif command == "ROUT:TERM?":
            return self.terminals
        elif command == "READ?":
            return self._reading()
        else:
            return self._common(command, status, "STRANGER,DAQ 34,9,1.0")
        return None

    def _reading(self) -> str:
        self.taken += 1
        self.at_panel(self.taken, self)
        value = self.values(self.set_to) * (5.0 / 3.0 if self.terminals == "REAR" else 1.0)
        value += 1e-3 * ((self.taken * 7919) % 13 - 6)  # noise
        text = self.printed(f"{value * 1.8 + 32.0 if self.unit == 'F' else value:+.8E}")
        return f"{text} {self.unit}" if self.with_unit else text


BENCH = """name = "a stranger's bench"
[instruments.bath]
driver = "scpi-source"
address = "socket://127.0.0.1:{ports[0]}"
model = "TC 1"
unit = "degC"
low = 0
high = 400
set = "SOUR:TEMP {{value}}"
decimals = 3
readback = 0.001
setpoint = "SOUR:TEMP?"
read = "MEAS:TEMP?"
on = "OUTP 1"
off = "OUTP 0"
output = "OUTP?"
tolerance = 0.1
dwell_s = 0
{source}
[instruments.daq]
driver = "scpi-meter"
address = "socket://127.0.0.1:{ports[1]}"
model = "DAQ 34"
unit = "degC"
fetch = "READ?"
reading_s = 0
{meter}
[sensors.probe]
reader = "daq"
unit = "degC"
[factors]
x_degC = "bath"
[limits]
x_degC = [0, 400]
"""
PROCEDURE = """kind = "general"
name = "changed at a panel"
seed = 1
replications = {replications}
[factors.x_degC]
levels = {levels}
order = "as written"
[settle]
dwell_s = 0
poll_s = 0.05
[measure]
readings = {readings}
[faults]
pause_s = 0
bad_reply = ["retry 1", "abort"]
[model]
formula = "1 + x_degC"
"""
