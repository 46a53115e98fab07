"""One delivery over a network: with one deadline for all of it, and errors in our own words.

A library's timeout counts for one read: a server that sends one byte per second never reaches it. A library's message
may repeat an address or a token.
"""

from __future__ import annotations

import contextlib
import http.client
import os
import smtplib
import socket
import ssl
import threading
import urllib.error
from collections.abc import Callable, Iterable

from rig.drivers.clock import RealClock
from rig.unattended.happenings import one_line

_LONGEST = 300
_MARGIN_S = 5.0


class NotSent(Exception):
    """A message could not be sent.

    Attributes:
        permanent: whether another attempt would not help.

    """

    def __init__(self, text: str, *, permanent: bool = False) -> None:
        super().__init__(one_line(text)[:_LONGEST])
        self.permanent = permanent


class Line:
    """The connections of one delivery; they are cut when its time is over.

    Args:
        seconds: time for everything: looking up names, connecting, encryption, sending, the answer.

    """

    def __init__(self, seconds: float) -> None:
        self._clock = RealClock()
        self._end = self._clock.now() + seconds
        self._lock = threading.Lock()
        self._handles: list[socket.socket] = []
        self._over = self._taken = False

    def left(self) -> float:
        """Seconds left. Raises TimeoutError if there are none."""
        left = self._end - self._clock.now()
        if left <= 0 or self._over:
            raise TimeoutError("the time for this delivery is over")
        return left

    def connect(self, host: str, port: int) -> socket.socket:
        """A connection to the first of the host's addresses that accepts it, in the remaining time. Raises OSError."""
        trouble: OSError = OSError("there is no address")
        for family, kind, protocol, _, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
            one = socket.socket(family, kind, protocol)
            try:
                one.settimeout(self.left())
                one.connect(address)
                one.settimeout(self.left() + _MARGIN_S)  # for one read; `cut` ends the whole delivery
                self._keep(one.dup())  # encryption takes over the first handle, and a handle is needed to cut it
            except OSError as error:
                one.close()
                trouble = error
            else:
                return one
        raise trouble

    def _keep(self, handle: socket.socket) -> None:
        with self._lock:
            if self._over:
                handle.close()
                raise TimeoutError("the time for this delivery is over")
            self._handles.append(handle)

    def take(self) -> None:
        """Note that the receiver has the message, even if the connection fails later; no effect after `cut`."""
        with self._lock:
            self._taken = not self._over

    def cut(self) -> bool:
        """End every connection. Threads that wait for one continue at once, and no new one is made.

        Returns:
            whether the receiver has the message.

        """
        with self._lock:
            self._over = True
            for handle in self._handles:
                with contextlib.suppress(OSError):
                    handle.shutdown(socket.SHUT_RDWR)
            return self._taken

    def close(self) -> None:
        """Close the handles."""
        with self._lock:
            self._over = True
            while self._handles:
                self._handles.pop().close()


def deliver(seconds: float, do: Callable[[Line], None], who: str, *, again_if_late: bool = True) -> None:
    """Deliver in a thread, and wait for it for a limited time, because a look-up of a name cannot be interrupted.

    Args:
        seconds: time for the whole delivery.
        do: delivers; its connections come from its `Line`.
        who: name of the receiver, for sentences.
        again_if_late: whether a late delivery may be repeated.

    Raises:
        NotSent: late, or what `do` raised, in one sentence without addresses.

    """
    line, done = Line(seconds), threading.Event()
    raised: list[Exception] = []

    def work() -> None:
        try:
            do(line)
        except Exception as error:  # raised below, in the waiting thread
            raised.append(error)
        finally:
            line.close()
            done.set()

    try:
        threading.Thread(target=work, name=f"deliver to {who}", daemon=True).start()
    except RuntimeError:
        raise NotSent(f"{who}: no thread could be started for it") from None
    in_time = done.wait(seconds)
    if line.cut() or (in_time and not raised):
        return
    error = raised[0] if in_time else TimeoutError()
    if isinstance(error, NotSent):
        raise error
    if isinstance(_cause(error), TimeoutError):
        raise NotSent(f"{who}: no complete answer within {seconds:g} s", permanent=not again_if_late) from None
    raise NotSent(f"{who}: {reason(error)}") from None


def _cause(error: object) -> object:
    return error.reason if isinstance(error, urllib.error.URLError) else error


def reason(error: object) -> str:
    """The error of a connection, in words. Texts of libraries or servers are not repeated."""
    match error:
        case urllib.error.URLError(reason=inner):
            return reason(inner)
        case ssl.SSLCertVerificationError():
            return "its certificate is not accepted (expired, for another host, or of an unknown authority)"
        case ssl.SSLError():
            return f"encryption fails: {(error.reason or 'no TLS').replace('_', ' ').lower()}"
        case socket.gaierror():
            return f"its name cannot be looked up: {error.strerror}"
        case smtplib.SMTPServerDisconnected() | http.client.RemoteDisconnected():
            return "it closed the connection without a complete answer"
        case smtplib.SMTPNotSupportedError():
            return str(error)  # fixed words of the library: the name of the missing extension
        case smtplib.SMTPException() | http.client.HTTPException():
            return f"its answer cannot be understood ({type(error).__name__})"
        case OSError(errno=int(number)):
            return os.strerror(number)
        case _:
            return f"the delivery failed ({type(error).__name__})"


def veiled(text: str, secrets: Iterable[str]) -> str:
    """Text of a server, with every secret replaced by `***`."""
    for secret in sorted(filter(None, secrets), key=len, reverse=True):
        text = text.replace(secret, "***")
    return text
