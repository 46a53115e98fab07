"""Devices that may be serial ports, by name alone: opening a device to find out may do harm."""

from __future__ import annotations

import ipaddress
import re

DEVICE = re.compile(r"/(?:[\w.:@+,=-]+/)*[\w.:@+,=-]+|COM[0-9]{1,3}", re.IGNORECASE)
_NO_PORT = re.compile(
    r"/dev/(null|zero|full|u?random|fd/.*|std(in|out|err)|k?mem|port|kmsg|nvram|snapshot|watchdog\d*|rtc\d*|hpet"
    r"|console|(pts/)?ptmx|mqueue/.*|net/.*|mapper/.*|disk/.*|block/.*|cpu/.*|(sd|hd|vd|xvd)[a-z]+\d*"
    r"|(nvme|mmcblk|loop|dm-|md|sr|sg|ram|zram)\d.*)|/dev|/(proc|sys)/.*|.*/\.\.?(/.*)?|COM0",
    re.IGNORECASE,
)
"""Devices that are not ports. Opening some of them does harm: a watchdog restarts the machine."""
_LONGEST_PATH = 255


def is_port(text: str) -> bool:
    """Whether a text is the absolute path of a possible serial port, or a name such as COM4."""
    return DEVICE.fullmatch(text) is not None and not _NO_PORT.fullmatch(text) and len(text) <= _LONGEST_PATH


def is_ip(text: str) -> bool:
    """Whether a text is an IP address."""
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True
