"""Plug-ins that cannot be used are named with their package, and what to do about it."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from types import SimpleNamespace

import pytest

from rig import plugins
from rig.errors import ConfigurationError

OURS = "drivers.keysight_34401a:Keysight34401A"


def point(value: str, package: str) -> EntryPoint:
    return EntryPoint("meter", value, "rig.drivers")._for(SimpleNamespace(name=package, version="1.0"))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"ours": OURS, "theirs": "acme:Meter"}, "'meter' comes with ours 1.0 and with theirs 1.0; keep one"),
        ({"theirs": "no_such_package:Meter"}, "'meter' of theirs 1.0 cannot be loaded: No module named 'no_such"),
        ({"theirs": "drivers.keysight_34401a:Meter"}, "'meter' of theirs 1.0 cannot be loaded: .*no attribute 'Meter'"),
        ({"theirs": "drivers.clock:RealClock"}, "'meter' of theirs 1.0 does not say its Options, wire, contracts"),
    ],
)
def test_a_driver_that_cannot_be_used_is_named_with_its_package(monkeypatch, values, says):
    points = [point(value, package) for package, value in values.items()]
    monkeypatch.setattr(plugins, "_points", lambda _: points)
    with pytest.raises(ConfigurationError, match=says):
        plugins.load("rig.drivers", "meter", ("Options", "wire", "contracts"))


def test_a_package_that_is_found_twice_is_one_package(monkeypatch):
    """As in a source tree that is installed from itself."""
    monkeypatch.setattr(plugins, "_points", lambda _: [point(OURS, "ours"), point(OURS, "ours")])
    assert plugins.load("rig.drivers", "meter", ()).__name__ == "Keysight34401A"
