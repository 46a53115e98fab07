"""The person of a dry run states what a real one could: within the range of the step."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from general_lab import PROCEDURE, WORLD, run_dry

from rig.errors import ConfigurationError
from rig.procedures.plan.hand_steps import HandStep
from rig.run_file.events.by_hand import DoneByHand
from rig.run_file.read.reader import RunReader
from rig.sims.physics.by_hand import PersonTruth
from rig.simulated.person import SimulatedPerson

STEP = '[[by_hand]]\nbefore = 1\nsay = "read the barometer"\nchange = "air"\nvalue = "air_hPa"\nrange = [950, 1050]\n'
WITH_STEP = PROCEDURE.replace("replications = 2", "replications = 1") + STEP


def stated(path):
    with RunReader.open(path) as reader:
        return [r.event.number for r in reader.records() if isinstance(r.event, DoneByHand)]


@pytest.mark.parametrize(("states", "number"), [("", 1000.0), ("states = 1013.25\n", 1013.25)])
def test_a_number_of_the_range_is_stated(tmp_path, states, number):
    path, _ = run_dry(tmp_path, WITH_STEP, world=WORLD + states)
    assert stated(path) == [number]


def test_a_world_whose_person_is_refused_each_time_is_an_error_of_that_file(tmp_path):
    """The number went into the run file, although a real person's would be refused."""
    with pytest.raises(ConfigurationError, match=r"world\.toml: person\.states = 12 is refused at the step") as e:
        run_dry(tmp_path, WITH_STEP, world=WORLD + "states = 12\n")
    assert "950 to 1050 as air_hPa" in str(e.value)


def test_a_refused_number_does_not_change_the_simulated_bench():
    changes = []
    sim = SimpleNamespace(
        plant=SimpleNamespace(truth=SimpleNamespace(person=PersonTruth(after_s=1.0, states=12.0))),
        world=SimpleNamespace(now=iter(range(9)).__next__),
        by_hand=lambda change, _: changes.append(change),
    )
    person = SimulatedPerson(sim)
    for low, made in ((950.0, []), (10.0, ["air"])):
        step = HandStep(0, "read the barometer", "air", "air_hPa", low=low, high=1050.0)
        assert person.asked(step)
        assert person.answer() == ("12.0", "simulated person")
        assert changes == made
