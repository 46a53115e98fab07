"""First files and changes of files by page and API: the questions of `rig new`, shown first, then logged."""

from __future__ import annotations

import hashlib
import html
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from lab_people import QUICK, WORD, laboratory, typed, with_people
from test_server import Server, Visitor, logged_in

from rig.acts import Places, act_of, of_files
from rig.errors import ConfigurationError, RigError, UsageError
from rig.lab import Laboratory, people
from rig.new.files import NAMES, texts
from rig.new.questions import completed, due
from rig.who import Operator

ANNA = Operator("Anna (anna)", "password")
ANSWERS = {"quantity": "force", "levels": "0 5 10", "reads": "cell", "replications": "2"}


@pytest.fixture(autouse=True)
def quick() -> Iterator[None]:
    with patch.object(people, "COST", QUICK):
        yield


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return with_people(tmp_path_factory.mktemp("template") / "lab")


@pytest.fixture
def lab(template: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "lab"
    folder.mkdir()
    (folder / "people.toml").write_bytes((template / "people.toml").read_bytes())
    return folder


def does(lab: Path, act: str, **values: Any) -> Any:
    return act_of(act, values).carry_out(Places(Laboratory(lab)), ANNA)


def asked_by(page: str) -> dict[str, str]:
    """Inputs of the form, by name."""
    form = page.partition('id="questions"')[2].partition("</section>")[0]
    inputs = dict(re.findall(r'<input id="[^"]+" name="([^"]+)" value="([^"]*)"', form))
    for name, inner in re.findall(r'<select id="[^"]+" name="([^"]+)"[^>]*>(.*?)</select>', form):
        inputs[name] = re.findall(r'value="([^"]*)" selected', inner)[0]
    return {name: html.unescape(value) for name, value in inputs.items()}


def posted(who: Visitor, answers: Mapping[str, str], do: str = "plan", part: str = "questions", **more: str) -> Any:
    assumed = html.unescape(re.findall(r'name="assumed" value="([^"]*)"', who.gets("/act/new").text)[0])
    fields = {"csrf": who.csrf, "assumed": assumed, "do": do, "part": part, **answers, **more}
    return who.posts("/act/new", fields)


def test_the_form_asks_the_questions_of_the_terminal_in_their_order(lab: Path):
    anna = logged_in(Server(lab), "anna")
    shown = asked_by(anna.gets("/act/new").text)
    answers: dict[str, Any] = {}
    keys = []
    for question in due(answers):
        keys.append(question.key)
        answers[question.key] = question.check(question.default(answers), answers)
    assert list(dict.fromkeys(["folder", *keys])) == sorted(shown, key=["folder", *keys].index)
    assert shown["quantity"] == "force"


def test_what_nobody_changed_follows_the_earlier_answers(lab: Path):
    anna = logged_in(Server(lab), "anna")
    shown = asked_by(anna.gets("/act/new").text)
    again = asked_by(posted(anna, {**shown, "quantity": "pressure"}).text)
    assert (shown["sets_in"], again["sets_in"]) == ("kN", "bar")
    kept = asked_by(posted(anna, {**shown, "quantity": "pressure", "sets_in": "kPa"}).text)
    assert kept["sets_in"] == "kPa"


def test_a_wrong_answer_is_told_beside_it_and_no_other_one_is_lost(lab: Path):
    anna = logged_in(Server(lab), "anna")
    shown = asked_by(anna.gets("/act/new").text)
    answer = posted(anna, {**shown, "levels": "0 <b> 10", "dwell_s": "77"})
    assert "&lt;b&gt;&#39; is no number" in answer.text
    assert "<b>" not in answer.text.partition('id="w-levels"')[2][:200]
    assert '<input type="hidden" name="dwell_s" value="77">' in answer.text


def test_files_are_shown_then_written_and_the_log_says_by_whom(lab: Path):
    shown = does(lab, "new", folder="cell", answers=ANSWERS, show=True)
    assert not (lab / "cell").exists()
    assert shown.about["files"] == texts(completed(ANSWERS, "answers"))
    assert "10 points" in json.dumps(shown.about["plan"])
    with pytest.raises(UsageError, match="not the files that were shown"):
        does(lab, "new", folder="cell", answers={**ANSWERS, "replications": "3"}, sha256=shown.about["sha256"])
    assert not (lab / "cell").exists()
    does(lab, "new", folder="cell", answers=ANSWERS, sha256=shown.about["sha256"])
    assert {one.name for one in (lab / "cell").iterdir()} == set(NAMES)
    said = [one.sentence() for one in Laboratory(lab).log().records]
    assert {f"cell/{name} came, by Anna (anna): rig new cell" for name in NAMES} <= set(said)
    with pytest.raises(UsageError, match="there already"):
        does(lab, "new", folder="cell", answers=ANSWERS)


def test_the_page_writes_only_what_it_has_shown(lab: Path):
    anna = logged_in(Server(lab), "anna")
    shown = asked_by(anna.gets("/act/new").text) | ANSWERS
    plan = posted(anna, shown, part="", folder="cell")
    assert "10 points, 2 replication(s)" in plan.text
    digest = re.findall(r'name="sha256" value="([0-9a-f]{64})"', plan.text)[0]
    assert posted(anna, shown, do="write", part="", folder="cell").status == 409
    assert not (lab / "cell").exists()
    done = posted(anna, shown, do="write", part="", folder="cell", sha256=digest)
    assert (done.status, "are written into cell" in done.text) == (200, True)
    assert "2 replication" not in done.text
    assert (lab / "cell" / "bench.toml").is_file()


@pytest.mark.parametrize(
    "folder", ["..", "../other", "a/b", "/tmp/x", "runs", "certificates", ".hidden", "", "a" * 61, "a\nb", "link"]
)
def test_no_folder_is_made_elsewhere(folder: str, lab: Path, tmp_path: Path):
    (tmp_path / "outside").mkdir()
    (lab / "link").symlink_to(tmp_path / "outside")
    with pytest.raises(UsageError):
        does(lab, "new", folder=folder, answers=ANSWERS)
    assert not list((tmp_path / "outside").iterdir())
    assert sorted(one.name for one in tmp_path.iterdir()) == ["lab", "outside"]


@pytest.mark.parametrize(
    "answer",
    [
        {"sets_with": "/etc/passwd.toml"},
        {"sets_with": "../secret.toml"},
        {"reads_with": "~/secret.toml"},
        {"reads_with": "people.toml"},
        {"sets_with": "link.toml"},
        {"sets_options": {"eds": "/etc/passwd"}},
        {"sets_options": {"eds": "../../secret"}},
    ],
)
def test_no_answer_reads_a_file_from_elsewhere(answer: dict[str, Any], lab: Path, tmp_path: Path):
    (tmp_path / "secret.toml").write_text("scpi = true\nmaker = 'top secret'\n")
    (lab / "link.toml").symlink_to(tmp_path / "secret.toml")
    with pytest.raises(RigError) as found:
        does(lab, "new", folder="cell", answers={**ANSWERS, **answer}, show=True)
    assert "secret'" not in str(found.value).replace("'../../secret'", "")


def test_a_laboratory_with_two_keys_gets_no_bench_without_them(tmp_path: Path):
    lab = laboratory(tmp_path / "lab")
    bench = lab / "bench.toml"
    bench.write_text(f"approval = true\n{bench.read_text()}")
    shown = does(lab, "new", folder="cell", answers=ANSWERS, show=True)
    assert shown.about["files"]["bench.toml"].startswith("approval = true\n")
    text = bench.read_text()
    with pytest.raises(UsageError, match="needs two keys"):
        does(lab, "edit", file="bench.toml", text=text.replace("approval = true\n", ""), before=_hash(text))
    assert bench.read_text() == text


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def test_a_file_is_changed_once_and_the_log_has_who_and_what(tmp_path: Path):
    lab = laboratory(tmp_path / "lab")
    old = (lab / "certificate.toml").read_text()
    new = old.replace('country = "GB"', 'country = "SE"')
    does(lab, "edit", file="certificate.toml", text=new.replace("\n", "\r\n"), before=_hash(old))
    assert (lab / "certificate.toml").read_text() == new
    last = Laboratory(lab).log().records[-1]
    assert last.sentence() == "certificate.toml changed, by Anna (anna): rig act edit file=certificate.toml"
    with pytest.raises(UsageError, match="somebody changed"):
        does(lab, "edit", file="certificate.toml", text=old, before=_hash(old))


@pytest.mark.parametrize(
    ("file", "old", "new", "why"),
    [
        ("people.toml", "", "", "no settings file"),
        ("../outside.toml", "", "", "no settings file"),
        ("link.toml", "", "", "no settings file"),
        ("bench.toml", 'driver = "person"', 'driver = "persom"', "persom"),
        ("bench.toml", 'driver = "person"', 'driver = "../../x.toml"', "leads out of"),
        ("certificate.toml", 'country = "GB"', 'country = "Great"', "two capital letters"),
        ("certificate.toml", 'country = "GB"', 'country = "GB"\ntemplate = "/etc/passwd"', "leads out of"),
        ("equipment.toml", "[equipment.W-10]", "[equipment.W-10", "line 14"),
        ("equipment.toml", "name =", "kind = 'general'\nname =", "of another sort"),
        ("procedure.toml", 'kind = "general"', 'kind = "generel"', "generel"),
    ],
)
def test_no_wrong_text_is_written(file: str, old: str, new: str, why: str, tmp_path: Path):
    lab = laboratory(tmp_path / "lab")
    (tmp_path / "outside.toml").write_text("x = 1\n")
    (lab / "link.toml").symlink_to(tmp_path / "outside.toml")
    text = (lab / file).read_text()
    with pytest.raises((UsageError, ConfigurationError), match=why):
        does(lab, "edit", file=file, text=text.replace(old, new, 1) or "x = 2", before=_hash(text))
    assert (lab / file).read_text() == text


def test_a_command_that_begins_with_a_slash_is_no_path(tmp_path: Path):
    lab = laboratory(tmp_path / "lab")
    old = (lab / "bench.toml").read_text()
    does(lab, "edit", file="bench.toml", text=old.replace("[limits]", "# /1ZR\n[limits]"), before=_hash(old))
    of_files._inside({"fetch": "/1ZR", "address": "/dev/ttyUSB0", "set": "POS {value}\r"})
    for text in ("/etc/passwd", "/", "~/x", "a/../../b", "..\\b"):
        with pytest.raises(UsageError, match="leads out of"):
            of_files._inside({"points": [text]})


def test_a_file_with_a_secret_is_neither_shown_nor_changed(tmp_path: Path):
    lab = laboratory(tmp_path / "lab")
    text = 'api_key = "very secret"\n'
    (lab / "other.toml").write_text(text)
    page = logged_in(Server(lab), "anna").gets("/act/edit?file=other.toml")
    assert "very secret" not in page.text
    with pytest.raises(UsageError, match="may have secrets"):
        does(lab, "edit", file="other.toml", text="x = 1", before=_hash(text))


def test_a_viewer_writes_nothing(lab: Path):
    vera = logged_in(Server(lab), "vera")
    shown = asked_by(vera.gets("/act/new").text) | ANSWERS
    assert "needs the role operator" in posted(vera, shown, do="write", part="", folder="cell").text
    assert not (lab / "cell").exists()


def test_command_line_has_the_same_acts(lab: Path):
    word = f"{WORD['anna']}\n"
    given = ("folder=cell", f"answers={json.dumps(ANSWERS)}")
    done = typed("act", "new", *given, "--login", "anna", lines=word, cwd=lab)
    assert (done.returncode, "are written into cell" in done.stdout) == (0, True), done.stderr
    assert typed("act", "ports", "--login", "anna", lines=word, cwd=lab).returncode == 0
    assert of_files.New.name in typed("act", cwd=lab).stdout
