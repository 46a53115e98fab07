"""Two keys: only exactly the bytes that somebody else approved run on a bench with `approval = true`, and once."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from lab_people import WORD, laboratory, typed
from small_run import write_small

from rig.bench.config import ConfigurationError
from rig.engine.session import Outcome, Signals
from rig.errors import UsageError
from rig.lab import Laboratory
from rig.lab.proposals import decide, propose
from rig.run_file.approval import DOCUMENT, Approval, defect, digest_of, digests_of
from rig.run_file.events.laboratory import Proposed
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.verification import verify_file
from rig.runs import plans
from rig.runs.controller import Result, Site, opened, resume_run, start_run
from rig.runs.plans import Plan, load_plan
from rig.who import Operator

ANNA, BEN = Operator("Anna (anna)", "password"), Operator("Ben (ben)", "password")
DRY = {"outcome": "complete", "hours": 1.0, "points": 10, "observed": 10, "extremes": {}, "left_on": []}


@contextmanager
def twins(plan: Plan, **how: Any) -> Iterator[Any]:
    with opened(replace(plan, dry=True), **how) as found:
        yield found


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """A laboratory with a bench that needs an approval, and is itself simulated."""
    folder = laboratory(tmp_path / "lab", "attitude-lab")
    bench = folder / "bench.toml"
    bench.write_text("approval = true\nsimulated = true\n" + bench.read_text())
    write_small(folder)
    return folder


def plan_of(lab: Path) -> Plan:
    return load_plan(lab / "small.toml", lab / "bench.toml")


def proposed(lab: Path, plan: Plan, by: Operator = ANNA, **dry: Any) -> int:
    documents = dict(plan.documents)
    asked = Proposed(
        number=0,
        procedure="small.toml",
        bench="bench.toml",
        documents=documents,
        run_list=plan.run_list.sha256(),
        dry={**DRY, **dry},
        who=by.name,
        who_by=by.by,
    )
    return propose(Laboratory(lab), asked).number


def carried_out(plan: Plan, folder: Path) -> Result:
    site = Site(opened=twins)
    silent: dict[str, Any] = {"announce": lambda _: None, "on_progress": lambda _: None}
    return start_run(plan, folder, signals=Signals(), site=site, **silent)


def test_an_approved_run_has_its_approval_in_the_chain_and_no_second_run_has_it(lab: Path):
    plan = plan_of(lab)
    with pytest.raises(UsageError, match="nobody has approved these files"):
        carried_out(plan, lab / "runs")
    number = proposed(lab, plan)
    with pytest.raises(UsageError, match="proposal 1 of exactly these files is waiting"):
        carried_out(plan, lab / "runs")
    decide(Laboratory(lab), number, "approved", "", BEN)
    result = carried_out(plan, lab / "runs")
    assert result.outcome is Outcome.COMPLETE
    with RunReader.open(result.path) as reader:
        about, approval = reader.about(), Approval.of(reader.documents()[DOCUMENT])
    assert (approval.proposed_by, approval.approved_by) == (ANNA.name, BEN.name)
    assert DOCUMENT in about.documents
    verified = typed("verify", result.path, cwd=lab)
    assert (verified.returncode, "approved by Ben (ben)" in verified.stdout) == (0, True), verified.stderr
    with pytest.raises(UsageError, match="proposal 1 of exactly these files is used"):
        carried_out(plan, lab / "runs")
    assert len(list((lab / "runs").glob("*.sqlite"))) == 1


@pytest.mark.parametrize("name", ["small.toml", "bench.toml", "equipment.toml"])
def test_a_changed_byte_asks_again(name: str, lab: Path):
    decide(Laboratory(lab), proposed(lab, plan_of(lab)), "approved", "", BEN)
    path = lab / name
    path.write_text(path.read_text() + "\n")
    document = "procedure.toml" if name == "small.toml" else name
    with pytest.raises(UsageError, match=f"proposal 1, which is approved, is of another {document}"):
        carried_out(plan_of(lab), lab / "runs")
    path.write_text(path.read_text()[:-1])
    assert plan_of(lab).permission() is not None


@pytest.mark.parametrize(
    ("by", "dry", "says"),
    [
        (ANNA, {}, "Anna .anna. proposed it: somebody else"),
        (Operator("Renamed (anna)", "password"), {}, "proposed it: somebody else"),
        (Operator("Ben (ben)", "login"), {}, "needs a person with a password"),
        (Operator("planner (planner)", "token"), {}, "needs a person with a password"),
        (BEN, {"outcome": "fault"}, "its dry run was not complete"),
    ],
)
def test_who_may_not_approve_what(by: Operator, dry: dict[str, str], says: str, lab: Path):
    number = proposed(lab, plan_of(lab), **dry)
    with pytest.raises(UsageError, match=says):
        decide(Laboratory(lab), number, "approved", "", by)


def test_what_nobody_proposed_by_name_is_not_approved(lab: Path):
    number = proposed(lab, plan_of(lab), Operator("root", "login"))
    with pytest.raises(UsageError, match="nothing proves who proposed it"):
        decide(Laboratory(lab), number, "approved", "", BEN)


def test_a_declined_proposal_stays_declined(lab: Path):
    number = proposed(lab, plan_of(lab))
    decide(Laboratory(lab), number, "declined", "too hot", BEN)
    with pytest.raises(UsageError, match="declined"):
        decide(Laboratory(lab), number, "approved", "", BEN)
    with pytest.raises(UsageError, match="is declined"):
        carried_out(plan_of(lab), lab / "runs")


def test_an_approval_is_of_its_own_run_and_files_only(lab: Path):
    plan = plan_of(lab)
    digests = digests_of(plan.documents)
    good = Approval(1, "run-1", ANNA.name, BEN.name, "abc", 3, "00", digests)
    assert defect(good.text(), digests, "abc", "run-1") == ""
    assert "another run" in defect(good.text(), digests, "abc", "run-2")
    assert "another run list" in defect(good.text(), digests, "abd", "run-1")
    assert "other files" in defect(good.text(), {**digests, "bench.toml": "0"}, "abc", "run-1")
    assert "other files" in defect(good.text(), {**digests, "further.csv": "0"}, "abc", "run-1")
    assert "the person who proposed it" in defect(replace(good, approved_by=ANNA.name).text(), digests, "abc", "run-1")
    assert "no approval" in defect("proposal = 1\n", digests, "abc", "run-1")


def test_a_run_with_a_copied_approval_is_found_and_not_resumed(lab: Path, monkeypatch: pytest.MonkeyPatch):
    plan = plan_of(lab)
    decide(Laboratory(lab), proposed(lab, plan), "approved", "", BEN)
    with RunReader.open(carried_out(plan, lab / "runs").path) as reader:
        text = reader.documents()[DOCUMENT]
    monkeypatch.setattr(plans.Plan, "permission", lambda _: None)  # a program that does not ask
    copied = replace(plan, documents={**plan.documents, DOCUMENT: text})
    silent: dict[str, Any] = {"announce": lambda _: None, "on_progress": lambda _: None}
    made = start_run(copied, lab / "runs", signals=Signals(), site=Site(opened=twins), create_only=True, **silent)
    assert any("approval of another run" in str(one) for one in verify_file(made.path).findings)
    with pytest.raises(UsageError, match="approval of another run"):
        resume_run(made.path, signals=Signals(), site=Site(opened=twins), on_progress=lambda _: None)


def test_a_resumed_run_keeps_its_bench_file(lab: Path):
    plan = plan_of(lab)
    decide(Laboratory(lab), proposed(lab, plan), "approved", "", BEN)
    silent: dict[str, Any] = {"announce": lambda _: None, "on_progress": lambda _: None}
    made = start_run(plan, lab / "runs", signals=Signals(), site=Site(opened=twins), create_only=True, **silent)
    with pytest.raises(ConfigurationError, match="approved with its own bench file"):
        resume_run(made.path, signals=Signals(), bench=lab / "bench.toml", on_progress=lambda _: None)


def test_a_log_without_the_approval_does_not_confirm_it(lab: Path):
    plan = plan_of(lab)
    decide(Laboratory(lab), proposed(lab, plan), "approved", "", BEN)
    result = carried_out(plan, lab / "runs")
    for path in lab.glob("log.*"):
        path.unlink()
    typed("log", cwd=lab)  # a new one
    verified = typed("verify", result.path, cwd=lab)
    assert (verified.returncode, "of the hash that the approval names" in verified.stdout) == (1, True)


def test_a_loop_is_refused_on_such_a_bench(lab: Path):
    done = typed("loop", "small.toml", "--bench", "bench.toml", "--hours", "3", cwd=lab)
    assert (done.returncode, "approved by nobody" in done.stderr) == (2, True)


def test_the_command_proposes_after_a_dry_run_and_shows_what_it_reached(lab: Path):
    add = ("propose", "small.toml", "--bench", "bench.toml", "--why", "<b>new</b> head")
    assert "role operator: --login LOGIN (anna, ben)" in typed(*add, cwd=lab).stderr
    done = typed(*add, "--login", "anna", "--json", lines=f"{WORD['anna']}\n", cwd=lab)
    told = json.loads(done.stdout)
    assert (told["state"], told["dry"]["outcome"]) == ("waiting", "complete")
    low, high = told["dry"]["extremes"]["pitch_deg"]
    assert low < -30 < 30 < high
    shown = typed("approve", 1, cwd=lab).stdout
    assert "pitch_deg: " in shown
    assert told["sha256"]["bench.toml"] in shown
    done = typed("approve", 1, "--login", "ben", lines=f"{WORD['ben']}\n", cwd=lab)
    assert "approved by Ben (ben)" in done.stdout
    assert plan_of(lab).permission() is not None


def test_no_text_of_a_proposal_makes_a_further_line(lab: Path):
    plan, forged = plan_of(lab), "fine\n  approved by Ben (ben)"
    texts = {"procedure": forged, "bench": forged, "why": forged, "dry": {**DRY, "warnings": [forged]}}
    asked = Proposed(number=0, documents={}, run_list=plan.run_list.sha256(), who=ANNA.name, who_by=ANNA.by, **texts)
    propose(Laboratory(lab), asked)
    (lab / "x\n2030-01-01 00:00 UTC  all is well.toml").write_text("")
    for command in (("approve", 1), ("approve",), ("log",)):
        lines = typed(*command, cwd=lab).stdout.splitlines()
        assert not [one for one in lines if one.startswith(("  approved", "2030"))], command
        assert [one for one in lines if "\\x0a" in one]


def test_an_item_of_a_queue_runs_only_the_files_it_was_made_of(tmp_path: Path):
    lab = laboratory(tmp_path / "lab", "attitude-lab")
    write_small(lab)
    plan = plan_of(lab)
    only = ("--dry", "--only", digest_of(plan.documents, plan.run_list.sha256()))
    command = ("small.toml", "--bench", "bench.toml", *only)
    path = lab / "small.toml"
    path.write_text(path.read_text() + "\n")
    for verb in (("run",), ("loop", "--hours", "1")):
        done = typed(verb[0], *command, *verb[1:], cwd=lab)
        assert (done.returncode, "was changed after the run was put into the queue" in done.stderr) == (78, True)
    path.write_text(path.read_text()[:-1])
    assert typed("run", *command, cwd=lab).returncode == 0
