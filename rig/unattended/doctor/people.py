"""Notifications: notify.toml, its secrets, and a test message if requested."""

from __future__ import annotations

import stat
from collections.abc import Iterator, Mapping
from pathlib import Path

from rig.errors import ConfigurationError
from rig.unattended.doctor.findings import Finding, ok, problem, warning
from rig.unattended.happenings import Happening, Kind, RunFacts
from rig.unattended.notify import NotSent, Send, compose, read_settings, secret_files, senders
from rig.unattended.place_of_notify import find_settings


def check_people(explicit: Path | None, facts: RunFacts, now_s: float, *, send: bool) -> Iterator[Finding]:
    """Findings about notifications.

    Args:
        explicit: the file to use, None for the default one.
        facts: facts about the bench for a test message.
        now_s: UTC, seconds since 1970-01-01.
        send: send a test message over every channel.

    """
    path = find_settings(explicit)
    if path is None:
        yield warning("notifications", "nobody is notified", "write a notify.toml (docs/how_to/unattended.md)")
        return
    try:
        settings = read_settings(path)
    except ConfigurationError as error:
        yield problem("notifications", str(error), "correct it; a resumed run would notify nobody")
        return
    sends, wrong = senders(settings, str(path))
    for text in wrong:
        yield problem("notifications", text, "correct it; a resumed run would notify nobody on this channel")
    for file in secret_files(settings):
        if file.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            yield warning("notifications: secrets", f"{file} may be read by others", f"chmod 600 {file}")
    if not settings.channel:
        yield warning("notifications", f"{path} has no [[channel]]", "add one (docs/how_to/unattended.md)")
    elif sends and not send:
        yield ok("notifications", f"{path}: {', '.join(sends)}; not tried (--notify sends a test message)")
    else:
        yield from _try(sends, facts, now_s)


def _try(sends: Mapping[str, Send], facts: RunFacts, now_s: float) -> Iterator[Finding]:
    test = Happening(Kind.TEST, "info", "a test by rig doctor that messages arrive; nothing has happened", now_s)
    for label, send in sends.items():
        check = f"notifications: {label}"
        try:
            send(compose(test, facts, None))
        except NotSent as error:
            yield problem(check, str(error), "correct notify.toml, or check the network; then try again")
        else:
            yield ok(check, "a test message was sent; check that it arrived")
