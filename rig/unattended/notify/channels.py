"""How a message gets to people: mail, webhook, a program of the user's, apprise. Each send may block and may fail."""

from __future__ import annotations

import contextlib
import http.client
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
from rig.unattended.notify.settings import Apprise, Command, Mail, NotifySettings, Webhook, secret
from rig.unattended.notify.template import filled
from rig.unattended.notify.webhook import webhook_sender

Send = Callable[[Message], None]


def sender(channel: Mail | Webhook | Command | Apprise) -> Send:
    """What sends a message over a channel, or raises `NotSent`. Raises `ConfigurationError` for a missing secret."""
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
    """What sends over each channel, by label; and what is wrong with each of the others, naming channel and file."""
    found, wrong = {}, []
    for channel in settings.channel:
        try:
            found[channel.label] = sender(channel)
        except ConfigurationError as error:
            wrong.append(f"{where}: channel {channel.label}: {error}")
    return found, wrong


# --- mail -------------------------------------------------------------------------------------------------------------

_PORTS = {"starttls": 587, "ssl": 465, "none": 25}


def _mail(channel: Mail) -> Send:
    password = secret(channel.password_env, channel.password_file)
    port = channel.port or _PORTS[channel.security]

    def connect() -> smtplib.SMTP:
        if channel.security == "ssl":
            context = ssl.create_default_context()
            return smtplib.SMTP_SSL(channel.host, port, timeout=channel.timeout_s, context=context)
        return smtplib.SMTP(channel.host, port, timeout=channel.timeout_s)

    def send(message: Message) -> None:
        try:
            with connect() as server:
                if channel.security == "starttls":
                    server.starttls(context=ssl.create_default_context())
                if channel.user:
                    server.login(channel.user, password)
                refused = server.send_message(as_mail(message, channel), channel.sender, list(channel.to))
        except smtplib.SMTPResponseException as error:
            answer = error.smtp_error
            words = answer.decode("utf-8", "replace") if isinstance(answer, bytes) else str(answer)
            raise NotSent(f"{channel.host} answers {error.smtp_code} {words}", permanent=_5xx(error)) from error
        except smtplib.SMTPRecipientsRefused as error:
            raise NotSent(f"{channel.host} takes no mail for these addresses", permanent=True) from error
        except (OSError, smtplib.SMTPException) as error:
            raise NotSent(f"{channel.host} port {port}: {error or type(error).__name__}") from error
        if refused:
            raise NotSent(f"{channel.host} takes no mail for {len(refused)} of the addresses", permanent=True)

    return send


def _5xx(error: smtplib.SMTPResponseException) -> bool:
    return 500 <= error.smtp_code < 600


def as_mail(message: Message, channel: Mail) -> MIMEText:
    """The message as e-mail, with headers that keep automatic replies away.

    Of `email`'s two families this is the one that takes headers as they are given: the other decodes what looks like
    an encoded word, and a bench's name could become a header, or a body, of its own.
    """
    text = message.text.encode("utf-8", "replace").decode("utf-8")
    readable = text.isascii() and max(map(len, text.splitlines())) < _LINE
    mail = MIMEText(text, "plain", "us-ascii" if readable else "utf-8")
    mail["Subject"] = _plain_header(message.headline)
    mail["From"] = channel.sender
    mail["To"] = ", ".join(channel.to)
    mail["Date"] = formatdate()
    mail["Message-ID"] = make_msgid(domain=channel.sender.rpartition("@")[2])
    mail["Auto-Submitted"] = "auto-generated"
    if message.urgent:
        mail["X-Priority"] = "1"
    return mail


_LINE = 990
"""Characters in a line of a mail that is sent as it is."""
_WORD = 42
"""Bytes of text in an encoded word, which may be 75 characters long."""


def _plain_header(text: str) -> str:
    """A header's text in ASCII: as it is where it is that and no encoded word, else in encoded words (RFC 2047)."""
    text = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    if text.isascii() and "=?" not in text:
        return text
    words, word = [], b""
    for character in text:
        data = character.encode("utf-8", "replace")
        if len(word) + len(data) > _WORD:
            words.append(word)
            word = b""
        word += data
    return " ".join(f"=?utf-8?b?{base64.b64encode(part).decode()}?=" for part in (*words, word))


# --- webhook ----------------------------------------------------------------------------------------------------------


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """urllib follows a redirected POST with a GET, which would look like success and tell nobody."""

    def redirect_request(self, *_: Any, **__: Any) -> None:
        return None


def _webhook(channel: Webhook) -> Send:
    url = web_address(channel.url or secret(channel.url_env, channel.url_file))
    token = secret(channel.token_env, channel.token_file)
    opener = urllib.request.build_opener(_NoRedirect)
    where = urlsplit(url).hostname  # never the whole address: what follows the host is often the secret

    def send(message: Message) -> None:
        target, content = payload(message, channel, url)
        headers = {"Content-Type": "application/json", "User-Agent": "calibration-rig"}
        if token:
            headers["Authorization"] = f"Bearer {token}"
        data = json.dumps(content).encode()
        request = urllib.request.Request(target, data=data, headers=headers, method="POST")
        try:
            with opener.open(request, timeout=channel.timeout_s) as answer:
                answer.read(1000)
        except urllib.error.HTTPError as error:
            with error:
                again = error.code in (408, 425, 429) or error.code >= 500
                raise NotSent(f"{where} answers HTTP {error.code} {error.reason}", permanent=not again) from None
        except urllib.error.URLError as error:
            raise NotSent(f"{where}: {error.reason}") from None
        except http.client.HTTPException as error:
            raise NotSent(f"{where} does not answer as a web server: {str(error) or type(error).__name__}") from None
        except (OSError, ValueError) as error:
            raise NotSent(f"{where}: {error or type(error).__name__}") from None

    return send


def payload(message: Message, channel: Webhook, url: str) -> tuple[str, object]:
    """Where to post, and what: the shape that the receiver expects."""
    if channel.body is not None:
        return url, filled(channel.body, message.placeholders())
    match channel.shape:
        case "ntfy":
            root, _, topic = url.rstrip("/").rpartition("/")
            content = {"topic": topic, "title": message.headline, "message": message.text}
            return root + "/", {**content, "priority": 5 if message.urgent else 3, "tags": [message.kind.value]}
        case "slack":
            return url, {"text": f"*{_slack(message.headline)}*\n```{_slack(message.text)}```"}
        case "teams":
            head = {"type": "TextBlock", "text": message.headline, "weight": "Bolder", "wrap": True}
            body = {"type": "TextBlock", "text": message.text, "wrap": True, "fontType": "Monospace"}
            card = {"type": "AdaptiveCard", "version": "1.4", "body": [head, body]}
            kind = "application/vnd.microsoft.card.adaptive"
            return url, {"type": "message", "attachments": [{"contentType": kind, "content": card}]}
        case "json":
            return url, {**message.placeholders(), "urgent": message.urgent, "also": message.also}


def _slack(text: str) -> str:
    for character, entity in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("```", "'''")):
        text = text.replace(character, entity)
    return text


# --- command ----------------------------------------------------------------------------------------------------------

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
        with tempfile.TemporaryFile() as complaints:  # a file, so that a grandchild cannot keep us waiting on a pipe
            try:
                process = subprocess.Popen(
                    argv,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=complaints,
                    env=env,
                    start_new_session=True,  # Ctrl-C at the controller's terminal is not for it
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
                said = veiled(complaints.read(300).decode("utf-8", "replace"), [a for a in channel.argv if "://" in a])
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
    """End a program of the user's that takes too long, and what it started."""
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
            library = importlib.import_module("apprise")  # takes a while to import: in the channel's own thread
            logging.getLogger("apprise").disabled = True  # what it logs repeats addresses
            told = library.Apprise()
            if not all(told.add(address) for address in addresses):
                raise NotSent("apprise does not know one of the addresses", permanent=True)
            if not told.notify(title=message.headline, body=message.text):
                raise NotSent("apprise could not deliver it to every address")

        deliver(channel.timeout_s, tell, "apprise", again_if_late=False)  # it cannot be ended, and may yet deliver

    return send
