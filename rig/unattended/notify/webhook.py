"""Webhooks: an HTTP POST of JSON. No redirect is followed, and no address is ever part of a message."""

from __future__ import annotations

import http
import http.client
import json
import urllib.error
import urllib.request
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

from rig.errors import ConfigurationError
from rig.unattended.notify.delivery import Line, NotSent, deliver
from rig.unattended.notify.message import Message
from rig.unattended.notify.notify_file import Webhook, secret, web_address
from rig.unattended.notify.template import filled


def webhook_sender(channel: Webhook) -> Callable[[Message], None]:
    """A function that posts a message, or raises `NotSent`. Raises `ConfigurationError` for an invalid secret."""
    url = web_address(channel.url or secret(channel, "url"))
    if channel.shape == "ntfy" and channel.body is None and not urlsplit(url).path.strip("/"):
        raise ConfigurationError('shape = "ntfy": the address ends with the topic (https://host/topic)')
    token = secret(channel, "token")
    if not (token.isascii() and token.isprintable()):
        raise ConfigurationError("the token has characters that no header permits: it must be one line of plain ASCII")
    where = urlsplit(url).hostname if channel.url else "the webhook"  # the rest of an address is often the secret
    headers = {"Content-Type": "application/json", "User-Agent": "calibration-rig"}
    if token:
        headers["Authorization"] = f"Bearer {token}"

    def send(message: Message) -> None:
        target, content = payload(message, channel, url)
        data = json.dumps(content).encode()
        request = urllib.request.Request(target, data=data, headers=headers, method="POST")

        def post(line: Line) -> None:
            try:
                with _opener(line).open(request, timeout=line.left()):
                    line.take()  # only the status code of the answer counts
            except urllib.error.HTTPError as error:
                error.close()
                again = error.code in (408, 425, 429) or error.code >= 500
                said = f"{where} answers HTTP {error.code} {_PHRASES.get(error.code, '')}"  # not the server's text
                raise NotSent(said, permanent=not again) from None

        deliver(channel.timeout_s, post, str(where))

    return send


_PHRASES = {status.value: status.phrase for status in http.HTTPStatus}


def _opener(line: Line) -> urllib.request.OpenerDirector:
    """An opener for HTTP requests over a `Line`, through the proxy of the environment, without redirects.

    urllib would follow a redirected POST with a GET, which looks like success but sends nothing.
    """

    def plain(host: str, **more: Any) -> http.client.HTTPConnection:
        return _on(http.client.HTTPConnection(host, **more), line)

    def encrypted(host: str, **more: Any) -> http.client.HTTPConnection:
        return _on(http.client.HTTPSConnection(host, **more), line)

    class Plain(urllib.request.HTTPHandler):
        def http_open(self, req: urllib.request.Request) -> http.client.HTTPResponse:
            return self.do_open(plain, req)

    class Encrypted(urllib.request.HTTPSHandler):
        def https_open(self, req: urllib.request.Request) -> http.client.HTTPResponse:
            return self.do_open(encrypted, req)

    director = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(),
        Plain(),
        Encrypted(),
        urllib.request.HTTPErrorProcessor(),
        urllib.request.HTTPDefaultErrorHandler(),
    ):
        director.add_handler(handler)
    return director


def _on(connection: http.client.HTTPConnection, line: Line) -> http.client.HTTPConnection:
    """A connection over a `Line`."""

    def create(address: tuple[str, int], *_: Any) -> Any:
        return line.connect(*address)

    connection._create_connection = create  # type: ignore[attr-defined]  # the library's hook for another constructor
    return connection


def payload(message: Message, channel: Webhook, url: str) -> tuple[str, object]:
    """Address and content of the POST, in the form that the receiver expects."""
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
