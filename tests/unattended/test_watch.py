"""The live page: what it serves, to whom, and what it says of a run."""

from __future__ import annotations

import itertools
import json
import re
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path
from unittest.mock import patch
from urllib.parse import quote

import anyio.lowlevel
import pytest
from asgi import Answer, ask
from command import rig
from dry import dry
from ideal_bench import PROCEDURE, new_run, run_session

from rig.by_kind import fit_table
from rig.drivers.clock import RealClock
from rig.engine.settling import Criteria, Settling
from rig.procedures.plan.run_list import Factor, Point, RunList
from rig.run_file import live as live_module
from rig.run_file.chain import Record, encode
from rig.run_file.live import live_path, replace_json
from rig.run_file.write.creation import Genesis, create
from rig.run_file.write.writer import RunWriter
from rig.runs.previous import read_previous
from rig.tables import read_table
from rig.watch import Access, Shelf, make_app
from rig.watch.feed import KEPT, RECENT, RunFeed, Sample, encoded, said
from rig.watch.reading import WatchReader
from rig.watch.server import only_this_machine
from rig.watch.shelf import Entry

HOSTILE = "<script>alert(1)</script>\"'&"


class Ticks:
    """A stopwatch on which every look takes a second, so that nothing is put off."""

    def __init__(self) -> None:
        self._count = itertools.count()

    def __call__(self) -> float:
        return float(next(self._count)) * 10.0


def shelf_of(where: Path, reference=None) -> Shelf:
    return Shelf(where, reference, Ticks(), RealClock().utc)


def app_of(where: Path, *, access: Access | None = None, meanwhile=lambda: None, reference=None, streams: int = 60):
    async def pause(_seconds: float) -> None:
        meanwhile()
        await anyio.lowlevel.checkpoint()

    return make_app(shelf_of(where, reference), access or Access(), pause, streams=streams)


def observation(x: float, sd: float = 1e-5) -> str:
    readings = [x - sd, x, x + sd]
    outputs = {"x_V": {"mean": x, "sd": sd, "readings": readings}}
    temperatures = {"sensor_temperature_degC": {"mean": 23.0, "sd": 0.0, "readings": [23.0]}}
    return encode({"outputs": outputs, "temperatures": temperatures, "environment": {}, "flags": []})


def small_run(folder: Path, name: str = "a", *, points: int = 40, procedure: str = "night") -> Path:
    factors = (Factor("pitch_deg", "pitch"), Factor("roll_deg", "roll"))
    listed = tuple(Point(i, 1, None, (float(i % 20) - 10, float(i % 7) * 30), (1, 1)) for i in range(points))
    path = folder / f"{name}.sqlite"
    about = {"procedure": procedure, "bench": "bench", "software": {}, "dry": True}
    run_list = RunList(factors, listed, 0)
    create(path, Genesis(name, {"procedure.toml": ""}, run_list, True, about), elapsed_s=0.0, utc_s=1e9)
    return path


SESSION = {
    "pid": 1, "host": "h", "boot": "b", "gap_s": 0.0, "gap_certain": True, "wal_commits_lost": 0, "wal_damage": "",
    "clock_s": 0.0, "elapsed_s": 0.0,
}  # fmt: skip


def write(run: RunWriter, index: int, x: float = 0.1) -> None:
    run.append(Record(1, "observation", 10.0 * index, 1e9 + 10 * index, index, None, 1, "accepted", observation(x)))


def news(answer: Answer) -> dict[str, object]:
    """The sections as they stand after all events."""
    found: dict[str, object] = {}
    for _, event, data in answer.events():
        if event == "news":
            found |= data
    return found


def first(app, name: str = "a", **options) -> Answer:
    return ask(app, f"/run/{name}/events", until=lambda a: bool(a.events()), **options)


# --- who may look ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS"])
def test_the_page_can_only_be_looked_at(tmp_path, method):
    app = app_of(small_run(tmp_path))
    assert ask(app, "/run/a", method=method).status == 405


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:8321", 200), ("localhost:8321", 200), ("[::1]:8321", 200), ("192.0.2.7", 200), ("bench-pc", 200),
        ("evil.example", 421), ("localhost.evil.example:8321", 421), ("127.0.0.1.evil.example", 421), ("", 421),
        ("[::1].evil.example", 421), ("[::1", 421), ("[::1]:80.evil.example", 421), ("::1", 200),
    ],
)  # fmt: skip
def test_a_name_that_is_not_ours_is_refused_so_that_no_other_site_can_read_the_page(tmp_path, host, status):
    app = app_of(small_run(tmp_path), access=Access(names=frozenset({"bench-pc"})))
    assert ask(app, "/run/a", host=host).status == status


def test_a_token_is_given_once_and_kept_in_a_cookie(tmp_path):
    app = app_of(small_run(tmp_path), access=Access(token="correct horse"))
    assert ask(app, "/run/a").status == 401
    assert ask(app, "/run/a/events").status == 401
    assert ask(app, "/run/a/state.json?token=correct").status == 401
    assert ask(app, "/run/a", headers={"cookie": "rig_watch=wrong"}).status == 401
    let_in = ask(app, "/run/a?token=correct+horse&x=1")
    assert let_in.status == 303
    assert let_in.headers["location"] == "/run/a?x=1"
    cookie = let_in.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "samesite=strict" in cookie.lower()
    assert ask(app, "/run/a", headers={"cookie": cookie.partition(";")[0]}).status == 200


def test_any_token_that_is_taken_opens_the_page(tmp_path):
    token = "".join(map(chr, range(32, 127)))
    app = app_of(small_run(tmp_path), access=Access(token=token))
    let_in = ask(app, f"/?token={quote(token)}")
    assert (
        ask(app, "/run/a", headers={"cookie": let_in.headers["set-cookie"].rpartition("; HttpOnly")[0]}).status == 200
    )


@pytest.mark.parametrize("token", ["пароль1234", "12345678\xff", "12345678\n", "12345678\udcff"])
def test_a_token_that_no_header_takes_is_refused(tmp_path, token):
    done = rig("watch", small_run(tmp_path), "--port", 0, "--token", token)
    assert (done.returncode, "--token: it becomes part of an address and a header: plain ASCII" in done.stderr) == (
        2,
        True,
    )


@pytest.mark.parametrize("path", ["//evil.example/", "/\\evil.example"])
def test_the_token_leads_nowhere_else(tmp_path, path):
    app = app_of(small_run(tmp_path), access=Access(token="secret-token"))
    leads = ask(app, f"http://x{path}?token=secret-token").headers["location"]
    assert re.match(r"/[^/\\]", leads)


def test_headers_keep_scripts_of_others_and_other_sites_out(tmp_path):
    app = app_of(small_run(tmp_path))
    for path in ("/run/a", "/nothing", "/static/watch.js"):
        headers = ask(app, path, headers={"origin": "http://evil.example"}).headers
        assert "script-src 'self'" in headers["content-security-policy"]
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert not [name for name in headers if name.startswith("access-control")]


@pytest.mark.parametrize(
    ("host", "alone"), [("127.0.0.1", True), ("::1", True), ("localhost", True), ("0.0.0.0", False)]
)
def test_which_addresses_need_a_token(host, alone):
    assert only_this_machine(host) is alone


def test_the_command_says_what_is_wrong(tmp_path):
    assert "there is no run file" in rig("watch", tmp_path / "none.sqlite").stderr
    short = rig("watch", tmp_path, "--token", "abc")
    assert short.returncode == 2
    assert "easily guessed" in short.stderr
    (tmp_path / "x.sqlite").write_text("nothing")
    assert "not a run file" in rig("watch", tmp_path / "x.sqlite").stderr


# --- what it serves --------------------------------------------------------------------------------------------


def test_a_single_run_is_where_the_address_leads(tmp_path):
    app = app_of(small_run(tmp_path))
    assert ask(app, "/").headers["location"] == "/run/a"
    page = ask(app, "/run/a").text
    assert 'data-name="a"' in page
    assert "Standard deviations and residuals on this page are repeatability only" in page


@pytest.mark.parametrize("name", ["night#2", "a?b", "50%41", "a b&c=d", "\udcff", "é"])
def test_a_run_is_found_whatever_its_name(tmp_path, name):
    path = tmp_path / f"{name}.sqlite"
    small_run(tmp_path).rename(path)
    location = ask(app_of(path), "/").headers["location"]
    assert ask(app_of(path), location).status == 200
    listed = ask(app_of(tmp_path), "/")
    assert listed.status == 200
    (link,) = re.findall('href="(/run/[^"]*)"', listed.text)
    assert link == location
    app = app_of(tmp_path, access=Access(token="12345678"))
    assert ask(app, f"{link}?token=12345678").headers["location"] == link


def test_one_bad_name_does_not_take_the_list_away(tmp_path):
    small_run(tmp_path, "good")
    small_run(tmp_path).rename(tmp_path / "\udcff.sqlite")
    (tmp_path / "\udcfe.sqlite").write_text("nothing")
    listed = ask(app_of(tmp_path), "/")
    assert listed.status == 200
    for name in ("/run/good", "/run/%5Cxff", "/run/%5Cxfe"):
        assert f'href="{name}"' in listed.text


def test_half_a_character_in_a_run_does_not_take_the_list_away(tmp_path):
    entry = Entry("a", procedure="\ud800 night")
    with patch.object(Shelf, "entries", lambda _: [entry]):
        listed = ask(app_of(tmp_path), "/")
    assert (listed.status, "\\ud800 night" in listed.text) == (200, True)


def test_nothing_in_the_pages_comes_from_elsewhere():
    package = Path(live_module.__file__).parents[1] / "watch"
    for file in (*(package / "static").iterdir(), *(package / "templates").iterdir()):
        text = file.read_text().replace("http://www.w3.org/2000/svg", "")
        assert "://" not in text, file.name
        assert "innerHTML" not in text, file.name
        assert not re.search(r"<script>|\son\w+=|style=", text), file.name


def test_the_page_knows_nothing_of_drivers_and_simulation():
    package = Path(live_module.__file__).parents[1] / "watch"
    for file in package.glob("*.py"):
        assert not re.search(r"(from|import) (drivers|sims)\b", file.read_text()), file.name


def test_names_from_files_are_escaped(tmp_path):
    small_run(tmp_path, 'a"><b>', procedure=HOSTILE)
    (tmp_path / "broken.sqlite").write_text("nothing")
    app = app_of(tmp_path)
    listed = ask(app, "/").text
    assert "<script>alert" not in listed
    assert '"><b>' not in listed
    assert "&lt;script&gt;" in listed
    assert "not a run file" in listed
    page = ask(app, "/run/a%22%3E%3Cb%3E".replace("%22", '"').replace("%3E", ">").replace("%3C", "<")).text
    assert '"><b>' not in page


@pytest.mark.parametrize("path", ["/run/nobody", "/run/../a", "/run/..%2fa", "/static/watch.py", "/static/../app.py"])
def test_only_what_is_there_is_found(tmp_path, path):
    small_run(tmp_path)
    assert ask(app_of(tmp_path), path).status == 404


def test_a_link_to_a_folder_is_no_run(tmp_path):
    (tmp_path / "root.sqlite").symlink_to("/")
    assert [entry.name for entry in Shelf(tmp_path, None, lambda: 0.0, lambda: 2e9).entries()] == ["root"]


def test_a_folder_lists_its_runs_the_newest_first(tmp_path):
    for name in ("20260101T180000-b", "20260102T180000-a"):
        with RunWriter.open(small_run(tmp_path, name)) as run:
            write(run, 0)
    entries = shelf_of(tmp_path).entries()
    assert [entry.name for entry in entries] == ["20260102T180000-a", "20260101T180000-b"]
    assert [(entry.done, entry.points, entry.state) for entry in entries] == [(1, 40, "not running")] * 2


# --- the stream ------------------------------------------------------------------------------------------------


def test_the_stream_tells_everything_first_and_then_what_changes(tmp_path):
    path = small_run(tmp_path)
    with RunWriter.open(path) as run:
        run.append(Record(1, "session", 0.0, 1e9, body=encode(SESSION)))
        step = itertools.count()

        def meanwhile() -> None:
            write(run, next(step))

        answer = ask(app_of(path, meanwhile=meanwhile), "/run/a/events", until=lambda a: len(a.events()) >= 4)
    events = answer.events()
    assert answer.headers["content-type"].startswith("text/event-stream")
    assert set(events[0][2]) >= {"about", "state", "sessions", "story", "charts"}
    assert [data["state"]["done"] for _, _, data in events if "state" in data] == [0, 1, 2, 3]
    assert "about" not in events[1][2]
    readings = events[3][2]["readings"]
    assert readings["rows"][0]["name"] == "x_V"
    assert [(one["what"], one["unit"]) for one in readings["setpoints"]] == [("pitch", "deg"), ("roll", "deg")]
    assert [int(number) for number, _, _ in events] == [2, 3, 4, 5]


def test_a_page_that_was_cut_off_is_told_only_what_it_missed_by_any_server(tmp_path):
    path = small_run(tmp_path)
    with RunWriter.open(path) as run:
        run.append(Record(1, "session", 0.0, 1e9, body=encode(SESSION)))
        run.append(Record(1, "event", 1.0, 1e9, status="homed"))
        before = first(app_of(path))
        run.append(Record(1, "hold", 2.0, 1e9, body=encode({"why": "asked for"})))
        run.append(Record(1, "release", 3.0, 1e9))
        after = first(app_of(path), headers={"last-event-id": before.events()[-1][0]})
    assert before.story() == [1, 2, 3]
    assert after.story() == [4, 5]
    assert "state" in news(after)


@pytest.mark.parametrize("given", ["", "-1", "x", "9" * 40, "٣"])
def test_an_id_that_is_none_starts_from_the_beginning(tmp_path, given):
    headers = {"last-event-id": given.encode("utf-8").decode("latin-1")}
    assert first(app_of(small_run(tmp_path)), headers=headers).story() == [1]


def test_a_quiet_run_is_heard_of_all_the_same(tmp_path):
    answer = ask(app_of(small_run(tmp_path)), "/run/a/events", until=lambda a: "beat" in a.text)
    assert [event for _, event, _ in answer.events()] == ["news", "beat"]


def test_so_many_pages_and_no_more(tmp_path):
    assert ask(app_of(small_run(tmp_path), streams=0), "/run/a/events").status == 503


# --- what it says ----------------------------------------------------------------------------------------------


def test_it_says_plainly_that_no_controller_is_running(tmp_path):
    path = small_run(tmp_path)
    with RunWriter.open(path) as run:
        run.append(Record(1, "session", 0.0, 1e9, body=encode(SESSION)))
    state = news(first(app_of(path)))["state"]
    assert state["running"] is False
    assert state["doing"] == "interrupted"
    assert state["todo"] == f"rig resume {path}"


def test_a_running_controller_is_quoted_whatever_it_says(tmp_path):
    path = small_run(tmp_path)
    with RunWriter.open(path):
        samples = [[-1.0, 20.1], [0.0, 20.0001]]
        pitch = {"by": "head", "target": 20.0, "band": 5e-4, "outcome": "waiting", "for_s": 90.0, "samples": samples}
        replace_json(
            live_path(path),
            {"state": "settling", "elapsed_s": 5.0, "remaining_s": 60.0, "utc_s": 1e9, "settling": {"pitch": pitch}},
        )
        said = news(first(app_of(path)))
        assert said["state"]["running"]
        assert said["state"]["end_utc_s"] == 1e9 + 60
        assert said["settling"] == [{"name": "pitch", "unit": "deg", **pitch}]
        for strange in (
            {"state": ["x"], "elapsed_s": "soon", "remaining_s": {}, "settling": [1]},
            {"state": HOSTILE, "settling": {"pitch": {"samples": [[1]]}, "roll": 3}, "message": {"a": 1}},
        ):
            replace_json(live_path(path), strange)
            state = news(first(app_of(path)))["state"]
            assert state["remaining_s"] is None


def test_a_record_that_makes_no_sense_is_said_and_the_page_stays(tmp_path):
    path = small_run(tmp_path)
    with RunWriter.open(path) as run:
        run.append(Record(1, "event", 1.0, 1e9, status="whole-plot", body="[]"))
    assert "record 2" in news(first(app_of(path)))["state"]["error"]


def test_looking_writes_nothing(tmp_path):
    path = small_run(tmp_path)
    with RunWriter.open(path) as run:
        write(run, 0)
        before = {p.name: p.read_bytes() for p in tmp_path.iterdir() if not p.name.endswith("-shm")}
        ask(app_of(tmp_path), "/")
        first(app_of(path))
        after = {p.name: p.read_bytes() for p in tmp_path.iterdir() if not p.name.endswith("-shm")}
    assert before == after


def test_a_record_written_in_the_same_tick_of_the_file_system_is_not_missed(tmp_path):
    path = small_run(tmp_path)
    with RunWriter.open(path) as run:
        feed = RunFeed(path, None, Ticks(), RealClock().utc)
        write(run, 0)
        with patch("rig.watch.feed._print", lambda _path: (("same",), RealClock().utc())):
            feed.refresh()
            write(run, 1)
            feed.refresh()
        assert feed.view()["state"]["done"] == 2


def test_whole_nights_with_holds_and_faults_are_told_in_words(tmp_path):
    path = new_run(tmp_path)
    run_session(path, spoil=lambda _bench, _head, reader: reader.overloads.update({3, 4, 5}))
    said = news(first(app_of(path), "small"))
    assert said["state"]["word"] == "complete"
    assert said["state"]["accepted"] == len(PROCEDURE.expand())
    kinds = {line["kind"] for line in said["story"]["lines"]}
    assert {"session", "fault", "decision"} <= kinds
    assert said["sessions"][0]["ended"] == "complete"


def test_residuals_of_the_declared_model_of_a_calibration_and_of_an_earlier_run(tmp_path):
    run = dry(tmp_path)
    own = news(first(app_of(run), run.stem))["charts"]["residuals"]
    assert own["against"].startswith("the declared model")
    assert {s["name"] for s in own["sensors"]} == {"x_V", "y_V", "z_V"}
    held = news(first(app_of(run, reference=read_previous(run)), run.stem))["charts"]["residuals"]
    assert run.name in held["against"]
    for mine, other in zip(own["sensors"], held["sensors"], strict=True):
        assert mine["rms"] == pytest.approx(other["rms"], rel=1e-6)
        assert mine["rms"] < 200
    calibration = tmp_path / "calibration.json"
    calibration.write_text(json.dumps(fit_table(read_table(run)).to_json()))
    again = news(first(app_of(run, reference=read_previous(calibration)), run.stem))["charts"]["residuals"]
    assert again["sensors"] == held["sensors"]


def test_a_controller_tells_how_what_it_waits_for_settles(tmp_path):
    told: list[dict[str, object]] = []

    def publish(_self, content, *, now: bool = False) -> None:
        told.append(content()["settling"])

    with patch.object(live_module.LiveState, "publish", publish):
        run_session(new_run(tmp_path))
    waiting = [settling for settling in told if settling]
    assert waiting
    assert set(waiting[0]) == {"pitch", "roll"}
    assert json.dumps(waiting)
    assert told[-1] == {}


def test_a_long_soak_is_told_in_few_samples_of_the_last_while():
    judge = Settling(Criteria(23.0, 0.5, 1e9, 1.0, 1e9), 0.0)
    for second in range(0, 20_000, 10):
        judge.add(float(second), 20.0)
    lately = judge.lately(1800.0, 120)
    assert len(lately["samples"]) == 120
    assert lately["samples"][0][0] == -1800.0
    assert lately["samples"][-1] == [0.0, 20.0]


# --- a long run ------------------------------------------------------------------------------------------------


def test_a_sample_is_bounded_the_same_for_every_server_and_has_the_last():
    one, other = Sample(), Sample()
    for seq in range(1, 5001):
        one.add(seq)
    for seq in range(1, 5001):
        other.add(seq)
    assert one.seqs() == other.seqs()
    assert KEPT <= len(one.seqs()) <= KEPT + RECENT
    assert {*range(4901, 5001)} <= one.seqs()
    thirds = [sum(1 for s in one.seqs() if low < s <= low + 1600) for low in (0, 1600, 3200)]
    assert min(thirds) > 100


def test_a_long_run_is_read_once_and_shown_in_little(tmp_path):
    many = 25_000  # more than one batch; docs/how_to/watch.md has the figures of 100,000
    path = small_run(tmp_path, points=many)
    with RunWriter.open(path) as run:
        run._db.execute(
            f"WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < {many - 2}) "
            "INSERT INTO record SELECT i + 2, 1, 'observation', i * 10.0, 1e9 + i * 10.0, i, NULL, 1, 'accepted', ?, "
            "CASE i WHEN 0 THEN (SELECT hash FROM record WHERE seq = 1) ELSE x'00' END, x'00' FROM n",
            (observation(0.1),),
        )
        asked: list[int] = []
        original = WatchReader.since

        def counted(self, seq):
            found = original(self, seq)
            asked.append(len(found))
            return found

        with patch.object(WatchReader, "since", counted):
            feed = RunFeed(path, None, Ticks(), RealClock().utc)
            feed.refresh()
            assert sum(asked) == many
            view = feed.view()
            assert view["state"]["done"] == many - 1
            assert len(encoded(view)) < 60_000
            asked.clear()
            run._seq, run._hash = run.head()
            run._vigil.note()  # it was this test that wrote past the writer
            write(run, many - 1)
            feed.refresh()
            assert asked == [1]
    assert feed.view()["state"]["done"] == many
    assert len(feed.view()["charts"]["residuals"]["elapsed_s"]) <= KEPT + RECENT


def test_half_open_connections_keep_nobody_out(tmp_path):
    """As an attacker did: as many as the page takes, opened and never asked with; then a person looks."""
    new_run(tmp_path)
    command = [sys.executable, "-m", "rig", "watch", str(tmp_path / "small.sqlite"), "--port", "0"]
    page = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    silent = []
    try:
        port = next(int(found[1]) for line in page.stdout if (found := re.search(r"http://[^/]*:(\d+)/", line)))
        for i in range(250):
            silent.append(socket.create_connection(("127.0.0.1", port), timeout=10))
            if i % 2:
                silent[-1].sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
        for _ in range(3):
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/run/small", timeout=10) as answer:
                assert answer.status == 200
    finally:
        for one in silent:
            one.close()
        page.terminate()
        page.communicate(timeout=30)


@pytest.mark.parametrize(
    ("column", "what", "unit"),
    [
        ("flow_kg_per_min", "flow", "kg/min"),  # was "flow kg per" in min
        ("bridge_2_mV_per_V", "bridge 2", "mV/V"),
        ("sensor_temperature_degC", "sensor temperature", "degC"),
        ("count", "count", ""),
    ],
)
def test_a_column_is_told_with_the_unit_of_the_file(column, what, unit):
    assert said(column) == {"what": what, "unit": unit}
