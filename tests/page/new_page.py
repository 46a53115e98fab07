"""From a laboratory without any file to a signed certificate, in a real Chromium: `make test-page`.

A technician answers the questions of `rig new` on a page, sees the plan change, writes the files, fills in register and
certificate settings, runs dry, answers the steps by hand, sees a fault, reads the report; an approver signs with the
password. Pictures of all pages are left in the folder that PAGE_PICTURES names.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from chromium import Page, chromium
from lab_people import WORD, with_people
from live_page import wait
from serve_page import FAULT, NOBODY, Visitor, served

from rig.lab import Laboratory

ANSWERS = {"name": "cell & <b>stand</b>", "quantity": "force", "levels": "0 5 10", "reads": "cell"}
CERTIFICATE = {"country": "GB", "item": "Load cell", "name": "F-1: comparison with weights"}


def answers(page: Page, key: str, value: str) -> None:
    """Type an answer, and leave the field."""
    field = f"document.querySelector('[name={json.dumps(key)}]')"
    page.until(f"!!{field}")
    page.ask(f"{field}.value = {json.dumps(value)}; {field}.dispatchEvent(new Event('change', {{ bubbles: true }}))")
    page.until("!document.getElementById('plan').classList.contains('old')", 60)


def filled(text: str) -> str:
    """A register with its statements taken in, and every gap filled."""
    text = "\n".join(
        line.removeprefix("# ") if re.match(r"# (\[|\w+ = )", line) else line for line in text.splitlines()
    )
    number = iter(range(1, 99))
    text = re.sub(r'^serial = ""', lambda _: f'serial = "S-{next(number)}"', text, flags=re.M)
    return re.sub(r'^(\w+) = ""', r'\1 = "some \1"', text, flags=re.M)


def changes(who: Visitor, file: str, old: str, new: str) -> None:
    who.goes(f"/act/edit?file={file}")
    text = str(who.page.ask("document.querySelector('textarea').value"))
    assert old in text
    value = json.dumps(text.replace(old, new))
    who.page.ask(f"document.querySelector('textarea').value = {value}")
    who.clicks("main button.go")
    assert "is changed" in who.text, who.text


def test_from_nothing_to_a_signed_certificate_without_a_terminal(tmp_path: Path) -> None:
    lab = with_people(tmp_path / "laboratory")
    with served(lab) as address, chromium(tmp_path / "profile") as page:
        anna = ben = Visitor(page, address)
        page.size(1400, 900)
        anna.logs_in("anna")
        assert "There is no bench here yet" in anna.text
        anna.looks("no-bench")
        anna.goes("/act/new")
        anna.looks("new")
        # --- questions, and a plan that follows them
        answers(page, "folder", "cell")
        for key, value in ANSWERS.items():
            answers(page, key, value)
        page.until("document.getElementById('plan').innerText.includes('15 points')", 60)
        answers(page, "levels", "0 five 10")
        assert "'five' is no number" in anna.text
        anna.looks("new-wrong")
        answers(page, "levels", "0 5 10")
        answers(page, "reads_with", "keysight-34401a")
        answers(page, "reads_at", "/dev/rig/dvm")
        answers(page, "replications", "2")
        page.until("document.getElementById('plan').innerText.includes('10 points')", 60)
        assert not list(lab.glob("*/*.toml"))  # nothing is written before it is agreed
        page.ask("document.querySelectorAll('#plan details')[1].open = true")
        assert "levels = [0, 5, 10]" in anna.text
        anna.looks("new-plan")
        anna.clicks("button[value=write]")
        assert "are written into cell" in anna.text
        assert (lab / "cell" / "bench.toml").is_file()
        (come,) = [one for one in Laboratory(lab).log().records if getattr(one.event, "file", "") == "cell/bench.toml"]
        assert come.sentence() == "cell/bench.toml came, by Anna (anna): rig new cell"
        # --- register, certificate settings and world, by hand; a wrong text is refused with its line
        anna.goes("/files")
        anna.looks("files")
        anna.goes("/act/edit?file=cell/equipment.toml")
        anna.looks("edit")
        text = filled(str(page.ask("document.querySelector('textarea').value")))
        page.ask(f"document.querySelector('textarea').value = {json.dumps(text.replace('k = 2', 'k = two', 1))}")
        anna.clicks("main button.go")
        assert "a text has quotes" in anna.text
        anna.looks("edit-wrong")
        page.ask(f"document.querySelector('textarea').value = {json.dumps(text)}")
        anna.clicks("main button.go")
        assert "is changed" in anna.text, anna.text
        for key, value in CERTIFICATE.items():
            changes(anna, "cell/certificate.toml", f'{key} = ""', f'{key} = "{value}"')
        changes(anna, "cell/world.toml", "seed = 1\n", f"seed = 1\n{NOBODY}{FAULT.replace('dvm', 'meter')}")
        # --- a dry night
        anna.goes("/")
        anna.clicks("a[href^='/act/dry-run']")
        anna.fills(procedure="cell/procedure.toml")
        anna.clicks("main button.go")
        anna.goes("/")
        page.until("!!document.querySelector('.benches a[href^=\"/run/\"]')", 60)
        run = str(page.ask("document.querySelector('.benches a[href^=\"/run/\"]').getAttribute('href')"))
        anna.goes(run)
        answered = steps(anna, run)
        assert answered >= 5
        assert "no reply" in page.ask("document.querySelector('#story').innerText").lower()
        anna.clicks('#acts a[href^="/act/report"]')
        anna.clicks("main button.go", 120)
        assert "is written" in anna.text, anna.text
        anna.clicks("main a.act")
        assert "cell over force" in page.ask("document.body.innerText")
        # --- the certificate, with the password of an approver
        anna.goes("/")
        anna.clicks("header .who button")
        ben.logs_in("ben")
        ben.goes(run)
        page.until("!!document.querySelector('#acts a[href^=\"/act/sign\"]')")
        ben.clicks('#acts a[href^="/act/sign"]')
        ben.looks("act-sign")
        ben.fills(password="not mine at all")
        ben.clicks("main button.go")
        assert "belong to nobody" in ben.text
        ben.fills(password=WORD["ben"])
        ben.clicks("main button.go", 120)
        assert "is issued" in ben.text, ben.text
        ben.goes("/results")
        ben.looks("results-signed")
        assert list((lab / "certificates").glob("SIM-CAL-*.pdf"))
        refused = ("a status of 409", "a status of 401")
        assert [one for one in page.complaints if not any(code in one for code in refused)] == []


def steps(who: Visitor, run: str) -> int:
    """Answer all steps by hand of a run; their number."""
    page, word = who.page, "document.getElementById('word')?.textContent"
    for number in range(60):
        page.until(f"!!document.querySelector('#acts a[href^=\"/act/done\"]') || {word} === 'complete'", 90)
        if page.ask(word) == "complete":
            return number
        who.clicks('#acts a[href^="/act/done"]')
        if page.ask("document.querySelector('[name=confirm]')?.value") != "yes":
            who.clicks("main button.go")
        who.clicks("main button.go")
        who.goes(run)
        wait(0.2)
    raise AssertionError("it never ends")
