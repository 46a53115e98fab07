"""`sim://KEY/INSTRUMENT`: a pyserial port whose other end is a twin in this process, under virtual time.

Reading pumps the world until bytes come or the timeout has passed in virtual time; no real time is spent. A port with
another baud rate or frame than the twin's receives and sends nothing, as on a real line.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from serial import PortNotOpenError, SerialBase, SerialException

from rig.sims.wires.serial_line import SerialCable, find
from rig.sims.wires.tampering import UNTOUCHED, Tampering

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_GONE = "device reports readiness to read but returned no data (device disconnected or multiple access on port?)"


class Serial(SerialBase):
    """A port on a simulated cable; see pyserial's `SerialBase` for its methods."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._cable: SerialCable | None = None
        self._wire: Tampering = UNTOUCHED
        self._received = bytearray()
        self._understood = True
        self._connection = 0
        super().__init__(*args, **kwargs)

    def open(self) -> None:
        """Connect to the cable named by the URL. Raises `SerialException` if there is none or it is taken."""
        place = str(self.port).partition("://")[2]
        cable = find(place)
        if cable is None:
            raise SerialException(f"there is no simulated instrument at {self.port}")
        wire = cable.tampering
        if wire.unplugged:
            raise SerialException(f"could not open port {self.port}: [Errno 2] No such file or directory")
        if cable.attached and self._connection == wire.connection:
            raise SerialException(f"{self.port} is already open")
        self._cable, self._wire = cable, wire
        self._connection = wire.connection
        self._received.clear()
        self._reconfigure_port()
        cable.attach(self._hear)
        cable.host_dtr(self.dtr)
        self.is_open = True

    def close(self) -> None:
        """Disconnect, unless another one has connected since: one that is collected later must not cut that off."""
        if self.is_open and self._alive() and self._plugged().hears(self._hear):
            self._plugged().attach(None)
            self._plugged().host_dtr(None)
        self._cable = None
        self.is_open = False

    def _hear(self, data: bytes) -> None:
        if self._understood:
            self._received += data

    def _reconfigure_port(self, force_update: bool = False) -> None:
        if self._cable is not None:
            frame = f"{self.bytesize}{self.parity}{self.stopbits:g}"
            self._understood = self._cable.setting in (None, (self.baudrate, frame))

    def _plugged(self) -> SerialCable:
        if self._cable is None:
            raise PortNotOpenError()
        return self._cable

    def _alive(self) -> bool:
        return self._cable is not None and self._wire.connection == self._connection

    def _check(self, words: str) -> SerialCable:
        """The cable; raises pyserial's Linux error of a removed USB adapter."""
        cable = self._cable
        if cable is None:
            raise PortNotOpenError()
        if self._wire.connection != self._connection:
            raise SerialException(words)
        return cable

    @property
    def in_waiting(self) -> int:
        """Number of received, unread bytes."""
        if self._cable is None or self._wire.connection != self._connection:
            self._check("[Errno 5] Input/output error")
        return len(self._received)

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes; fewer if the timeout passes first (virtual time)."""
        cable, wire, here, received = self._cable, self._wire, self._connection, self._received
        if cable is None or wire.connection != here:
            cable = self._check(_GONE)
        if len(received) < size:
            world, timeout = cable.world, self.timeout
            end = None if timeout is None else world.now() + timeout
            world.run_until(end, lambda: len(received) >= size or wire.connection != here)
            if wire.connection != here or self._cable is None:
                self._check(_GONE)
        data = bytes(received[:size])
        del received[:size]
        return data

    def write(self, data: ReadableBuffer, /) -> int:
        """Hand bytes to the line; they travel at its baud rate."""
        cable = self._cable
        if cable is None or self._wire.connection != self._connection:
            cable = self._check("write failed: [Errno 5] Input/output error")
        sent = bytes(data)
        if self._understood:
            cable.send(sent)
        return len(sent)

    def flush(self) -> None:
        """All bytes are already on their way."""

    def reset_input_buffer(self) -> None:
        """Discard received bytes."""
        self._received.clear()

    def reset_output_buffer(self) -> None:
        """There is no output buffer."""

    def _update_rts_state(self) -> None:
        pass  # not used

    def _update_dtr_state(self) -> None:
        self._check("[Errno 5] Input/output error").host_dtr(self.dtr)

    def _update_break_state(self) -> None:
        pass

    @property
    def cts(self) -> bool:
        """Always ready."""
        return True

    @property
    def dsr(self) -> bool:
        """Always ready."""
        return True

    @property
    def ri(self) -> bool:
        """There is no ring signal."""
        return False

    @property
    def cd(self) -> bool:
        """The cable is connected."""
        return True
