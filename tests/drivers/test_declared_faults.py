"""Declared instruments on wires on which everything goes wrong: only our own errors come out, and no wrong reading."""

from __future__ import annotations

import contextlib
import itertools
import math
import time

import pytest
from declared_bench import QUIET, DeclaredBench
from test_declared import BALANCE, BATH, MAP, NODES, PROBE, SCANNER, VENTED

from rig.bench.plugins import declared
from rig.drivers.errors import DriverError
from rig.drivers.roles import Reader, Source
from rig.sims.declared import twin_of
from rig.sims.faults import kinds_of
from rig.sims.faults.instrument_faults import POWER

FAMILIES = {
    "bath": (BATH, "text"),
    "balance": (BALANCE, "text"),
    "scanner": (SCANNER, "text"),
    "nodes": (NODES, "text"),
    "vented": (VENTED, "text"),
    "probe": (PROBE, "stream"),
    "map": (MAP, "modbus"),
}


STEP = {"balance": 1e-9, "scanner": 1e-6, "map": 0.00051}
"""Half the last digit that they send."""


def calls(it: DeclaredBench):
    driver = it.it
    found = [driver.identify, driver.prepare, driver.wrong]
    if isinstance(driver, Source):
        low, high = driver.limits()
        found += [lambda: driver.set(low + 0.3 * (high - low)), driver.read, driver.stop, driver.read]
    if isinstance(driver, Reader):
        found += [lambda: driver.start(2), driver.fetch]
    return [*found, driver.make_safe]


@pytest.mark.parametrize("family", FAMILIES)
def test_whatever_happens_on_its_wire_only_our_own_errors_come_out(family):
    text, protocol = FAMILIES[family]
    kinds = [kind for kind in kinds_of(twin_of(text)).values() if kind.wires or kind is POWER]
    assert len(kinds) > 4
    failed = happened = 0
    for seed, kind in enumerate(kinds, start=1):
        lasting = {"for_s": 3.0} if kind.lasts_s else {}
        fault = {"kind": kind.name, "on": "it", "probability": 0.35, **lasting}
        it = DeclaredBench(text, protocol=protocol, world={**QUIET, "seed": seed, "faults": [fault]})
        for call in calls(it) * 2:
            try:
                call()
            except DriverError:
                failed += 1
        happened += len(it.dry.sim.faults.happened)
        it.close()
    assert happened or family == "probe"  # nothing is asked of it
    assert failed or family == "probe"


@pytest.mark.parametrize("family", ["balance", "scanner", "map"])
def test_a_reading_that_comes_through_is_a_reading(family):
    """Characters are lost, doubled and changed: what is believed is what the instrument has said."""
    text, protocol = FAMILIES[family]
    wrong = taken = 0
    for kind in ("no-reply", "late-reply", "garbled", "truncated", "duplicated", "wrong-reply"):
        if kind not in kinds_of(twin_of(text)):
            continue
        fault = {"kind": kind, "on": "it", "probability": 0.05}
        it = DeclaredBench(text, protocol=protocol, world={**QUIET, "seed": 5, "faults": [fault]})
        said: list[float] = []
        before = it.twin._measured
        it.twin._measured = lambda name, t0, before=before, said=said: said.append(before(name, t0)) or said[-1]
        for _ in range(40):
            try:
                it.it.prepare()
                it.it.start(1)
                found = [value for values in it.it.fetch().values() for value in values]
            except DriverError:
                continue
            taken += len(found)
            wrong += sum(min(abs(value - one) for one in said) > STEP[family] for value in found)
        it.close()
    assert taken > 50
    assert wrong == 0


UNNUMBERED = ("hp-3458a", "isotech-millik", "keithley-2000", "keithley-dmm6500", "mettler-sics")
"""Supplied ones whose readings bear no number."""


@pytest.mark.parametrize("name", UNNUMBERED)
def test_a_reading_without_a_number_is_not_an_old_one(name):
    """`rig night --lab any-bench --seed 4669`: answers to the question before, as many as a fault may have."""
    taken = old = happened = 0
    for seed in range(12):
        fault = {"kind": "wrong-reply", "on": "it", "times": 1 + seed % 8, "exchange": 20 + 3 * seed}
        it = DeclaredBench(declared()[name], world={**QUIET, "faults": [fault]})
        it.it.prepare()
        numbers = itertools.count(1)
        it.twin._measured = lambda name, t0, numbers=numbers: next(numbers) / 50.0
        for _ in range(15):
            since = next(numbers) / 50.0
            with contextlib.suppress(DriverError):
                it.it.start(3)
                for values in it.it.fetch().values():
                    taken += len(values)
                    old += sum(now < before + 0.01 for before, now in itertools.pairwise((since, *values)))
        happened += len(it.dry.sim.faults.happened)
        it.close()
    assert happened > 12
    assert taken > 200
    assert old == 0


def test_an_exchange_takes_no_longer_than_that_of_a_handwritten_driver():
    """At most 1.3 times; the median of pairs, in one process."""
    from test_scpi_described import METER, Bench  # noqa: PLC0415

    text = """
scpi = true
model = "M1"
maker = "SIMULATED"
prepare = ["CONF:VOLT:DC 10", "VOLT:NPLC 5"]
check = [{ ask = "VOLT:NPLC?", is = 5 }]
[reader]
unit = "V"
number = "*SRE {mark:d}"
start = "SAMP:COUN {count:d};:INIT"
fetch = { ask = "FETC?;*SRE?", answer = "{values};{mark:d}" }
reading_s = 0.1
"""
    ours, theirs = DeclaredBench(text), Bench(METER)
    took: dict[str, list[float]] = {"ours": [], "theirs": []}
    for it in (ours, theirs):
        it.it.identify()
        it.it.prepare()
    for _ in range(60):
        for name, it in (("ours", ours), ("theirs", theirs)):
            began = time.process_time()
            it.it.start(3)
            it.it.fetch()
            assert it.it.wrong() == ()
            took[name].append(time.process_time() - began)
    ours.close()
    theirs.dry.close()
    best = {name: min(values) for name, values in took.items()}
    assert math.isfinite(best["ours"])
    assert best["ours"] <= 1.3 * best["theirs"], best


def test_an_open_input_of_a_file_without_a_word_for_it_is_no_reading():
    fault = {"kind": "open-circuit", "on": "it", "at_s": 5.0, "for_s": 600.0}
    it = DeclaredBench(PROBE, protocol="stream", world={**QUIET, "seed": 1, "faults": [fault]})
    it.it.identify()
    it.it.prepare()
    it.sleep(10.0)
    it.it.start(2)
    with pytest.raises(DriverError, match=r"\*\*\*\*"):
        it.it.fetch()
    it.close()
