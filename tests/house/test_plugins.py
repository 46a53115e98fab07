"""Plug-ins that cannot be used are named with their package, and what to do about it."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from types import SimpleNamespace

import pytest

from rig.bench import plugins
from rig.cli import main
from rig.errors import ConfigurationError
from rig.procedures import kinds as kinds_module
from rig.procedures.errors import BrokenKind
from rig.procedures.kinds import kinds

OURS = "rig.drivers.newport_esp301:NewportESP301"


def point(value: str, package: str) -> EntryPoint:
    return EntryPoint("meter", value, "rig.drivers")._for(SimpleNamespace(name=package, version="1.0"))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"ours": OURS, "theirs": "acme:Meter"}, "'meter' comes with ours 1.0 and with theirs 1.0; keep one"),
        ({"theirs": "no_such_package:Meter"}, "'meter' of theirs 1.0 cannot be loaded: No module named 'no_such"),
        ({"theirs": "rig.drivers.scpi:Meter"}, "'meter' of theirs 1.0 cannot be loaded: .*no attribute 'Meter'"),
        ({"theirs": "rig.drivers.clock:RealClock"}, "'meter' of theirs 1.0 lacks Options, wire, contracts"),
    ],
)
def test_a_driver_that_cannot_be_used_is_named_with_its_package(monkeypatch, values, says):
    points = [point(value, package) for package, value in values.items()]
    monkeypatch.setattr(plugins, "entry_points", lambda _: points)
    with pytest.raises(ConfigurationError, match=says):
        plugins.load("rig.drivers", "meter", ("Options", "wire", "contracts"))


def test_a_package_that_is_found_twice_is_one_package(monkeypatch):
    """As in a source tree that is installed from itself."""
    monkeypatch.setattr(plugins, "entry_points", lambda _: [point(OURS, "ours"), point(OURS, "ours")])
    assert plugins.load("rig.drivers", "meter", ()).__name__ == "NewportESP301"


ATTITUDE = "rig.procedures.attitude.kind:KIND"


def kind_point(value: str, package: str) -> EntryPoint:
    return EntryPoint("pitch-roll", value, "rig.kinds")._for(SimpleNamespace(name=package, version="1.0"))


@pytest.fixture
def install_kinds(monkeypatch):
    """Says what is installed, for a test; afterwards what really is."""

    def install(*points: EntryPoint) -> None:
        kinds.cache_clear()
        monkeypatch.setattr(kinds_module, "entry_points", lambda _: points)

    yield install
    kinds.cache_clear()


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("no_such_package:KIND", "'pitch-roll' cannot be used: ModuleNotFoundError: No module named 'no_such"),
        ("rig.procedures.attitude.kind:OTHER", "cannot be used: AttributeError: .*'OTHER'"),
        ("rig.procedures.errors:DataError", "rig.procedures.errors:DataError is no kind of calibration"),
    ],
)
def test_a_kind_that_cannot_be_used_is_named_with_its_package(install_kinds, capsys, monkeypatch, value, says):
    install_kinds(kind_point(value, "theirs"))
    with pytest.raises(BrokenKind, match=says) as caught:
        kinds()["pitch-roll"]
    assert str(caught.value).endswith("(package theirs 1.0)")
    monkeypatch.setattr("rig.cli._command", lambda: lambda **_: kinds()["pitch-roll"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 78
    assert "package theirs 1.0" in capsys.readouterr().err


def test_two_packages_with_one_kind_are_refused_and_one_found_twice_is_one(install_kinds):
    install_kinds(kind_point(ATTITUDE, "ours"), kind_point("acme:KIND", "theirs"))
    with pytest.raises(BrokenKind, match="two packages have a kind of calibration 'pitch-roll': remove one"):
        kinds()
    install_kinds(kind_point(ATTITUDE, "ours"), kind_point(ATTITUDE, "ours"))
    assert list(kinds()) == ["pitch-roll"]


def test_a_kind_is_loaded_when_it_is_used_so_that_a_broken_one_does_not_stop_work_of_another(install_kinds):
    broken = EntryPoint("theirs", "no_such_package:KIND", "rig.kinds")
    install_kinds(kind_point(ATTITUDE, "ours"), broken)
    assert (list(kinds()), "theirs" in kinds()) == (["pitch-roll", "theirs"], True)
    assert kinds()["pitch-roll"].title == "attitude sensors"
    with pytest.raises(BrokenKind, match="'theirs' cannot be used"):
        dict(kinds())
