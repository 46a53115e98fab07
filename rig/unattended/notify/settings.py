"""`notify.toml`: who is told of what, and how. A user's or a machine's own file, never part of a run.

It is not in the bench file because that is stored in every run file and travels with the data: neither people's
addresses nor secrets belong there, and who is to be told must be open to change while a run is under way. Secrets
come from the environment or from a file that holds nothing else.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated, Any, Literal, Self
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict, Field, model_validator

from rig.config import parse_toml, read_text, validated
from rig.errors import ConfigurationError
from rig.unattended.happenings import Kind
from rig.unattended.notify.message import PLACEHOLDERS
from rig.unattended.notify.template import check_names

About = Literal["start", "crash", "hold", "fault", "warning", "ended-by-fault", "stop", "interrupt", "finish"]
EVERYTHING: tuple[About, ...] = (
    "crash", "hold", "fault", "warning", "ended-by-fault", "stop", "interrupt", "finish",
)  # fmt: skip
"""What is told unless `on` says otherwise: all but an ordinary start, at which somebody is present."""


class _Channel(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field("", max_length=60, description="what the channel is called in logs and in the run file")
    on: tuple[About, ...] = Field(EVERYTHING, description="what is told")
    benches: tuple[str, ...] = Field((), description="only of runs on these benches; all if empty")
    simulated: bool = Field(True, description="of simulated benches too, marked SIMULATED")
    timeout_s: float = Field(20.0, gt=0, le=300, description="for an attempt at a delivery, all of it")

    @property
    def label(self) -> str:
        """Its name, or what it is."""
        return self.name or str(getattr(self, "kind", "channel"))

    def wants(self, kind: Kind, bench: str, *, simulated: bool) -> bool:
        """Whether this is told here."""
        if kind is Kind.TEST:
            return True
        here = not self.benches or bench in self.benches
        return kind.value in self.on and here and (self.simulated or not simulated)


class Mail(_Channel):
    """`kind = "mail"`: e-mail by SMTP."""

    kind: Literal["mail"]
    to: tuple[str, ...] = Field(min_length=1, description="addresses")
    sender: str = Field(description="address it comes from")
    host: str = Field(description="the mail server")
    port: int | None = Field(None, gt=0, lt=65536, description="587, 465 with ssl, 25 with none")
    security: Literal["starttls", "ssl", "none"] = Field("starttls", description="how the way there is secured")
    user: str = Field("", description="to log in as, if the server asks for it")
    password_env: str = Field("", description="environment variable that holds the password")
    password_file: Path | None = Field(None, description="file that holds the password and nothing else")

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if bool(self.user) != bool(self.password_env or self.password_file):
            raise ValueError("user needs password_env or password_file, and the other way round")
        if self.user and self.security == "none":
            raise ValueError('security = "none" would send the password in clear: use "starttls" or "ssl"')
        for place, address in (("sender", self.sender), *((f"to.{n}", one) for n, one in enumerate(self.to))):
            if "@" not in address or any(c.isspace() or c in "<>," for c in address):
                raise ValueError(f"{place} is no plain e-mail address (name@host)")
        if not re.fullmatch(r"[\w.:-]{1,253}", self.host) or ".." in self.host:
            raise ValueError("host is the name or number of a machine, and nothing else")
        return self


class Webhook(_Channel):
    """`kind = "webhook"`: an HTTP POST of JSON."""

    kind: Literal["webhook"]
    url: str = Field("", repr=False, description="where to; one that is a secret itself goes into url_env or url_file")
    url_env: str = Field("", description="environment variable that holds the address")
    url_file: Path | None = Field(None, description="file that holds the address and nothing else")
    shape: Literal["json", "ntfy", "slack", "teams"] = Field("json", description="what the receiver expects")
    body: dict[str, Any] | None = Field(
        None,
        description="another shape: any table; {headline}, {message}, {next} and so on are filled in, {{x}} stays {x}",
    )
    token_env: str = Field("", description="environment variable that holds a bearer token")
    token_file: Path | None = Field(None, description="file that holds a bearer token and nothing else")

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if sum(map(bool, (self.url, self.url_env, self.url_file))) != 1:
            raise ValueError("give one of url, url_env, url_file")
        if self.url:
            _check_url(self.url, "url")
        check_names(self.body, PLACEHOLDERS, "body")
        return self


class Command(_Channel):
    """`kind = "command"`: a program of yours, without a shell; the message is its standard input."""

    kind: Literal["command"]
    argv: tuple[str, ...] = Field(min_length=1, description="program and arguments; {headline} and so on are filled in")

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        check_names(self.argv[1:], PLACEHOLDERS, "argv")
        if not self.argv[0].strip():
            raise ValueError("argv: it begins with the program, which has no name here")
        return self


class Apprise(_Channel):
    """`kind = "apprise"`: any of the services that the library apprise knows (extra `notify`)."""

    kind: Literal["apprise"]
    url_env: str = Field("", description="environment variable that holds apprise addresses, separated by spaces")
    url_file: Path | None = Field(None, description="file that holds apprise addresses, one a line")

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if bool(self.url_env) == bool(self.url_file):
            raise ValueError("give url_env or url_file: apprise addresses hold secrets")
        return self


AnyChannel = Annotated[Mail | Webhook | Command | Apprise, Field(discriminator="kind")]


class NotifySettings(BaseModel):
    """A whole `notify.toml`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    most_per_hour: int = Field(10, ge=2, le=1000, description="messages of a session on one channel, in any hour")
    repeats_s: float = Field(900.0, ge=0, le=86400, description="faults and warnings within it are told together")
    channel: tuple[AnyChannel, ...] = Field((), description="who is told; every `[[channel]]` is one")


def read_settings(path: Path) -> NotifySettings:
    """Read and check a file. Raises `ConfigurationError`."""
    settings = validated(NotifySettings, parse_toml(read_text(path, "notify"), str(path)), str(path), shown=False)
    labels = [channel.label for channel in settings.channel]
    for label in labels:
        if labels.count(label) > 1:
            raise ConfigurationError(f"{path}: two channels are called {label}: give them names that differ")
    return settings


def secret(channel: Mail | Webhook | Apprise, what: Literal["password", "url", "token"]) -> str:
    """A secret from the environment or a file; "" where neither is named. Raises `ConfigurationError`.

    Who confuses `url` and `url_env` has written the secret itself where its place belongs. So a place is repeated only
    where it has the form of one.
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
    if not os.path.exists(file):  # False too for what can be no file's name
        raise ConfigurationError(f"no file can be seen where {what}_file says: write one, or correct {what}_file")
    value = read_text(file, "secret").strip()
    if not value:
        raise ConfigurationError(f"{file} is empty: it should hold the secret")
    return value


_PLAIN_VARIABLE = re.compile(r"[A-Z]+(_[A-Z0-9]+)+")


def secret_files(settings: NotifySettings) -> list[Path]:
    """Files that hold secrets, those that are there."""
    named = ("password_file", "url_file", "token_file")
    found = [_at_home(f) for c in settings.channel for n in named if (f := getattr(c, n, None)) is not None]
    return [file for file in found if os.path.exists(file)]


def _at_home(file: Path) -> Path:
    return Path(os.path.expanduser(file))


def web_address(text: str) -> str:
    """An address of the web, checked. Raises `ConfigurationError` without repeating it, for it may be a secret."""
    try:
        _check_url(text, "the address")
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    return text


def _check_url(text: str, what: str) -> None:
    """Raise ValueError, in words that repeat nothing of the address, unless it is one that can be asked."""
    if not (text.isascii() and text.isprintable()) or " " in text:
        raise ValueError(f"{what} has a space or a character that is not plain ASCII: write it as %20 and so on")
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:  # its words repeat the address
        raise ValueError(f"{what} has no host and port that can be understood (https://host:port/...)") from None
    if parts.scheme not in ("http", "https") or not host or port == 0:
        raise ValueError(f"{what} must begin with http:// or https:// and name a host")
    if "@" in parts.netloc:
        raise ValueError(f"{what} has a name or password before its host: use token_env or token_file")
    if not all(0 < len(label) < 64 for label in host.removesuffix(".").split(".")) or len(host) > 253:
        raise ValueError(f"{what} names a host that cannot be one")
