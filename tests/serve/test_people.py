"""People of a laboratory, and the log of its changes."""

from __future__ import annotations

import json
import re
import stat
from pathlib import Path
from unittest.mock import patch

import apsw
import pytest
from lab_people import WORD, laboratory, typed

from rig.errors import StorageError
from rig.lab import Laboratory, by_token, laboratory_of
from rig.lab.people import parse_people
from rig.run_file.events.laboratory import FileChanged


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    return laboratory(tmp_path / "lab")


def test_no_password_is_in_any_file(lab: Path):
    for path in lab.iterdir():
        content = path.read_bytes()
        assert not any(word.encode() in content for word in WORD.values()), path
        assert path.name == "people.toml" or b"$argon2id$" not in content, path
    assert stat.S_IMODE((lab / "people.toml").stat().st_mode) == 0o600
    assert (lab / "people.toml").read_text().count("$argon2id$") == 4


def test_only_an_administrator_changes_people_once_there_is_one(lab: Path):
    add = ("person", "add", "carl", "--name", "Carl")
    assert typed(*add, lines="new password\n", cwd=lab).returncode == 2
    refused = typed(*add, "--login", "ben", lines="battery staple\nnew password\n", cwd=lab)
    assert "needs the role administrator" in refused.stderr
    refused = typed(*add, "--login", "olga", lines="wrong\nnew password\n", cwd=lab)
    assert (refused.returncode, "belong to nobody" in refused.stderr) == (2, True)
    assert typed(*add, "--login", "olga", lines="keeps the list\nnew password\n", cwd=lab).returncode == 0
    assert typed("person", "remove", "carl", "--login", "olga", lines="keeps the list\n", cwd=lab).returncode == 0
    assert "carl" not in json.loads(typed("person", "list", "--json", cwd=lab).stdout)


def test_everybody_changes_the_own_password(lab: Path):
    new = ("person", "password", "anna")
    assert typed(*new, "--login", "ben", lines="battery staple\nanother one\n", cwd=lab).returncode == 2
    assert typed(*new, "--login", "anna", lines="correct horse\nshort\n", cwd=lab).returncode == 2
    assert typed(*new, "--login", "anna", lines="correct horse\nanother one\n", cwd=lab).returncode == 0
    assert typed(*new, "--login", "anna", lines="correct horse\nthe third one\n", cwd=lab).returncode == 2


@pytest.mark.parametrize("login", ["Anna", "../anna", "a b", "", "<script>", "a" * 33])
def test_what_is_no_login_is_refused(login: str, lab: Path):
    done = typed(
        "person", "add", login, "--name", "X", "--login", "olga", lines="keeps the list\nxxxxxxxxxx\n", cwd=lab
    )
    assert (done.returncode, "is not a login" in done.stderr) == (2, True)


@pytest.mark.parametrize("name", ["two\nlines", " blank", "\x1b[31mred", "x" * 81])
def test_a_name_is_one_printable_line(name: str, lab: Path):
    add = ("person", "add", "carl", "--name", name, "--login", "olga")
    assert typed(*add, lines="keeps the list\nnew password\n", cwd=lab).returncode == 78


def test_an_unknown_role_changes_nothing(lab: Path):
    before = (lab / "people.toml").read_text()
    add = ("person", "add", "carl", "--name", "Carl", "--roles", "king", "--login", "olga")
    done = typed(*add, lines="keeps the list\nnew password\n", cwd=lab)
    assert (done.returncode, "new password" in done.stderr) == (78, False)
    assert (lab / "people.toml").read_text() == before


def test_a_program_has_a_token_that_no_file_has(lab: Path):
    add = ("person", "add", "planner", "--program", "--name", "Planner", "--login", "olga")
    token = typed(*add, lines="keeps the list\n", cwd=lab).stdout.strip()
    assert len(token) == 43
    assert token not in (lab / "people.toml").read_text()
    people = parse_people((lab / "people.toml").read_text(), "people.toml")
    assert (by_token(people, token) or ("",))[0] == "planner"
    assert by_token(people, token[:-1]) is by_token(people, "") is None


def test_the_log_says_who_when_what_before_what_after(lab: Path):
    text = (lab / "equipment.toml").read_text()
    typed("log", cwd=lab)
    (lab / "equipment.toml").write_text(text.replace('"B. Head"', '"C. Head"', 1))
    secrets = (
        'password = "very secret"',
        "url_env = 'very secret'",
        'x = { Token="very secret" }',
        'api-url="very secret"',
    )
    (lab / "notify.toml").write_text("\n".join(secrets) + '\nsecret = """\nvery secret\n"""\n')
    told = json.loads(typed("log", "--json", cwd=lab).stdout)["records"]
    changed = next(one for one in told if one["file"] == "equipment.toml" and one["before"])
    assert [line[0] for line in changed["lines"]] == ["-", "+"]
    assert "C. Head" in changed["lines"][1]
    assert "found by" in changed["says"]
    by_person = [one for one in told if one["file"] == "people.toml"]
    assert [one["why"] for one in by_person] == [f"rig person add {who}" for who in ("anna", "ben", "vera", "olga")]
    log = (lab / "log.sqlite").read_bytes() + (lab / "log.sqlite-wal").read_bytes()
    assert b"very secret" not in log
    shown = typed("log", cwd=lab)
    assert re.search(r"-.*B\. Head", shown.stdout)
    assert "chain unbroken" in shown.stdout


def test_a_log_that_was_changed_is_told(lab: Path):
    typed("log", cwd=lab)
    with apsw.Connection(str(lab / "log.sqlite")) as db:
        names = [row[0] for row in db.execute("SELECT name FROM sqlite_master WHERE type='trigger'")]
        for name in names:
            db.execute(f"DROP TRIGGER {name}")
        db.execute("UPDATE record SET body = replace(body, 'anna', 'emma')")
    done = typed("log", cwd=lab)
    assert (done.returncode, done.stdout) == (1, "")


@pytest.mark.parametrize("edited", [False, True])
def test_a_log_without_its_last_records_takes_no_further_ones(lab: Path, edited: bool):
    typed("log", cwd=lab)
    with apsw.Connection(str(lab / "log.sqlite")) as db:
        triggers = list(db.execute("SELECT name, sql FROM sqlite_master WHERE type='trigger'"))
        for name, _ in triggers:
            db.execute(f"DROP TRIGGER {name}")
        db.execute("DELETE FROM record WHERE seq > (SELECT max(seq) - 2 FROM record)")
        for _, sql in triggers:
            db.execute(sql)
    db.close()  # SQLite leaves no log of its own beside it
    if edited:
        (lab / "bench.toml").write_text((lab / "bench.toml").read_text() + "\n")
    for _ in range(2):
        done = typed("log", cwd=lab)
        assert (done.returncode, done.stdout, "log.head" in done.stderr) == (1, "", True)
    add = ("person", "password", "anna", "--login", "anna")
    done = typed(*add, lines="correct horse\nanother one\n", cwd=lab)
    assert (done.returncode, "from a backup" in done.stderr) == (1, True)
    for name in ("log.sqlite", "log.head"):
        (lab / name).rename(lab / f"kept.{name}")
    assert typed("log", cwd=lab).returncode == 0


def test_people_who_were_there_for_a_moment_only_are_in_the_log(lab: Path):
    path = lab / "people.toml"
    before = path.read_text()
    path.write_text(before.replace('"Ben"', '"Mallory"'))
    note = ("person", "password", "ben", "--login", "ben")
    assert typed(*note, lines="wrong\nanother one\n", cwd=lab).returncode == 2
    path.write_text(before)
    texts = [r.event.text for r in Laboratory(lab).log().records if isinstance(r.event, FileChanged)]
    assert [one for one in texts if "Mallory" in one]


def test_a_full_disk_stops_no_act_of_the_command_line(lab: Path):
    with patch("rig.lab.laboratory.Laboratory.note_changes", side_effect=StorageError("the disk is full")):
        done = typed("act", "pause", "--login", "anna", lines=f"{WORD['anna']}\n", cwd=lab)
    assert (done.returncode, done.stdout.strip()) == (0, "the queue is paused")


def test_too_many_files_hide_no_change_of_people(lab: Path):
    for number in range(500):
        (lab / f"a{number}.toml").write_text("")
    shown = typed("log", cwd=lab)
    beyond = len(list(lab.glob("*.toml"))) - 500
    assert f"{beyond} files *.toml are not in it" in shown.stderr
    (lab / "people.toml").write_text((lab / "people.toml").read_text() + "\n")
    assert "people.toml changed, by an editor" in typed("log", cwd=lab).stdout


def test_a_laboratory_is_the_nearest_folder_with_people(lab: Path):
    (lab / "runs").mkdir()
    assert laboratory_of(lab / "runs" / "x.sqlite") == laboratory_of(lab) == Laboratory(lab)
    assert laboratory_of(lab.parent) is None
    assert typed("log", cwd=lab.parent).returncode == 2


def test_a_change_by_somebody_else_is_found_and_not_told_as_ours(lab: Path):
    path = lab / "people.toml"
    path.write_text(path.read_text().replace('"Vera"', '"Mallory"'))
    new = ("person", "password", "anna", "--login", "anna")
    assert typed(*new, lines="correct horse\nanother one\n", cwd=lab).returncode == 0
    events = [r.event for r in Laboratory(lab).log().records if isinstance(r.event, FileChanged)]
    found, own = [one for one in events if one.file == "people.toml"][-2:]
    assert (found.why, "Mallory" in found.text) == ("", True)
    assert (own.why, own.who_by) == ("rig person password anna", "password")
