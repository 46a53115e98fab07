"""Serving a laboratory: the socket, TLS, and the worker of the queue beside it."""

from __future__ import annotations

import contextlib
import platform
import signal
import ssl
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import anyio
import uvicorn

from rig.acts import Places
from rig.drivers.clock import RealClock
from rig.engine.session import Signals
from rig.errors import BusyError, RigError, UsageError
from rig.lab import Laboratory
from rig.queue import QueueFile, work
from rig.serve.app import make_app
from rig.watch.server import bound_handshakes, configuration, listen, only_this_machine
from rig.who import operator


def serve(
    laboratory: Laboratory,
    *,
    host: str,
    port: int,
    names: frozenset[str],
    certificate: Path | None,
    key: Path | None,
    works: bool,
    announce: Callable[[str], None],
    said: Callable[[str], None],
) -> None:
    """Serve a laboratory until interrupted. Runs that it started go on after its end.

    Args:
        laboratory: the laboratory.
        host: address to listen on; other than this machine's own only with `certificate` and `key`.
        port: 0 for any that is free.
        names: further host names by which browsers reach it.
        certificate: its TLS certificate, PEM, with the chain.
        key: private key of the certificate, PEM.
        works: whether it carries out the queue.
        announce: called once with the address to open.
        said: called with sentences about the queue.

    Raises:
        UsageError: it may not be reached from elsewhere in this way, or the port is taken.
        ConfigurationError: `people.toml` cannot be used.
    """
    encrypted = certificate is not None and key is not None
    if (certificate is None) != (key is None):
        raise UsageError("TLS needs both: --certificate CHAIN.pem and --key KEY.pem")
    if not only_this_machine(host) and not encrypted:
        raise UsageError(
            f"--host {host} can be reached from other machines, and passwords would cross the network unencrypted: "
            f"give --certificate and --key, or use an SSH tunnel (ssh -L 8322:127.0.0.1:8322 MACHINE)"
        )
    laboratory.people()
    laboratory.note_changes(operator())
    clock = RealClock()
    all_names = names | {host.lower()}
    app = make_app(
        laboratory, stopwatch=clock.stopwatch, utc=clock.utc, pause=anyio.sleep, names=all_names, encrypted=encrypted
    )
    how = configuration(app)
    if encrypted:
        how.ssl_certfile, how.ssl_keyfile = str(certificate), str(key)
    try:
        how.load()
    except (OSError, ssl.SSLError) as error:
        raise UsageError(f"{certificate} and {key} are no certificate and its key: {error}") from error
    if how.ssl is not None:
        bound_handshakes()
        how.ssl.minimum_version = ssl.TLSVersion.TLSv1_2
    listening = listen(host, port)
    with contextlib.closing(listening), _queue(laboratory, works, said):
        shown = platform.node() if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
        signal.signal(signal.SIGTERM, _end)  # uvicorn passes a signal on when it has ended
        announce(f"http{'s' if encrypted else ''}://{shown}:{listening.getsockname()[1]}/")
        with contextlib.suppress(KeyboardInterrupt):
            uvicorn.Server(how).run(sockets=[listening])


def _end(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


@contextlib.contextmanager
def _queue(laboratory: Laboratory, works: bool, said: Callable[[str], None]) -> Iterator[None]:
    """Carry out the queue in a thread; processes that are at work when it ends go on."""
    ended = threading.Event()

    def carry_out() -> None:
        file = QueueFile(Places(laboratory).queue_file)
        try:
            work(file, RealClock(), has=frozenset(), signals=Signals(), said=said, stay=True, leave=ended.is_set)
        except BusyError as error:
            said(f"{error}; this server only adds to it")
        except RigError as error:
            said(f"the queue is not carried out: {error}")

    thread = threading.Thread(target=carry_out, name="queue", daemon=True)
    if works:
        thread.start()
    try:
        yield
    finally:
        ended.set()
        if works:
            thread.join(5.0)
