"""The server of a laboratory in a real Chromium: `make test-page`.

A technician without a terminal logs in, starts a dry night, answers its steps, sees its fault, reads its report; an
approver approves what the technician proposed. Pictures of all pages are left in the folder that PAGE_PICTURES names.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from chromium import Page, chromium
from lab_people import WORD, laboratory
from live_page import free_port, no_barriers, no_sideways, wait

PICTURES = Path(os.environ.get("PAGE_PICTURES", "/tmp/pictures"))
SHORT = """
kind = "general"
name = "<b>short</b> & sweet"
seed = 1
replications = 3
[factors.force_kN]
levels = [0, 5, 10]
order = "up-down"
[settle]
dwell_s = 5
[measure]
readings = 3
[model]
formula = "1 + force_kN"
"""
NOBODY = "\n[person]\ncomes = false\n"
FAULT = '\n[[faults]]\nkind = "no-reply"\non = "dvm"\nexchange = 60\ntimes = 12\n'


@contextmanager
def served(lab: Path) -> Iterator[str]:
    command = [sys.executable, "-m", "rig", "serve", str(lab), "--port", str(free_port())]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip().rstrip("/")
    finally:
        process.terminate()
        process.wait(15)
        process.stdout.close()


class Visitor:
    """A person at a browser."""

    def __init__(self, page: Page, address: str) -> None:
        self.page, self._address = page, address

    def goes(self, where: str) -> None:
        self.page.open(f"{self._address}{where}")

    def fills(self, **values: str) -> None:
        for name, value in values.items():
            self.page.ask(f"document.querySelector('main [name={name}]').value = {value!r}")

    def clicks(self, selector: str, seconds: float = 60.0) -> None:
        self.page.ask("window.before = 1")
        self.page.ask(f"document.querySelector({json.dumps(selector)}).click()")
        self.page.until("window.before === undefined && document.readyState === 'complete'", seconds)

    def logs_in(self, login: str) -> None:
        self.goes("/")
        self.fills(login=login, password=WORD[login])
        self.clicks("main button.go")
        assert self.page.ask("document.querySelector('h1').innerText") == "Benches"

    def looks(self, name: str) -> None:
        """Pictures in three widths, light and dark; nothing goes sideways."""
        for width, dark in ((390, False), (800, True), (1400, False)):
            self.page.size(width, 800, dark=dark)
            wait(0.3)
            no_sideways(self.page, width)
            no_barriers(self.page, f"{name} at {width}")
            self.page.picture(PICTURES / f"serve-{name}-{width}.png")

    @property
    def text(self) -> str:
        return str(self.page.ask("document.querySelector('main').innerText"))


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = laboratory(tmp_path / "laboratory")
    (folder / "procedure.toml").write_text(SHORT)
    world = folder / "world.toml"
    world.write_text(world.read_text().partition("[person]")[0] + NOBODY + FAULT)
    return folder


def test_a_technician_needs_no_terminal(lab: Path, tmp_path: Path) -> None:
    with served(lab) as address, chromium(tmp_path / "profile") as page:
        anna = Visitor(page, address)
        page.size(390, 800)
        anna.logs_in("anna")
        anna.looks("benches-free")
        anna.clicks("a[href^='/act/dry-run']")
        anna.fills(procedure="procedure.toml")
        anna.looks("act-dry-run")
        anna.clicks("main button.go")
        assert "was added" in anna.text
        anna.goes("/queue")
        wait(4)
        anna.goes("/")
        page.until("!!document.querySelector('.benches a[href^=\"/run/\"]')", 60)
        page.until("!!document.querySelector('.tasks')", 60)
        anna.looks("benches")
        anna.goes("/queue")
        anna.looks("queue")
        anna.goes("/")
        run = page.ask("document.querySelector('.benches a[href^=\"/run/\"]').getAttribute('href')")
        anna.goes(run)
        for number in range(40):
            page.until(
                "!!document.querySelector('#acts a[href^=\"/act/done\"]')"
                " || document.getElementById('word').textContent === 'complete'",
                60,
            )
            if page.ask("document.getElementById('word').textContent") == "complete":
                break
            if not number:
                anna.looks("run-waits")
            anna.clicks('#acts a[href^="/act/done"]')
            if page.ask("document.querySelector('[name=confirm]')?.value") != "yes":
                anna.clicks("main button.go")
            if not number:
                assert "This was done: put weights of" in anna.text
                anna.looks("act-done")
            anna.clicks("main button.go")
            anna.goes(run)
        page.until("document.getElementById('word').textContent === 'complete'", 60)
        assert "no reply" in page.ask("document.querySelector('#story').innerText").lower()
        anna.looks("run-complete")
        anna.clicks('#acts a[href^="/act/report"]')
        anna.clicks("main button.go", 120)
        assert "is written" in anna.text
        anna.clicks("main a.act")
        assert "short" in page.ask("document.body.innerText")
        page.picture(PICTURES / "serve-report.png")
        for where in ("runs", "results", "equipment", "log", "proposals"):
            anna.goes(f"/{where}")
            anna.looks(where)
        assert page.complaints == []


def test_two_keys_in_two_sessions(lab: Path, tmp_path: Path) -> None:
    bench, world = lab / "bench.toml", lab / "world.toml"
    bench.write_text("approval = true\n" + bench.read_text())
    world.write_text(world.read_text().partition("[person]")[0])
    with served(lab) as address, chromium(tmp_path / "profile") as page:
        anna = ben = Visitor(page, address)
        page.size(390, 800)
        anna.logs_in("anna")
        anna.clicks("a[href^='/act/propose']")
        anna.fills(procedure="procedure.toml", why="a <i>new</i> cell")
        anna.clicks("main button.go", 120)
        anna.clicks("main a.act")
        anna.looks("proposal")
        anna.goes("/act/start?proposal=1")
        anna.clicks("main button.go")
        assert "proposal 1 of exactly these files is waiting" in anna.text
        anna.clicks("header .who button")
        ben.logs_in("ben")
        assert "Proposal 1 waits for an approver" in ben.text
        ben.goes("/act/approve?proposal=1")
        ben.looks("act-approve")
        ben.fills(password="not mine at all")
        ben.clicks("main button.go")
        assert "belong to nobody" in ben.text
        ben.fills(password=WORD["ben"])
        ben.clicks("main button.go")
        ben.goes("/proposal/1")
        assert "Approved by Ben (ben)" in ben.text
        ben.looks("proposal-approved")
        ben.goes("/act/start?proposal=1")
        ben.looks("act-start-form")
        ben.clicks("main button.go")
        assert "they move" in ben.text
        ben.looks("act-start")
        page.ask("document.querySelector('main .buttons a').focus()")
        assert page.ask("document.activeElement.innerText") == "Cancel"
