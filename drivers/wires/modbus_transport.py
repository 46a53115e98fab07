"""Transport of Modbus frames: TCP connections and serial lines."""

from __future__ import annotations

import socket
from typing import Protocol

import serial

from rig.drivers.clock import Clock
from rig.drivers.wires.addresses import ModbusAddress
from rig.drivers.wires.modbus_rtu import framed

_CONNECT_S = 3.0  # chosen
_MOST_CHARACTERS = 513  # of a frame of Modbus ASCII; MODBUS over Serial Line 1.02, 2.5.2.1


class Transport(Protocol):
    """Transport of bytes. Every method may raise `OSError` if the wire is lost."""

    def send(self, data: bytes) -> None:
        """Send all bytes."""
        ...

    def recv(self, seconds: float) -> bytes:
        """Received bytes, waiting at most this long for the first; empty if none came."""
        ...

    def close(self) -> None:
        """Release the wire; idempotent."""
        ...


def silence_s(baud: int) -> float:
    """Silence between two frames of a serial line, seconds. Source: MODBUS over Serial Line 1.02, 2.5.1.1."""
    return 0.00175 if baud > 19200 else 3.5 * 11 / baud  # fixed above 19200 baud


class TcpTransport:
    """A TCP connection. Raises `OSError` if it cannot be made."""

    def __init__(self, host: str, port: int, connect_s: float) -> None:
        self._socket = socket.create_connection((host, port), timeout=connect_s)
        # A request would wait for the acknowledgement of the one before it.
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, data: bytes) -> None:
        """Send all bytes."""
        self._socket.sendall(data)

    def recv(self, seconds: float) -> bytes:
        """Received bytes, waiting at most this long for the first; empty if none came."""
        self._socket.settimeout(seconds)
        # otherwise the sender may keep the rest until our next request acknowledges
        if hasattr(socket, "TCP_QUICKACK"):
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
        try:
            heard = self._socket.recv(4096)
        except TimeoutError:
            return b""
        if not heard:
            raise ConnectionError("the device closed the connection")
        return heard

    def ended(self) -> bool:
        """Whether the other side has closed the connection and everything it sent has been read. Waits for nothing."""
        before = self._socket.gettimeout()
        self._socket.settimeout(0.0)
        try:
            return not self._socket.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return False
        except OSError:
            return True
        finally:
            self._socket.settimeout(before)

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._socket.close()


class RtuTransport:
    """A serial line. Blocks for the first byte and returns the bytes that came with it: no polling, so no added
    latency.

    Frames are separated by silence, so a request waits until the line has been silent for 3.5 characters.
    """

    def __init__(self, address: ModbusAddress, clock: Clock) -> None:
        self._clock = clock
        frame = address.frame
        self._port = serial.serial_for_url(
            address.place,
            baudrate=address.baud,
            bytesize=int(frame[0]),
            parity=frame[1],
            stopbits=int(frame[2]),
            write_timeout=_CONNECT_S,
            exclusive=True,
        )
        self._silence = silence_s(address.baud)
        self._heard_at = clock.now() - self._silence

    def send(self, data: bytes) -> None:
        """Send all bytes."""
        self._clock.sleep(self._heard_at + self._silence - self._clock.now())
        self._port.write(data)

    def recv(self, seconds: float) -> bytes:
        """Received bytes, waiting at most this long for the first; empty if none came."""
        if self._port.timeout != seconds:  # setting it reprograms a real port
            self._port.timeout = seconds
        heard: bytes = self._port.read(1)
        if heard:
            heard += self._port.read(self._port.in_waiting)
            self._heard_at = self._clock.now()
        return heard

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._port.close()


class AsciiTransport:
    """Modbus ASCII on another transport: what is sent and received here are the same frames as RTU has them.

    A line with a wrong checksum, or without its end, is received as it is, and is no answer. Source: MODBUS over Serial
    Line 1.02, 2.5.2.

    Args:
        wire: transport of the characters.
    """

    def __init__(self, wire: Transport) -> None:
        self._wire = wire
        self._unread = b""

    def send(self, data: bytes) -> None:
        """Send a frame."""
        self._wire.send(as_ascii(data))

    def recv(self, seconds: float) -> bytes:
        """Whole frames, waiting at most this long for each piece of them; empty if nothing came."""
        while b"\n" not in self._unread and len(self._unread) < _MOST_CHARACTERS:
            more = self._wire.recv(seconds)
            if not more:
                torn, self._unread = self._unread, b""
                return torn
            self._unread += more
        *lines, self._unread = self._unread.split(b"\n")
        if not lines:
            lines, self._unread = [self._unread], b""
        return b"".join(map(_as_rtu, lines))

    def close(self) -> None:
        """Release the wire; idempotent."""
        self._wire.close()


def as_ascii(data: bytes) -> bytes:
    """A frame of RTU as Modbus ASCII has it; bytes that are no such frame as they are."""
    body = data[:-2]
    if len(data) < 4 or framed(body[0], body[1:]) != data:
        return data
    return b":%s\r\n" % (body + bytes((-sum(body) & 0xFF,))).hex().upper().encode()


def _as_rtu(line: bytes) -> bytes:
    """A frame of Modbus ASCII without its last character as one of RTU; the line itself if it is none."""
    try:
        body = bytes.fromhex(line.decode("ascii").removeprefix(":").removesuffix("\r"))
    except ValueError:
        return line
    whole = line[:1] == b":" and line[-1:] == b"\r" and len(body) >= 3 and not sum(body) & 0xFF
    return framed(body[0], body[1:-1]) if whole else line


def open_transport(address: ModbusAddress, clock: Clock) -> Transport:
    """Connect to a real device, or to a simulated one in another process; raises `OSError`."""
    wire: Transport
    if address.host is None:
        wire = RtuTransport(address, clock)
    else:
        wire = TcpTransport(address.host.host, address.host.port, clock.timeout(_CONNECT_S))
    return AsciiTransport(wire) if address.ascii else wire
