"""Every instrument that is installed as a plug-in, ours and one of another package, held to the same."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import outside_package
import pytest
from exercise import NAME, Exercise, golden, on_file

from rig.bench.plugins import declared, driver_class, installed
from rig.drivers.driver import ContractFile
from rig.drivers.errors import DriverError, LimitError
from rig.drivers.roles import Chamber, Head, PressureController, Reader, Restartable, Source
from rig.errors import BenchFault
from rig.instruments.guarded import Refused
from rig.instruments.opening import identities
from rig.sims.faults import Kind, kinds_of
from rig.sims.faults.instrument_faults import POWER
from rig.simulated.dry_run import twin_class

ROLES = {
    "head": Head,
    "reader": Reader,
    "chamber": Chamber,
    "pressure-controller": PressureController,
    "source": Source,
}
PEOPLE = [name for name in installed("rig.twins") if driver_class(name).wire == "none"]
"""Those without a wire, to whom nothing is sent (test_general_lab)."""
DRIVERS = [*(name for name in installed("rig.twins") if name not in PEOPLE), outside_package.DRIVER]
"""Those with a twin of their own: those in Python, and files whose twin knows more of the instrument than they do."""


@pytest.fixture(scope="module", autouse=True)
def _outside() -> Iterator[None]:
    with outside_package.installed():
        yield


@pytest.fixture
def it(request: pytest.FixtureRequest) -> Iterator[Exercise]:
    exercise = Exercise(request.param)
    yield exercise
    exercise.close()


every = pytest.mark.parametrize("it", DRIVERS, indirect=True)
every_name = pytest.mark.parametrize("name", DRIVERS)


def test_the_package_from_elsewhere_is_one_of_them():
    assert outside_package.DRIVER in installed("rig.drivers")
    assert {*DRIVERS, *PEOPLE} == set(installed("rig.twins"))
    assert set(installed("rig.twins")) - set(declared()) == set(installed("rig.drivers"))


@every_name
def test_driver_and_twin_say_what_others_have_to_know_of_them(name):
    driver, twin = driver_class(name), twin_class(name)
    assert driver.wire == twin.wire
    assert twin.roles == {role for role, protocol in ROLES.items() if issubclass(driver, protocol)}
    assert all(isinstance(contract, ContractFile) for contract in driver.contracts)
    assert {contract.option for contract in driver.contracts} <= driver.Options.model_fields.keys()
    names = [kind.name for kind in twin.faults]
    assert len(set(names)) == len(names)


@every_name
def test_what_goes_over_the_wire_is_what_is_on_file(name):
    assert golden(name) == on_file(name)["exchange"]


@every
def test_it_says_who_it_is_and_another_serial_number_is_refused(it):
    found = identities(it.bench)[NAME]
    assert found["maker"]
    assert found["model"]
    assert identities(it.bench)[NAME] == found
    if found["confirmed"]:
        other = it.bench.config.instruments[NAME].model_copy(update={"serial": "SN-of-another"})
        it.bench.config.instruments[NAME] = other
        with pytest.raises(BenchFault, match="connect the declared instrument"):
            identities(it.bench)


@every
def test_beyond_its_limits_nothing_is_sent(it):
    it.bring_up()
    driver, beyond = it.driver, []
    if isinstance(driver, Head):
        for axis, (low, high) in driver.axes().items():
            beyond += [("move", {axis: low - 0.5}), ("move", {axis: high + 0.5})]
    if isinstance(driver, Reader):
        beyond += [("start", 0), ("start", 10**9)]
    for role, command in ((Chamber, "set_temperature"), (PressureController, "set_pressure"), (Source, "set")):
        if isinstance(driver, role):
            low, high = driver.limits()
            beyond += [(command, low - 0.5), (command, high + 0.5), (command, float("nan"))]
    assert beyond
    it.wire.clear()
    for command, value in beyond:
        with pytest.raises((LimitError, Refused)):
            getattr(driver, command)(value)
    assert not it.wire, it.exchange()


def unsafe(it: Exercise) -> list[str]:
    """What of the plant or the twin is not as the safe state of a role has it."""
    now, found = it.dry.world.now(), []
    if "head" in it.twin.roles:
        found += [axis for axis in it.plant.head.axes if it.plant.head.moving(axis, now)]
    if "chamber" in it.twin.roles:
        setpoint = it.plant.chamber(NAME).setpoint_degC
        found += [] if 15.0 < setpoint < 30.0 else [f"setpoint {setpoint}"]
    if "pressure-controller" in it.twin.roles:
        line = it.plant.pressure_line(NAME)
        far = abs(line.pressure_psia(now) - line.ambient_psia(now)) > 0.5
        found += ["pressure"] * far + ["control"] * line.controlling
    if "source" in it.twin.roles:
        found += ["output"] * it.plant.source(NAME).on
    return found


@every
def test_its_safe_state_is_safe_from_the_middle_of_its_work_and_again(it):
    it.bring_up()
    driver = it.driver
    if isinstance(driver, Head):
        driver.move({axis: high for axis, (_, high) in driver.axes().items()})
    if isinstance(driver, Chamber):
        driver.set_temperature(driver.limits()[1])
    if isinstance(driver, PressureController):
        driver.set_pressure(driver.limits()[0] + 1.0)
    if isinstance(driver, Source):
        driver.set(driver.limits()[1])
    if isinstance(driver, Reader):
        driver.start(100)
    else:
        it.sleep(3.0)
        assert unsafe(it), "it was not at work"
    for _ in range(2):
        driver.make_safe()
        it.sleep(10.0)
        assert not unsafe(it)
    if isinstance(driver, Reader):
        with pytest.raises(DriverError):
            driver.fetch()  # what was under way was given up
        driver.start(1)
        assert all(len(values) == 1 for values in driver.fetch().values())


@every
def test_it_tells_that_its_power_was_off_or_loses_nothing_by_it(it):
    it.bring_up()
    list(it.work())
    if isinstance(it.driver, Restartable):
        assert not it.driver.restarted()
        it.twin.power_cycle()
        assert it.driver.restarted()
        assert it.driver.restarted(), "asking does not use the evidence up"
        it.driver.prepare()
        assert not it.driver.restarted()
        return
    before = it.driver.read() if isinstance(it.driver, Chamber) else None
    it.twin.power_cycle()
    if isinstance(it.driver, Head):
        assert not any(axis.homed for axis in it.driver.read().values())
    elif isinstance(it.driver, Chamber):
        after = it.driver.read()
        assert (after.running, after.setpoint_degC) == (before.running, before.setpoint_degC)
    else:
        it.driver.start(1)
        it.driver.fetch()


def outcome(it: Exercise) -> list[Any]:
    """What comes of its work after a step of all that it could see: answers and errors."""
    found: list[Any] = []
    for axis in it.plant.head.axes.values():
        axis.slip(1.0, encoder=True)
    try:
        found += it.work()
        if isinstance(it.driver, Restartable):
            found.append(it.driver.restarted())
        it.driver.prepare()
    except DriverError as error:
        found.append(type(error).__name__)
    return found


def ways(kind: Kind) -> list[dict[str, str]]:
    """Every choice of the words that its options may be."""
    words = {key: option.words for key, option in kind.options.items() if option.words}
    return [dict(zip(words, chosen, strict=True)) for chosen in itertools.product(*words.values())]


@every_name
def test_whatever_happens_on_its_wire_only_our_own_errors_come_out(name):
    """Every command, on a wire on which every kind strikes again and again."""
    kinds = [kind for kind in kinds_of(twin_class(name)).values() if kind.wires or kind is POWER]
    assert len(kinds) > 5
    failed = 0
    for seed, kind in enumerate(kinds, start=1):
        lasting = {"for_s": 3.0} if kind.lasts_s else {}
        fault = {"kind": kind.name, "on": NAME, "probability": 0.35, **lasting}
        it = Exercise(name, {"seed": seed, "faults": [fault]})
        for call in it.calls() * 2:
            try:
                call()
            except DriverError:
                failed += 1
        assert it.dry.sim.faults.happened, f"{kind.name} never happened (seed {seed})"
        it.close()
    assert failed


FAULTS = [
    (name, kind.name)
    for name in installed("rig.twins")
    if name not in PEOPLE
    for kind in (*twin_class(name).faults, POWER)
]
OF_THE_OUTSIDE = ("overload", "frozen-reading", "spike", "open-circuit", "error-queue-overflow", "oven-cold")
OF_THE_OUTSIDE += (POWER.name,)
HARMLESS = {"error-queue-overflow"}
"""What a driver may pass over: nothing but its errors is affected, and these are nobody's."""


@pytest.mark.parametrize(("name", "kind"), [*FAULTS, *((outside_package.DRIVER, kind) for kind in OF_THE_OUTSIDE)])
def test_a_fault_that_its_twin_declares_can_be_played_and_is_noticed_and_over_again(name, kind):
    """Noticed: its work comes out otherwise than at the same moment of the same bench without the fault."""
    what = {one.name: one for one in (*twin_class(name).faults, POWER)}[kind]
    calm = Exercise(name)
    calm.bring_up()
    expected = outcome(calm)
    seen = []
    for words in ways(what):
        it = Exercise(name)
        it.bring_up()
        it.strike(what, **words)
        seen.append(outcome(it))
        happened = it.dry.sim.faults.happened
        assert happened, words
        assert all(one.fault.kind == kind and one.what for one in happened)
        it.sleep(what.lasts_s + 60.0)
        it.bring_up()
        list(it.work())
        it.close()
    calm.close()
    if kind in HARMLESS:
        assert all(one == expected or isinstance(one[-1], str) for one in seen)
    else:
        assert any(one != expected for one in seen), what.sentence


def test_the_faults_of_the_outside_instrument_are_those_that_were_played():
    assert {kind.name for kind in twin_class(outside_package.DRIVER).faults} | {POWER.name} == set(OF_THE_OUTSIDE)
