"""Early looks: what emerges is a warning of the run, and a look that goes wrong is said once and changes nothing."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.by_kind import trace_table
from rig.engine.early_warning import warnings_in
from rig.engine.session import Outcome, Signals
from rig.examples import example
from rig.run_file.chain import Record
from rig.run_file.events.points import Observed
from rig.run_file.verify.verification import verify_file
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.tables.table_of_run import run_table
from rig.unattended import Listeners, RunFacts
from rig.unattended.early_look import SHARE, EarlyLook
from rig.unattended.look_once import seen

PADS = {"names": ["pads", "cross-axis"], "sensors": ["meter_V"], "size": 0.42, "p": 0.0005, "bound": True}
REPLICATIONS = 4


def saying(*seen: Any, used_s: float = 1.0) -> Sequence[str]:
    """A command that answers so."""
    return (sys.executable, "-c", f"print({json.dumps({'seen': list(seen), 'used_s': used_s})!r})")


class Waits(Listeners):
    """Listeners that wait for each look, because the hours of a dry run pass in a moment."""

    def recorded(self, record: Record) -> None:
        super().recorded(record)
        if self.look._worker is not None:
            while not self.look._worker.idle():
                os.sched_yield()


def night(folder: Path, look: EarlyLook | None = None, replications: int = REPLICATIONS) -> Path:
    """A dry run of some replications of the voltmeter, with early looks or without."""
    lab, told = example("voltmeter-lab"), list[Path]()
    text = (lab / "procedure.toml").read_text().replace("-1000, -500, ", "-1000, ")
    (folder / "procedure.toml").write_text(text.replace("replications = 2", f"replications = {replications}"))
    plan = load_plan(folder / "procedure.toml", lab / "bench.toml", dry=True, world=lab / "world.toml")
    listeners = Waits(RunFacts(None, "", "", "", simulated=True))
    if look is not None:
        listeners.look = look
    result = start_run(
        plan, folder, announce=lambda path: (told.append(path), listeners.opened(path, path.stem)),
        signals=Signals(), on_progress=lambda _: None, observer=listeners,
    )  # fmt: skip
    listeners.close()
    assert result.outcome is Outcome.COMPLETE
    return told[0]


def test_what_emerges_is_a_warning_of_the_run_with_its_begin_and_size(tmp_path: Path):
    run = night(tmp_path, EarlyLook(saying(PADS), dry=True))
    (words,) = warnings_in(run)
    assert words == (
        "emerging: pads or cross-axis in meter_V, since replication 1, 0.4 of the scatter (trace of the run so far)"
    )
    assert verify_file(run).whole


def test_data_are_the_same_with_looks_and_without(tmp_path: Path):
    """Bench times are, too: nobody waits for a look."""
    (tmp_path / "with").mkdir()
    looked_at, alone = (
        run_table(night(folder, look))
        for folder, look in ((tmp_path / "with", EarlyLook(saying(PADS), dry=True)), (tmp_path, None))
    )
    assert looked_at.columns.keys() == alone.columns.keys()
    assert all(np.array_equal(looked_at.columns[name], alone.columns[name]) for name in alone.columns)


@pytest.mark.parametrize(
    ("command", "why"),
    [
        (("/bin/sh", "-c", "kill -9 $$"), "was ended by signal 9"),
        (("/bin/sh", "-c", "echo no memory >&2; exit 1"), "failed (no memory)"),
        (("/bin/sh", "-c", "echo half an ans"), "Expecting value"),
        (("/nowhere/python",), "No such file or directory"),
    ],
)
def test_a_look_that_goes_wrong_is_said_once_and_the_run_is_complete(command: Sequence[str], why: str, tmp_path: Path):
    run = night(tmp_path, EarlyLook(command, dry=True))
    (words,) = warnings_in(run)
    assert words.startswith("the early look after replication 1 ")
    assert why in words
    assert words.endswith("; the run goes on without what it would have found")
    assert verify_file(run).whole


def test_a_look_at_work_is_ended_with_the_run_and_nobody_waits_for_it(tmp_path: Path):
    look = EarlyLook(("/bin/sh", "-c", "sleep 1000"), dry=True)
    look.begins(night(tmp_path, replications=2))
    look.recorded(observed(0, 1.0))
    look.recorded(observed(23, 400.0))
    while look._process is None:
        os.sched_yield()
    process = look._process
    look.close()
    assert process.wait() < 0
    assert look.to_note() == []


def observed(index: int, elapsed_s: float) -> Record:
    """A record of an accepted point."""
    record = Record(1, Observed.kind, elapsed_s, 1.8e9 + elapsed_s, run_index=index, status="accepted", attempt=1)
    assert record.accepted
    return record


def test_looks_take_at_most_a_twentieth_of_a_processor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A look's limit is what the looks before it have left; without four seconds there is none."""
    look, asked = EarlyLook(dry=True), list[float]()

    def answered(task: Any) -> Any:
        asked.append(task.most_s)
        return {"seen": [], "used_s": 3.0}

    monkeypatch.setattr(look, "_answer", answered)
    look.begins(night(tmp_path))
    look.recorded(observed(0, 10.0))  # ten seconds were before this session
    for index, elapsed_s in ((23, 60.0), (47, 400.0), (71, 1000.0)):
        look.recorded(observed(index, elapsed_s))
        while look._worker is not None and not look._worker.idle():
            os.sched_yield()
    look.close()
    assert asked == pytest.approx([SHARE * 390.0, SHARE * 990.0 - 3.0])


def test_less_likely_findings_of_many_looks_are_not_said_and_a_narrower_class_is(tmp_path: Path):
    look = EarlyLook(dry=True)
    look.begins(night(tmp_path))
    look._take([{**PADS, "p": 0.03, "bound": False}], "replication 1")
    assert look.to_note() == []
    look._take([PADS], "replication 2")
    look._take([PADS], "replication 3")
    look._take([{**PADS, "names": ["pads"]}], "replication 3")
    first, narrower = (one.message for one in look.to_note())
    assert "pads or cross-axis in meter_V, since replication 2" in first
    assert narrower.startswith("emerging: pads in meter_V, since replication 2")


def test_a_dry_run_and_a_procedure_without_looks_have_none(tmp_path: Path):
    run = night(tmp_path)
    assert warnings_in(run) == []
    look = EarlyLook()
    look.begins(run)
    assert not look._moments


def test_a_look_names_the_effect_in_the_run_so_far(tmp_path: Path):
    """The two highest ranges have an offset of 50 uV, at a scatter of 15 uV of a reading and five readings a point."""
    (one,) = seen(trace_table(run_table(night(tmp_path))).outcomes)
    assert one["names"] == ["range-step:input_V"]
    assert one["sensors"] == ["meter_V"]
    assert 1.0 < one["size"] < 6.0
