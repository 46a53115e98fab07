"""A dry night from its start to its certificate, through the server as a process: queue, run, report, signature."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import urllib.error
import urllib.request
from base64 import b64encode
from pathlib import Path
from typing import Any

import pytest
from lab_people import WORD, laboratory

from rig.drivers.clock import RealClock
from rig.run_file.events.by_hand import SetByHand
from rig.run_file.events.sessions import SessionBegan, Stopped
from rig.run_file.read.reader import RunReader
from rig.run_file.verify.verification import verify_file

SHORT = """
kind = "general"
name = "short"
seed = 1
replications = 3
[factors.force_kN]
levels = [0, 2, 5, 10]
order = "up-down"
[settle]
dwell_s = 5
[measure]
readings = 3
[model]
formula = "1 + force_kN + force_kN^2"
"""


class Client:
    """A program, or a person with a password."""

    def __init__(self, address: str, login: str) -> None:
        self._address = address
        self._basic = "Basic " + b64encode(f"{login}:{WORD[login]}".encode()).decode()

    def call(self, where: str, **fields: Any) -> Any:
        headers = {"authorization": self._basic, "content-type": "application/json"}
        body = json.dumps(fields).encode() if where.startswith("act/") else None
        asked = urllib.request.Request(f"{self._address}api/{where}", body, headers)
        try:
            with urllib.request.urlopen(asked, timeout=120) as answer:
                return json.loads(answer.read())
        except urllib.error.HTTPError as error:
            return {"status": error.code, **json.loads(error.read())}

    def until(self, where: str, holds: Any, seconds: float = 60.0) -> Any:
        clock = RealClock()
        end = clock.now() + seconds
        while not holds(found := self.call(where)):
            assert clock.now() < end, found
            clock.sleep(0.1)
        return found


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = laboratory(tmp_path / "lab")
    (folder / "procedure.toml").write_text(SHORT)
    for name in ("equipment.toml", "certificate.toml"):
        path = folder / name
        text = path.read_text().replace("B. Head", "Ben").replace('"A. Operator"', '"A. Operator", "Anna (anna)"', 1)
        path.write_text(text if name == "equipment.toml" else path.read_text().replace("B. Head", "Ben"))
    world = folder / "world.toml"
    plain = re.sub(r"^hidden.*\n|^\[lags(.|\n)*", "", world.read_text(), flags=re.MULTILINE)  # nothing to find
    world.write_text(plain + "[person]\ncomes = false\n")
    return folder


def test_a_night_without_a_terminal(lab: Path):
    command = [sys.executable, "-m", "rig", "serve", str(lab), "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        anna, ben = Client(address, "anna"), Client(address, "ben")
        files = {"procedure": "procedure.toml", "bench": "bench.toml"}
        assert anna.call("act/dry-run", **files)["item"] == 1
        benches = anna.until("benches", lambda found: found[0]["work"] and found[0]["work"][0]["word"] == "holding")
        run = benches[0]["work"][0]["name"]
        assert benches[0]["work"][0]["by"] == "Anna (anna)"
        asked = anna.call("act/done", run=run)
        assert (asked["status"], "put weights of 0 kN" in asked["confirm"]) == (428, True)
        assert anna.call("act/done", run=run, confirm=True)["said"] == "done: acknowledged"
        anna.until(f"runs/{run}", lambda found: found["state"]["done"] >= 1)
        assert anna.call("act/stop", run=run, confirm=True)["said"].startswith("stop: ")
        anna.until("queue", lambda found: found["items"][0]["state"] == "stopped")
        assert anna.call("act/resume", run=run, confirm=True)["item"] == 2
        for _ in range(40):
            found = anna.until(f"runs/{run}", _waits_or_ended)
            if found["state"]["ended"]:
                break
            anna.call("act/done", run=run, confirm=True)
        anna.until("queue", lambda found: {one["state"] for one in found["items"]} == {"stopped", "done"})
        path = next(lab.glob(f"runs/queue-1/{run}.sqlite"))
        assert anna.call("act/report", run=run)["said"] == f"reports/{run}.html is written"
        assert json.loads((lab / anna.call("act/calibrate", run=run)["file"]).read_text())
        assert "anna" in (lab / "reports" / f"{run}.html").read_text()
        assert anna.call("act/sign", run=run)["status"] == 403
        signed = ben.call("act/sign", run=run)
        assert "is issued" in signed.get("said", ""), signed
        assert (lab / "certificates" / f"{signed['certificate']}.pdf").exists()
        with RunReader.open(path) as reader:
            events = [record.event for record in reader.records()]
        sessions = [one for one in events if isinstance(one, SessionBegan)]
        assert [(one.operator, one.operator_by) for one in sessions] == [("Anna (anna)", "password")] * 2
        assert {one.who for one in events if isinstance(one, SetByHand | Stopped)} == {"Anna (anna)"}
        assert verify_file(path).whole
    finally:
        process.terminate()
        process.communicate(timeout=30)


def _waits_or_ended(found: Any) -> bool:
    state = found["state"]
    return bool(state["ended"]) or state["doing"].startswith("waits for a person")
