"""Server of the page: with its own socket, one process, and no writes."""

from __future__ import annotations

import contextlib
import ipaddress
import platform
import secrets
import socket
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import anyio
import uvicorn
from starlette.types import ASGIApp

from rig.errors import UsageError
from rig.runs.previous import read_previous
from rig.watch.access import Access
from rig.watch.app import make_app
from rig.watch.connections import BoundedProtocol
from rig.watch.shelf import Shelf


def serve(
    where: Path,
    *,
    host: str,
    port: int,
    token: str | None,
    against: Path | None,
    stopwatch: Callable[[], float],
    utc: Callable[[], float],
    announce: Callable[[str], None],
) -> None:
    """Serve the page of a run, or of a folder of runs, until interrupted.

    Args:
        where: the run file or folder.
        host: address to listen on.
        port: 0 for any that is free.
        token: token that a visitor must give; if None, one is generated if `host` can be reached from other machines.
        against: a previous calibration, or an earlier run, to compare observations with.
        stopwatch: real seconds.
        utc: real seconds since 1970-01-01.
        announce: called once with the address to open.

    Raises:
        UsageError: there is no such file or folder, or the port is taken.
    """
    if not where.exists():
        raise UsageError(f"there is no run file or folder {where}")
    reference = None if against is None else read_previous(against)
    shelf = Shelf(where, reference, stopwatch, utc)
    if shelf.only is not None:
        feed = shelf.feed(shelf.only)
        assert feed is not None
        feed.check()
    if token is None and not only_this_machine(host):
        token = secrets.token_urlsafe(18)
    access = Access(token or "", Access().names | {host.lower()})
    listening = _listen(host, port)
    with contextlib.closing(listening):
        anywhere = host in ("0.0.0.0", "::")
        shown = platform.node() if anywhere else f"[{host}]" if ":" in host else host
        query = f"/?token={quote(token)}" if token else "/"
        announce(f"http://{shown}:{listening.getsockname()[1]}{query}")
        with contextlib.suppress(KeyboardInterrupt):
            uvicorn.Server(configuration(make_app(shelf, access, anyio.sleep))).run(sockets=[listening])


def configuration(app: ASGIApp) -> uvicorn.Config:
    """Settings of the server: bounded, without a log of requests."""
    return uvicorn.Config(
        app,
        log_level="critical",  # its messages at the end are of no use
        access_log=False,  # the first address may contain a token
        lifespan="off",
        ws="none",
        http=BoundedProtocol,
        server_header=False,
        proxy_headers=False,
        limit_concurrency=200,
        timeout_keep_alive=20,
        timeout_graceful_shutdown=1,
    )


def only_this_machine(host: str) -> bool:
    """Whether an address can be reached only from this machine."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _listen(host: str, port: int) -> socket.socket:
    try:
        return socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise UsageError(f"cannot listen on {host} port {port}: {why}; choose another with --port") from error
