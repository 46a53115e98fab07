"""Places on the network, as they may be written in addresses."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass

_LONGEST_LABEL, _LONGEST_HOST = 63, 253
"""Maximum length of a host's name and of its parts (RFC 1035)."""


@dataclass(frozen=True)
class HostPort:
    """A place on the network.

    Attributes:
        host: name or IP address, IPv6 without brackets.
        port: TCP port.
    """

    host: str
    port: int


def host_wrong(host: str) -> str:
    """Defect of a host name, "" if it is valid."""
    if host.startswith("["):
        try:
            ipaddress.IPv6Address(host.strip("[]"))
        except ValueError:
            return f"{host} is not an IPv6 address"
        return ""
    if len(host) > _LONGEST_HOST or any(len(label) > _LONGEST_LABEL for label in host.split(".")):
        return "a host's name has at most 253 characters, 63 between dots"
    if re.fullmatch(r"[0-9.]+", host):
        try:
            ipaddress.IPv4Address(host)
        except ValueError:
            return f"{host} is not an IPv4 address"
    return ""
