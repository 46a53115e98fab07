"""`--login` at a terminal: the records say who did it as honestly as those of a page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import pytest
from lab_people import QUICK, WORD, laboratory, typed
from small_run import write_small

from rig.cli.signed_in import acting
from rig.errors import UsageError
from rig.lab import people
from rig.run_file.events.sessions import SessionBegan
from rig.run_file.read.reader import RunReader

RUN = ("run", "small.toml", "--bench", "bench.toml", "--dry")


@pytest.fixture(autouse=True)
def quick() -> Iterator[None]:
    with patch.object(people, "COST", QUICK):
        yield


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with patch.object(people, "COST", QUICK):
        folder = laboratory(tmp_path_factory.mktemp("laboratory") / "lab", "attitude-lab")
    write_small(folder)
    return folder


def test_a_run_has_who_proved_to_be_the_operator(lab: Path):
    done = typed(*RUN, "--login", "anna", lines=f"{WORD['anna']}\n", cwd=lab)
    assert done.returncode == 0, done.stderr
    with RunReader.open(next((lab / "runs").glob("*.sqlite"))) as reader:
        (began,) = [one.event for one in reader.records() if isinstance(one.event, SessionBegan)]
    assert (began.operator, began.operator_by) == ("Anna (anna)", "password")


@pytest.mark.parametrize(
    ("options", "lines", "why"),
    [
        (("--login", "anna"), "wrong one\n", "belong to nobody"),
        (("--login", "vera"), "only looking\n", "needs the role operator"),
        (("--operator", "Ben (ben)"), "", "--login ben proves it"),
    ],
)
def test_no_run_has_the_name_of_somebody_else(options: tuple[str, ...], lines: str, why: str, lab: Path):
    before = list((lab / "runs").glob("*")) if (lab / "runs").exists() else []
    done = typed(*RUN, *options, lines=lines, cwd=lab)
    assert (done.returncode, why in done.stderr) == (2, True), done.stderr
    assert (list((lab / "runs").glob("*")) if (lab / "runs").exists() else []) == before


def test_a_stop_asks_for_no_password_and_claims_no_name(lab: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("RIG_OPERATOR", "Ben (ben)")
    run = lab / "runs" / "any.sqlite"
    assert acting(run, None, refuses=False).name == "Ben (ben), not proven"
    with pytest.raises(UsageError, match="--login ben proves it"):
        acting(run, None)
    assert acting(run, None, "night shift").name == "night shift"
    monkeypatch.setenv("RIG_OPERATOR_BY", "password")  # as the queue of a server gives it
    assert acting(run, None).name == "Ben (ben)"


def test_outside_of_a_laboratory_there_is_nobody_to_log_in(tmp_path: Path):
    assert acting(tmp_path / "x.sqlite", None, "Ben (ben)").name == "Ben (ben)"
    with pytest.raises(UsageError, match="in no laboratory with people"):
        acting(tmp_path / "x.sqlite", "ben")
