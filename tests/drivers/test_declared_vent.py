"""A pressure controller of a file that vents: it takes time, is not told again on its way, and may leave pressure."""

from __future__ import annotations

from importlib.resources import files

import pytest
from declared_bench import QUIET, DeclaredBench

from rig.contracts.declared.instrument import parse
from rig.drivers.errors import NotReady
from rig.engine.safe_state import make_safe

MENSOR = files("rig.drivers.declared").joinpath("mensor_cpc6050.toml").read_text(encoding="utf-8")
SLOW = "time_constant_s = 20"


def controlling(text=MENSOR, psi=80.0, more=SLOW, world=None):
    it = DeclaredBench(text, more=more, world=world)
    it.it.identify()
    it.it.prepare()
    it.it.set(psi)
    it.sleep(300.0)
    it.wire.clear()
    return it


def test_a_vent_takes_time_and_is_not_told_again_on_its_way():
    it = controlling()
    with pytest.raises(
        NotReady, match=r"is off and still at 7[0-9.]* psi, not 6.5 to 16.5: if it stays, pressure may be"
    ):
        it.it.make_safe()
    assert not it.it.read().output
    assert not it.it.read().safe
    it.sleep(10.0)
    with pytest.raises(NotReady, match="is off and still at"):
        it.it.make_safe()
    it.sleep(60.0)
    it.it.make_safe()
    assert it.it.read().safe
    assert [line for line in it.sent if line in ("Measure", "Vent")] == ["Measure", "Vent"]
    it.close()


def test_the_engine_waits_for_it():
    it = controlling()
    done = make_safe(it.bench, it.dry.world)
    assert done.unsafe == ()
    assert 20.0 < done.seconds < 120.0
    assert it.sent.count("Vent") == 1
    it.close()


def test_pressure_that_stays_in_the_line_is_told_at_the_end():
    it = controlling(world={**QUIET, "sources": {"level_psi": {"rest": 52.0}}})
    done = make_safe(it.bench, it.dry.world)
    assert len(done.unsafe) == 1
    assert "is off and still at 52 psi" in done.unsafe[0]
    assert "by hand before disconnecting anything" in done.unsafe[0]
    it.close()


def test_a_bench_says_its_own_atmosphere():
    it = controlling(more=f"{SLOW}\nrest = [14.0, 15.0]")
    make_safe(it.bench, it.dry.world)
    assert it.it.read().safe
    assert 14.0 <= it.it.read().value <= 15.0
    it.close()


def test_what_it_says_of_the_setpoint_before_is_no_arrival():
    """`AS?` of a controller that is slow to notice its new setpoint still says YES."""
    slow = MENSOR.replace("settled = {", "settled_after_s = 5\nsettled = {")
    for text, early in ((MENSOR, True), (slow, False)):
        it = controlling(text)
        answers = it.twin.answers
        it.twin.answers = lambda place, ask, holes, answers=answers: (
            answers(place, ask, holes)._replace(meaning="stable")
            if place == "source.settled"
            else answers(place, ask, holes)
        )
        it.it.set(20.0)
        assert it.it.read().settled is early
        it.sleep(6.0)
        assert it.it.read().settled
        it.close()


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (
            "rest = [6.5, 16.5]",
            "rest = [16.5, 6.5]",
            r"source.rest = \[16.5, 6.5\] has to be the lowest",
        ),
        ("readback = 0.001", "read_off = false", "source.rest needs off, and read, which answers while it is off"),
    ],
)
def test_a_rest_that_cannot_be_is_refused(before, after, said):
    with pytest.raises(ValueError, match=said):
        parse(MENSOR.replace(before, after))
