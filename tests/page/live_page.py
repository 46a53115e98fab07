"""The live page in a real Chromium: `make test-page`.

A dry run goes to the middle and waits there; a server of its own serves the page; the page is opened wide and narrow,
light and dark, the run goes on, the server goes and comes back, the run ends. Pictures of it all are left in the folder
that PAGE_PICTURES names, or else in a temporary one. Not collected by `make test`, which does without a browser.
"""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from chromium import MISSING, Page, chromium, find

from rig.drivers.clock import RealClock
from rig.engine.session import Progress, Signals
from rig.examples import example
from rig.runs.controller import start_run
from rig.runs.plans import load_plan

pytestmark = [
    pytest.mark.skipif(find() is None, reason=MISSING),
    pytest.mark.timeout(240),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]
AXE = os.environ.get("AXE")
PICTURES = Path(os.environ.get("PAGE_PICTURES") or tempfile.mkdtemp(prefix="rig-page-"))
DONE = "document.getElementById('share').textContent"

SHORT = {
    "attitude-lab": '\nreplications = 2\n[design]\ntype = "D"\npitch_deg = [-90, -45, 0, 45, 90]\n'
    "roll_deg = [-120, 0, 120]\n"
    "[settle]\ndwell_s = 20\n[measure]\nreadings = 4\n[environment]\nsetpoint_degC = 23\ndwell_s = 60\n",
    "pressure-lab": '\n[design]\ntype = "list"\ntemperatures_degC = [[10, 20], [20, 10], [20, 30], [30, 20]]\n'
    "pressures_psia = [0.12, 0.5, 1.0, 2.5]\nrepeated_psia = [0.5]\n[soak]\ndwell_s = 120\ndrift_degC_per_h = 5\n"
    '[settle]\ndwell_s = 40\n[measure]\nreadings = 2\n[model]\nformula = "1 + P + P^2"\n',
}
KIND = {"attitude-lab": "pitch-roll", "pressure-lab": "whole-plot"}


class SlowRun:
    """A dry run in a thread, which waits at a point until it is let go on."""

    def __init__(self, lab: str, folder: Path, wait_at: int) -> None:
        procedure = folder / "short.toml"
        procedure.write_text(f'kind = "{KIND[lab]}"\nname = "<b>short</b> & sweet"\nseed = 5' + SHORT[lab])
        where = example(lab)
        self._plan = load_plan(procedure, where / "bench.toml", dry=True, world=where / "world.toml")
        self._folder, self.wait_at = folder, wait_at
        self._there, self.ended = threading.Event(), threading.Event()
        self._clock = RealClock()
        self.path = Path()
        self._calls = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        assert self._there.wait(60)

    def _run(self) -> None:
        start_run(self._plan, self._folder, signals=Signals(), announce=self._announce, on_progress=self._progress)
        self.ended.set()

    def _announce(self, path: Path) -> None:
        self.path = path

    def _progress(self, news: Progress) -> None:
        if news.done < self.wait_at or news.state != "settling":
            self._calls = 0
            return
        self._clock.sleep(0.3)
        self._calls += 1
        while self._calls >= 6 and news.done >= self.wait_at:  # by then there is something to show of the settling
            self._there.set()
            self._clock.sleep(0.2)


@contextmanager
def serving(where: Path, port: int, *options: str) -> Iterator[str]:
    """The page of a run in a process of its own; its address."""
    command = [sys.executable, "-m", "rig", "watch", str(where), "--port", str(port), *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.terminate()
        process.wait(15)
        process.stdout.close()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def no_sideways(page: Page, width: int) -> None:
    assert page.ask("document.documentElement.scrollWidth") <= width


def no_barriers(page: Page, where: str) -> None:
    """Nothing that axe-core finds, where AXE names its axe.min.js: a program of others, which we do not ship."""
    if AXE:
        page.ask(Path(AXE).read_text(encoding="utf-8") + "; 0")
        found = page.ask("axe.run().then(told => told.violations.map(v => v.id + ': ' + v.nodes[0].html))")
        assert found == [], f"{where}: {found}"


def wait(seconds: float) -> None:
    RealClock().sleep(seconds)


@pytest.mark.parametrize("lab", ["attitude-lab", "pressure-lab"])
def test_a_run_is_watched_from_the_middle_to_its_end(lab: str, tmp_path: Path) -> None:
    run = SlowRun(lab, tmp_path, 9)
    port = free_port()
    with chromium(tmp_path / "profile") as page:
        with serving(run.path, port) as address:
            page.size(1280, 900)
            page.open(address)
            page.until(f"{DONE}.startsWith('9 of ')")
            assert page.ask("document.getElementById('title').textContent") == "<b>short</b> & sweet"
            assert page.ask("document.querySelector('#simulated').hidden") is False
            page.until(
                "document.querySelectorAll('#residualcharts svg path').length >= 3 || "
                "document.getElementById('against').textContent.includes('model')"
            )
            page.until("document.querySelectorAll('#settlingcharts svg path').length >= 1")
            assert page.ask("document.querySelectorAll('#readings tbody tr').length") >= 4
            for width, dark in ((1280, False), (360, False), (320, True), (1280, True)):
                page.size(width, 800, dark=dark)
                wait(0.7)
                no_sideways(page, width)
                no_barriers(page, f"{lab} at {width}")
                page.picture(PICTURES / f"{lab}-{width}{'-dark' if dark else ''}.png")
            page.size(1280, 900)
            run.wait_at = 14
            page.until(f"{DONE}.startsWith('14 of ')")  # numbers change as records arrive
            lines = page.ask("document.querySelectorAll('#story li').length")
        page.until("!document.getElementById('lost').hidden", 30)
        page.picture(PICTURES / f"{lab}-lost.png")
        assert "lost its server" in page.ask("document.getElementById('lost').textContent")
        del page.complaints[:]  # that the server could not be reached
        run.wait_at = 10**9
        assert run.ended.wait(60)
        with serving(run.path, port):
            page.until("document.getElementById('lost').hidden", 30)
            page.until("document.getElementById('word').textContent === 'complete'")
            seqs = page.ask("document.querySelectorAll('#story li').length")
            assert seqs > lines  # told the rest, and nothing twice
            times = page.ask("[...document.querySelectorAll('#story li')].map(e => e.textContent)")
            assert len([t for t in times if re.search("session 1 began", t)]) == 1
            page.ask("document.querySelector('[data-show=matters]').focus()")
            page.key("Enter")
            page.until("document.getElementById('story').classList.contains('matters')")
            assert page.ask("document.getElementById('nothing').hidden") is False
            page.picture(PICTURES / f"{lab}-complete.png")
        assert [c for c in page.complaints if "ERR_CONNECTION_REFUSED" not in c and "ERR_" not in c] == []


def test_an_interrupted_run_says_how_to_carry_on_and_a_folder_lists_it(tmp_path: Path) -> None:
    lab = example("attitude-lab")
    procedure = tmp_path / "short.toml"
    procedure.write_text('kind = "pitch-roll"\nname = "cut off"\nseed = 5' + SHORT["attitude-lab"])
    command = [sys.executable, "-m", "rig", "run", str(procedure), "--bench", str(lab / "bench.toml"), "--dry"]
    subprocess.run([*command, "--out", str(tmp_path), "--kill-at-point", "12"], check=False, capture_output=True)
    with serving(tmp_path, 0, "--token", "a-long-token") as address, chromium(tmp_path / "profile") as page:
        page.size(360, 800)
        page.open(address.partition("?")[0])
        page.until("document.body.innerText.includes('token')")
        del page.complaints[:]  # that it was refused
        page.open(address)
        page.until("document.querySelectorAll('.runs li').length === 1")
        assert "token" not in page.ask("location.href")
        no_sideways(page, 360)
        no_barriers(page, "at 360")
        page.picture(PICTURES / "folder-360.png")
        (first,) = tmp_path.glob("*.sqlite")
        page.ask("document.querySelector('.runs a').focus()")
        shutil.copy(first, tmp_path / "another.sqlite")
        page.ask("again()")
        page.until("document.querySelectorAll('.runs li').length === 2")
        assert page.ask("document.activeElement.getAttribute('href')") == f"/run/{first.stem}"
        page.ask("document.activeElement.click()")
        page.until("document.getElementById('notrunning')?.hidden === false")
        assert "rig resume" in page.ask("document.getElementById('notrunning').textContent")
        page.until("document.querySelectorAll('#sessions tbody tr').length === 1")
        assert "killed" in page.ask("document.getElementById('sessions').textContent")
        wait(0.5)
        no_sideways(page, 360)
        no_barriers(page, "at 360")
        page.picture(PICTURES / "interrupted-360.png")
        page.size(1280, 900)
        wait(0.5)
        page.picture(PICTURES / "interrupted-1280.png")
        assert [c for c in page.complaints if "favicon" not in c] == []


def test_a_person_reads_the_task_does_it_and_the_run_goes_on(tmp_path: Path) -> None:
    where, files = example("load-cell-lab"), {}
    for name in ("procedure", "bench", "world"):
        files[name] = tmp_path / f"{name}.toml"
        files[name].write_text((where / f"{name}.toml").read_text().replace("[person]", "[person]\ncomes = false"))
    rig = [sys.executable, "-m", "rig"]
    command = [*rig, "run", str(files["procedure"]), "--bench", str(files["bench"]), "--dry"]
    command += ["--world", str(files["world"]), "--out", str(tmp_path / "runs")]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert run.stdout is not None
    path = run.stdout.readline().strip()
    doing = "(document.getElementById('doing')?.textContent ?? '')"
    try:
        with chromium(tmp_path / "profile") as page, serving(Path(path), free_port()) as address:
            page.size(1280, 900)
            page.open(address)
            for weights in (0, 1, 2):
                page.until(f"{doing}.includes('put weights of {weights} kN on the cell')", 60)
                assert page.ask("document.querySelector('#notrunning code').textContent") == f"rig done {path}"
                page.picture(PICTURES / f"person-{weights}.png")
                subprocess.run([*rig, "done", path], check=True, stdout=subprocess.DEVNULL)
            page.size(320, 800, dark=True)
            wait(0.7)
            no_sideways(page, 320)
            no_barriers(page, "at 320")
            page.picture(PICTURES / "person-320-dark.png")
            run.terminate()
            run.wait(30)
            page.until("document.querySelector('#notrunning code').textContent.startsWith('rig resume')", 30)
            assert page.complaints == []
    finally:
        run.kill()
        run.wait(15)
        run.stdout.close()
