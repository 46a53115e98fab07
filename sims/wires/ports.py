"""Ports through which other processes reach simulated instruments: pseudo-terminals and local TCP sockets."""

from __future__ import annotations

import contextlib
import os
import pty
import selectors
import socket
import tty
from collections.abc import Callable
from typing import Protocol

Receive = Callable[[bytes, Callable[[bytes], None]], None]
"""Takes received bytes, and a function for answers."""

_CHUNK = 4096


class Port(Protocol):
    """An open port.

    Attributes:
        address: its address without a scheme: a device, or host and port.
    """

    address: str

    def close(self) -> None:
        """Close it."""
        ...


class PseudoTerminal:
    """A serial port of this machine. Unread bytes are dropped when the system's buffer is full, as on a wire.

    Args:
        selector: calls back when bytes have come.
        receive: the instrument.
    """

    def __init__(self, selector: selectors.BaseSelector, receive: Receive) -> None:
        self._selector = selector
        self._receive = receive
        # The slave end stays open here: otherwise a client that closes would hang up the line for the next one.
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.address = os.ttyname(self._slave)
        selector.register(self._master, selectors.EVENT_READ, self._readable)

    def send(self, data: bytes) -> None:
        """Bytes from the instrument."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)

    def _readable(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self._receive(os.read(self._master, _CHUNK), self.send)

    def close(self) -> None:
        """Hang up."""
        self._selector.unregister(self._master)
        os.close(self._master)
        os.close(self._slave)


class TcpPort:
    """A TCP port on the loopback interface; any number of clients, each with a separate end of the instrument.

    Args:
        selector: calls back when bytes have come.
        connect: gives the instrument's end of a new connection.
    """

    def __init__(self, selector: selectors.BaseSelector, connect: Callable[[], Receive]) -> None:
        self._selector = selector
        self._connect = connect
        self._clients: set[socket.socket] = set()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._listening.setblocking(False)
        self.address = f"127.0.0.1:{self._listening.getsockname()[1]}"
        selector.register(self._listening, selectors.EVENT_READ, self._accept)

    def _accept(self) -> None:
        client, _ = self._listening.accept()
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._clients.add(client)
        receive = self._connect()
        self._selector.register(client, selectors.EVENT_READ, lambda: self._readable(client, receive))

    def _readable(self, client: socket.socket, receive: Receive) -> None:
        try:
            data = client.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            receive(data, lambda answer: self._send(client, answer))
        else:
            self._drop(client)

    def _send(self, client: socket.socket, data: bytes) -> None:
        if client in self._clients:
            try:
                client.sendall(data)
            except OSError:
                self._drop(client)

    def _drop(self, client: socket.socket) -> None:
        self._selector.unregister(client)
        self._clients.discard(client)
        client.close()

    def close(self) -> None:
        """Stop listening and hang up."""
        for client in list(self._clients):
            self._drop(client)
        self._selector.unregister(self._listening)
        self._listening.close()
