"""Channels of notifications: mail, webhook, a program of the user, apprise. Each send may block and may fail."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import logging
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

from rig.errors import ConfigurationError
from rig.unattended.notify.delivery import Line, NotSent, deliver, veiled
from rig.unattended.notify.mail import mail_sender
from rig.unattended.notify.message import Message
from rig.unattended.notify.notify_file import Apprise, Command, Mail, NotifySettings, Webhook, secret
from rig.unattended.notify.template import filled
from rig.unattended.notify.webhook import webhook_sender

Send = Callable[[Message], None]


def sender(channel: Mail | Webhook | Command | Apprise) -> Send:
    """A function that sends a message over a channel, or raises `NotSent`. Raises `ConfigurationError` for a missing
    secret.
    """
    match channel:
        case Mail():
            return mail_sender(channel)
        case Webhook():
            return webhook_sender(channel)
        case Command():
            return _command(channel)
        case Apprise():
            return _apprise(channel)


def senders(settings: NotifySettings, where: str) -> tuple[dict[str, Send], list[str]]:
    """Functions that send, by label of the channel; and for each invalid channel a sentence with channel, file and
    defect.
    """
    found, wrong = {}, []
    for channel in settings.channel:
        try:
            found[channel.label] = sender(channel)
        except ConfigurationError as error:
            wrong.append(f"{where}: channel {channel.label}: {error}")
    return found, wrong


# --- command ----------------------------------------------------------------------------------------------------------

_MOST_BYTES = 1 << 16
"""Maximum length of a program's error output that is read; much more than is repeated."""
_NOT_FOR_CHILDREN = ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID")


def _command(channel: Command) -> Send:
    program = channel.argv[0]
    if shutil.which(program) is None:
        raise ConfigurationError(_no_program(program))

    def send(message: Message) -> None:
        words = message.placeholders()
        argv = [program, *(str(filled(part, words)).replace("\0", "") for part in channel.argv[1:])]
        told = {f"RIG_{name.upper()}": text.replace("\0", "") for name, text in words.items()}
        env = {k: v for k, v in os.environ.items() if k not in _NOT_FOR_CHILDREN} | told
        with tempfile.TemporaryFile() as complaints:  # a file, so that we never wait for a grandchild that holds a pipe
            try:
                process = subprocess.Popen(
                    argv,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=complaints,
                    env=env,
                    start_new_session=True,  # Ctrl-C at the controller's terminal must not end it
                )
            except (OSError, ValueError) as error:
                raise NotSent(f"{argv[0]}: {error}", permanent=True) from None
            try:
                process.communicate(message.text.encode(), timeout=channel.timeout_s)
            except subprocess.TimeoutExpired:
                _end(process)
                raise NotSent(f"{argv[0]} took longer than {channel.timeout_s:g} s", permanent=True) from None
            if process.returncode:
                complaints.seek(0)
                # Secrets are masked before the text is cut: a part of an address would not be recognised.
                whole = complaints.read(_MOST_BYTES).decode("utf-8", "replace")
                said = veiled(whole, [a for a in channel.argv if "://" in a])
                raise NotSent(f"{argv[0]} ended with {process.returncode} {said}")

    return send


def _no_program(program: str) -> str:
    """Why a program cannot be started, and what to do."""
    if os.sep not in program:
        return f"there is no program {program} in PATH: install it, or give its whole path"
    path = Path(program)
    if not path.is_file():
        whole = "" if path.is_absolute() else " (give its whole path: a service starts in another folder)"
        return f"there is no program {program}{whole}: correct argv, or install it"
    return f"{program} may not be executed: chmod +x {program}"


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a user's program that takes too long, and the processes it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    if process.stdin:
        with contextlib.suppress(OSError):
            process.stdin.close()
    process.wait()


# --- apprise ----------------------------------------------------------------------------------------------------------


def _apprise(channel: Apprise) -> Send:
    if importlib.util.find_spec("apprise") is None:
        raise ConfigurationError('apprise is not installed: pip install "calibration-rig[notify]"')
    addresses = secret(channel, "url").split()

    def send(message: Message) -> None:
        def tell(_: Line) -> None:
            library = importlib.import_module("apprise")  # its import is slow, so it is done in the channel's own
            # thread
            logging.getLogger("apprise").disabled = True  # its log lines repeat addresses
            told = library.Apprise()
            if not all(told.add(address) for address in addresses):
                raise NotSent("apprise does not know one of the addresses", permanent=True)
            if not told.notify(title=message.headline, body=message.text):
                raise NotSent("apprise could not deliver it to every address")

        deliver(channel.timeout_s, tell, "apprise", again_if_late=False)  # it cannot be ended, and may still deliver

    return send
