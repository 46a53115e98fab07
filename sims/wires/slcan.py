"""A serial CAN adapter after LAWICEL's ASCII protocol (slcan), bytes in and bytes out.

`S`n sets the bit rate, `O` opens, `L` opens to listen, `C` closes, `t`iiildd.. carries a frame with an 11-bit
identifier, `T` one with 29 bits, `r` and `R` remote frames; `V` and `N` report version and serial number. Every command
ends with a carriage return and is confirmed by one, or refused with a bell.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

from rig.contracts.declared.frames import EXTENDED, REMOTE
from rig.sims.wires.can_line import Connected, OnFrame

_DONE, _REFUSED = b"\r", b"\a"
_LONGEST = 64


class SlcanAdapter:
    """One adapter with a simulated instrument on its bus.

    Args:
        on_frame: the instrument's function.
        connected: functions of instruments that send by themselves.
    """

    def __init__(self, on_frame: OnFrame, connected: Sequence[Connected] = ()) -> None:
        self._on_frame, self._connected = on_frame, connected
        self._line = bytearray()
        self._open = False
        self._listening_only = False

    def on_rx(self, data: bytes, tx: Callable[[bytes], None]) -> None:
        """Take characters from the computer; frames from the bus go to `tx` while the channel is open."""
        for byte in data:
            if byte != ord("\r"):
                self._line.append(byte)
                del self._line[_LONGEST:]
                continue
            line, self._line = bytes(self._line), bytearray()
            if line:
                tx(self._command(line, tx))

    def _command(self, line: bytes, tx: Callable[[bytes], None]) -> bytes:
        letter = line[:1]
        if letter in (b"t", b"T", b"r", b"R"):
            return self._frame(line, tx)
        if letter in (b"O", b"L") and not self._open:
            self._open, self._listening_only = True, letter == b"L"
            for told in self._connected:
                told(lambda can_id, data: self._from_bus(can_id, data, tx), inf)
            return _DONE
        if letter == b"C":
            self._open = False
            return _DONE
        if letter in (b"S", b"s") and not self._open:
            return _DONE
        return {b"V": b"V1013\r", b"N": b"NSIM1\r"}.get(line, _REFUSED)

    def _frame(self, line: bytes, tx: Callable[[bytes], None]) -> bytes:
        if not self._open or self._listening_only:
            return _REFUSED
        extended, remote = line[:1] in (b"T", b"R"), line[:1] in (b"r", b"R")
        digits = 8 if extended else 3
        try:
            can_id, length = int(line[1 : 1 + digits], 16), int(line[1 + digits : 2 + digits])
            data = bytes.fromhex(line[2 + digits :].decode("ascii"))
        except ValueError:
            return _REFUSED
        if length > 8 or len(data) != (0 if remote else length) or can_id > (0x1FFFFFFF if extended else 0x7FF):
            return _REFUSED
        can_id |= (EXTENDED if extended else 0) | (REMOTE if remote else 0)
        self._on_frame(can_id, bytes(length) if remote else data, lambda can_id, data: self._from_bus(can_id, data, tx))
        return b"Z\r" if extended else b"z\r"

    def _from_bus(self, can_id: int, data: bytes, tx: Callable[[bytes], None]) -> None:
        if self._open:
            head = f"T{can_id & ~EXTENDED:08X}" if can_id & EXTENDED else f"t{can_id:03X}"
            tx(f"{head}{len(data)}{data.hex().upper()}\r".encode("ascii"))
