"""`notify.toml`: channels of notifications and their reports. It belongs to a user or a machine, never to a run.

It is separate from the bench file, because that is stored in every run file and is passed on with the data. Addresses
of people and secrets must not be there, and channels must be able to change during a run. Secrets
come from the environment or from a file that contains nothing else.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated, Any, Literal, Self
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict, Field, model_validator

from rig.bench.config import parse_toml, read_text, validated
from rig.errors import ConfigurationError
from rig.unattended.happenings import Kind
from rig.unattended.notify.message import PLACEHOLDERS
from rig.unattended.notify.template import check_names

About = Literal["start", "crash", "hold", "fault", "warning", "ended-by-fault", "stop", "interrupt", "finish", "loop"]
EVERYTHING: tuple[About, ...] = (
    "crash", "hold", "fault", "warning", "ended-by-fault", "stop", "interrupt", "finish", "loop",
)  # fmt: skip
"""Default of `on`: all reports except an ordinary start, at which somebody is present."""


class _Channel(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field("", max_length=60, description="name of the channel in logs and in the run file")
    on: tuple[About, ...] = Field(EVERYTHING, description="what is told")
    benches: tuple[str, ...] = Field((), description="only for runs on these benches; all if empty")
    simulated: bool = Field(True, description="for simulated benches too, marked SIMULATED")
    timeout_s: float = Field(20.0, gt=0, le=300, description="time for a whole attempt at delivery")

    @property
    def label(self) -> str:
        """Its name, or its kind."""
        return self.name or str(getattr(self, "kind", "channel"))

    def wants(self, kind: Kind, bench: str, *, simulated: bool) -> bool:
        """Whether a report is sent on this channel."""
        if kind is Kind.TEST:
            return True
        here = not self.benches or bench in self.benches
        return kind.value in self.on and here and (self.simulated or not simulated)


class Mail(_Channel):
    """`kind = "mail"`: e-mail by SMTP."""

    kind: Literal["mail"]
    to: tuple[str, ...] = Field(min_length=1, description="addresses")
    sender: str = Field(description="address of the sender")
    host: str = Field(description="the mail server")
    port: int | None = Field(None, gt=0, lt=65536, description="default 587, 465 with ssl, 25 with none")
    security: Literal["starttls", "ssl", "none"] = Field("starttls", description="encryption of the connection")
    user: str = Field("", description="login name, if the server requires one")
    password_env: str = Field("", description="environment variable with the password")
    password_file: Path | None = Field(None, description="file that contains only the password")

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if bool(self.user) != bool(self.password_env or self.password_file):
            raise ValueError("user needs password_env or password_file, and vice versa")
        if self.user and self.security == "none":
            raise ValueError('security = "none" would send the password in clear: use "starttls" or "ssl"')
        for place, address in (("sender", self.sender), *((f"to.{n}", one) for n, one in enumerate(self.to))):
            if "@" not in address or any(c.isspace() or c in "<>," for c in address):
                raise ValueError(f"{place} is not a plain e-mail address (name@host)")
        if not re.fullmatch(r"[\w.:-]{1,253}", self.host) or ".." in self.host:
            raise ValueError("host must be only the name or number of a machine")
        return self


class Webhook(_Channel):
    """`kind = "webhook"`: an HTTP POST of JSON."""

    kind: Literal["webhook"]
    url: str = Field("", repr=False, description="address; a secret address goes into url_env or url_file")
    url_env: str = Field("", description="environment variable with the address")
    url_file: Path | None = Field(None, description="file that contains only the address")
    shape: Literal["json", "ntfy", "slack", "teams"] = Field("json", description="form of the request, by receiver")
    body: dict[str, Any] | None = Field(
        None,
        description="any other form, as a table; {headline}, {message}, {next} etc. are filled in; {{x}} gives {x}",
    )
    token_env: str = Field("", description="environment variable with a bearer token")
    token_file: Path | None = Field(None, description="file that contains only a bearer token")

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if sum(map(bool, (self.url, self.url_env, self.url_file))) != 1:
            raise ValueError("give one of url, url_env, url_file")
        if self.url:
            _check_url(self.url, "url")
        check_names(self.body, PLACEHOLDERS, "body")
        return self


class Command(_Channel):
    """`kind = "command"`: a program of the user, without a shell; the message is its standard input."""

    kind: Literal["command"]
    argv: tuple[str, ...] = Field(min_length=1, description="program and arguments; {headline} and so on are filled in")

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        check_names(self.argv[1:], PLACEHOLDERS, "argv")
        if not self.argv[0].strip():
            raise ValueError("argv: its first text is the program, and must not be empty")
        return self


class Apprise(_Channel):
    """`kind = "apprise"`: any service of the library apprise (extra `notify`)."""

    kind: Literal["apprise"]
    url_env: str = Field("", description="environment variable with apprise addresses, separated by spaces")
    url_file: Path | None = Field(None, description="file with apprise addresses, one per line")

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if bool(self.url_env) == bool(self.url_file):
            raise ValueError("give url_env or url_file: apprise addresses contain secrets")
        return self


AnyChannel = Annotated[Mail | Webhook | Command | Apprise, Field(discriminator="kind")]


class NotifySettings(BaseModel):
    """A whole `notify.toml`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    most_per_hour: int = Field(10, ge=2, le=1000, description="maximum messages of a session per channel and hour")
    repeats_s: float = Field(900.0, ge=0, le=86400, description="faults and warnings within this time are combined")
    channel: tuple[AnyChannel, ...] = Field((), description="channels; each `[[channel]]` is one")


def read_settings(path: Path) -> NotifySettings:
    """Read and check a file. Raises `ConfigurationError`."""
    values = parse_toml(read_text(path, "notify"), str(path), shown=False)
    settings = validated(NotifySettings, values, str(path), shown=False)
    labels = [channel.label for channel in settings.channel]
    for label in labels:
        if labels.count(label) > 1:
            raise ConfigurationError(f"{path}: two channels are called {label}: give them names that differ")
    return settings


def secret(channel: Mail | Webhook | Apprise, what: Literal["password", "url", "token"]) -> str:
    """A secret from the environment or a file; "" if neither is named. Raises `ConfigurationError`.

    A user who confuses `url` and `url_env` has written the secret itself in place of a variable's name. So the text
    is repeated in messages only if it has the form of a name.
    """
    env: str = getattr(channel, f"{what}_env", "")
    file: Path | None = getattr(channel, f"{what}_file", None)
    if env:
        value = os.environ.get(env, "").strip() if "\0" not in env else ""
        if not value:
            name = f"variable {env}" if _PLAIN_VARIABLE.fullmatch(env) else f"variable that {what}_env names"
            raise ConfigurationError(f"the environment {name} is not set: set it, or name a file with {what}_file")
        return value
    if file is None:
        return ""
    file = _at_home(file)
    if not os.path.exists(file):  # also False for an invalid file name
        raise ConfigurationError(f"the file named by {what}_file cannot be found: write it, or correct {what}_file")
    value = read_text(file, "secret").strip()
    if not value:
        raise ConfigurationError(f"{file} is empty: it must contain the secret")
    return value


_PLAIN_VARIABLE = re.compile(r"[A-Z]+(_[A-Z0-9]+)+")


def secret_files(settings: NotifySettings) -> list[Path]:
    """Existing files with secrets."""
    named = ("password_file", "url_file", "token_file")
    found = [_at_home(f) for c in settings.channel for n in named if (f := getattr(c, n, None)) is not None]
    return [file for file in found if os.path.exists(file)]


def _at_home(file: Path) -> Path:
    return Path(os.path.expanduser(file))


def web_address(text: str) -> str:
    """A checked web address. Raises `ConfigurationError` without repeating it, because it may be a secret."""
    try:
        _check_url(text, "the address")
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    return text


def _check_url(text: str, what: str) -> None:
    """Raise ValueError for an invalid address, without repeating any part of it."""
    if not (text.isascii() and text.isprintable()) or " " in text:
        raise ValueError(f"{what} has a space or a character that is not plain ASCII: write it as %20 and so on")
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:  # its text repeats the address
        raise ValueError(f"{what} has no valid host and port (https://host:port/...)") from None
    if parts.scheme not in ("http", "https") or not host or port == 0:
        raise ValueError(f"{what} must begin with http:// or https:// and name a host")
    if "@" in parts.netloc:
        raise ValueError(f"{what} has a name or password before its host: use token_env or token_file")
    if not all(0 < len(label) < 64 for label in host.removesuffix(".").split(".")) or len(host) > 253:
        raise ValueError(f"{what} names an invalid host")
