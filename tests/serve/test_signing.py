"""Acts of people are in what they acted on: a certificate's approval, the end of a hold."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lab_people import laboratory, typed
from small_run import write_small

from rig.drivers.clock import RealClock
from rig.engine.session import Progress, Signals
from rig.examples import example
from rig.run_file.events.event import Event
from rig.run_file.events.sessions import Held, Stopped
from rig.run_file.live import live_path, read_json, request_path, send_request
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.verification import verify_file
from rig.runs.controller import start_run
from rig.runs.plans import load_plan
from rig.verbs.certificate.seals import hash_of


@pytest.fixture(scope="module")
def signed_lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A laboratory whose register has ben as approver, with a dry run."""
    lab = laboratory(tmp_path_factory.mktemp("lab"))
    for name in ("equipment.toml", "certificate.toml"):
        path = lab / name
        path.write_text(path.read_text().replace("B. Head", "Ben"))
    run = ("run", "procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml")
    done = typed(*run, cwd=lab)
    assert done.returncode == 0, done.stderr
    return lab


@pytest.mark.parametrize(
    ("login", "lines", "why"),
    [
        ((), "", "role approver: --login LOGIN (ben)"),
        (("--login", "anna"), "correct horse\n", "needs the role approver"),
        (("--login", "ben"), "correct horse\n", "belong to nobody"),
        (("--login", "ben"), "", "standard input has no line"),
        (("--login", "ben", "--approved-by", "Anna"), "battery staple\n", "Ben signs it"),
    ],
)
def test_nobody_signs_for_somebody_else(login: tuple[str, ...], lines: str, why: str, signed_lab: Path):
    run = next((signed_lab / "runs").glob("*.sqlite"))
    done = typed("certificate", run, "--out", "refused", *login, lines=lines, cwd=signed_lab)
    assert (done.returncode, why in done.stderr) == (2, True), done.stderr
    assert not (signed_lab / "refused").exists()


def test_an_approver_signs_with_the_password_and_the_log_has_the_files(signed_lab: Path):
    run = next((signed_lab / "runs").glob("*.sqlite"))
    command = ("certificate", run, "--out", "signed", "--login", "ben", "--json")
    done = typed(*command, lines="battery staple\n", cwd=signed_lab)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert "Ben" in json.dumps(told)
    events = json.loads(typed("log", "--json", cwd=signed_lab).stdout)["records"]
    (event,) = [one for one in events if one["status"] == "signed"]
    assert (event["who"], event["who_by"]) == ("Ben (ben)", "password")
    assert event["files"] == {Path(path).name: hash_of(signed_lab / path) for path in told["files"].values()}
    assert verify_file(signed_lab / "log.sqlite").whole


@pytest.mark.parametrize(("verb", "sort"), [("hold", Held), ("stop", Stopped)])
def test_a_run_has_who_held_or_stopped_it(verb: str, sort: type[Event], tmp_path: Path):
    lab = example("attitude-lab")
    plan = load_plan(write_small(tmp_path), lab / "bench.toml", dry=True)
    path: list[Path] = []
    signals, clock = Signals(), RealClock()

    def progress(news: Progress) -> None:
        if news.done == 3 and not request_path(path[0]).exists():
            clock.sleep(0.11)  # requests are looked for ten times a second
            if (read_json(live_path(path[0])) or {}).get("acknowledged"):
                signals.interrupt = "SIGTERM"
            else:
                send_request(path[0], verb, who="Anna (anna)")

    start_run(plan, tmp_path, signals=signals, announce=path.append, on_progress=progress)
    with RunReader.open(path[0]) as reader:
        events = [record.event for record in reader.records()]
    found = [one for one in events if isinstance(one, sort)]
    assert [one.who for one in found] == ["Anna (anna)"]
    assert verify_file(path[0]).whole
