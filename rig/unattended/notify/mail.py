"""E-mail by SMTP, with headers encoded here."""

from __future__ import annotations

import base64
import contextlib
import smtplib
import socket
import ssl
from collections.abc import Callable
from email.mime.text import MIMEText
from email.utils import formatdate, make_msgid
from typing import IO

from rig.errors import ConfigurationError
from rig.unattended.notify.delivery import Line, NotSent, deliver, veiled
from rig.unattended.notify.message import Message
from rig.unattended.notify.notify_file import Mail, secret

_PORTS = {"starttls": 587, "ssl": 465, "none": 25}
_MOST_ANSWERED = 100_000
"""Maximum number of characters of a mail server's answers; a real server needs 2,000."""


def mail_sender(channel: Mail) -> Callable[[Message], None]:
    """A function that sends a message as e-mail, or raises `NotSent`. Raises `ConfigurationError` for an invalid
    secret.
    """
    password = secret(channel, "password")
    if not password.isascii():
        raise ConfigurationError("the password has characters that are not ASCII, which SMTP does not take: change it")
    port = channel.port or _PORTS[channel.security]
    veil = _spellings(channel.user, password)

    def post(message: Message, line: Line) -> None:
        server = _Server(line, channel.host, port, encrypted=channel.security == "ssl")
        try:
            if channel.security == "starttls":
                server.starttls(context=ssl.create_default_context())
            if channel.user:
                server.login(channel.user, password)
            refused = server.send_message(as_mail(message, channel), channel.sender, list(channel.to))
            if refused:
                raise NotSent(f"{channel.host} takes no mail for {len(refused)} of the addresses", permanent=True)
            line.take()
            with contextlib.suppress(OSError, smtplib.SMTPException, _TooMuch):
                server.quit()
        finally:
            server.close()

    def send(message: Message) -> None:
        def told(line: Line) -> None:
            try:
                post(message, line)
            except smtplib.SMTPResponseException as error:
                if error.smtp_code < 100:
                    raise NotSent(f"{channel.host} port {port} does not speak SMTP") from None
                answer = error.smtp_error
                words = answer.decode("utf-8", "replace") if isinstance(answer, bytes) else str(answer)
                said = f"{channel.host} answers {error.smtp_code} {veiled(words, veil)}"
                raise NotSent(said, permanent=_5xx(error)) from None
            except smtplib.SMTPRecipientsRefused:
                raise NotSent(f"{channel.host} takes no mail for these addresses", permanent=True) from None
            except _TooMuch:
                raise NotSent(f"{channel.host} port {port}: its answers have no end") from None

        deliver(channel.timeout_s, told, f"{channel.host} port {port}")

    return send


def _spellings(user: str, password: str) -> list[str]:
    """A password in plain form, and in the forms that are sent to the server."""
    plain = [password, f"\0{user}\0{password}"] if password else []
    return [*plain, *(base64.b64encode(text.encode()).decode() for text in plain)]


class _TooMuch(Exception):
    """A server's answers are too long."""


class _Bounded:
    """The part of the file interface that smtplib uses, with a limit."""

    def __init__(self, file: IO[bytes], most: int) -> None:
        self._file, self._left = file, most

    def readline(self, size: int = -1) -> bytes:
        """One line, or the part of it that fits into `size` bytes. Raises `_TooMuch`."""
        text = self._file.readline(size)
        self._left -= len(text)
        if self._left < 0:
            raise _TooMuch
        return text

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class _Server(smtplib.SMTP):
    """A connection to a mail server over a `Line`."""

    def __init__(self, line: Line, host: str, port: int, *, encrypted: bool) -> None:
        self._line, self._encrypted = line, encrypted
        try:
            super().__init__(host, port, timeout=line.left())
        except BaseException:
            self.close()
            raise

    def _get_socket(self, host: str, port: int, timeout: float) -> socket.socket:
        sock = self._line.connect(host, port)
        return ssl.create_default_context().wrap_socket(sock, server_hostname=host) if self._encrypted else sock

    def getreply(self) -> tuple[int, bytes]:
        """The server's code and text; no more of them is read than an answer can have."""
        if self.file is None and self.sock is not None:
            self.file = _Bounded(self.sock.makefile("rb"), _MOST_ANSWERED)
        return super().getreply()


def _5xx(error: smtplib.SMTPResponseException) -> bool:
    return 500 <= error.smtp_code < 600


def as_mail(message: Message, channel: Mail) -> MIMEText:
    """The message as e-mail, with headers that prevent automatic replies.

    This uses the classes of `email` that take headers unchanged. The other ones decode everything that looks like
    an encoded word, so a bench's name could become a header, or a body.
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
"""Maximum number of characters in a line of a mail that is sent unchanged."""
_WORD = 42
"""Maximum number of bytes of text in an encoded word, which may be 75 characters long."""


def _plain_header(text: str) -> str:
    """A header's text in ASCII: unchanged if it is ASCII without encoded words, otherwise in encoded words (RFC
    2047).
    """
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
