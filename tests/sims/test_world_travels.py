"""Runs over `rig sim`: the world goes with the run, people change it, time keeps its speed, ranges are the bench's."""

from __future__ import annotations

import csv
import json
import signal
import socket
import socketserver
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest
from command import rig
from fake_lines import answering
from test_scpi_described import METER, Bench

from proving.crashes.kills import rig as process
from proving.crashes.kills import wait_for
from rig.bench.config import parse_bench
from rig.drivers.clock import RealClock
from rig.drivers.errors import Unreachable
from rig.drivers.roles import OVERLOAD
from rig.drivers.wires import SerialSettings, Wires
from rig.errors import BenchFault, UsageError
from rig.instruments.person_at_bench import ServedBench
from rig.run_file.read.reader import RunReader
from rig.run_file.write.creation import Genesis, create
from rig.runs.plans import load_plan
from rig.sims.serve import Hands, toml
from rig.simulated.dry_run import DryBench
from rig.verbs.confirm.first import check_way

BENCH = """name = "a balance"
[instruments.operator]
driver = "person"
[instruments.balance]
driver = "scpi-meter"
address = "socket://192.0.2.77:4001"
model = "XP205"
unit = "g"
reading_s = 1
{more}
[sensors.balance]
reader = "balance"
unit = "g"
[factors]
mass_g = "operator"
[limits]
mass_g = [0, 200]
"""
PROCEDURE = """kind = "general"
name = "weights"
seed = 1
replications = 1
[factors.mass_g]
levels = {levels}
order = "as written"
[settle]
dwell_s = 1
[model]
formula = "1 + mass_g"
"""
WORLD = """# a balance \U0001f642
seed = 3
[sensors.balance]
formula = "0.002 + 1.00003*mass_g"
noise = 0.0005
"""
LIVE = {"speed": 50.0, "epoch_utc": 1.8e9, "started_utc": 1.9e9}


def plan_on(folder, bench):
    (folder / "bench.toml").write_text(bench, encoding="utf-8")
    (folder / "procedure.toml").write_text(PROCEDURE.format(levels=[0, 50, 100]))
    return load_plan(folder / "procedure.toml", folder / "bench.toml")


def served(**live):
    return toml({**tomllib.loads(BENCH.format(more="")), "simulated": True, "live": {**LIVE, **live}})


# --- the world ----------------------------------------------------------------------------------------------------


def test_a_run_over_rig_sim_has_its_world(tmp_path):
    plan = plan_on(tmp_path, served(world=WORLD))
    assert plan.documents["world.toml"] == WORLD
    assert plan.truth["sensors"]["balance"]["noise"] == 0.0005
    assert plan_on(tmp_path, served(world="")).documents["world.toml"] == "", "the default world"
    assert "world.toml" not in plan_on(tmp_path, served()).documents, "served by an earlier version"


def test_a_further_run_in_an_unknown_world_is_refused_with_what_to_do(tmp_path):
    paths = []
    for bench in (served(), served(world=WORLD)):
        plan = plan_on(tmp_path, bench)
        paths.append(tmp_path / f"{len(paths)}.sqlite")
        about = {"dry": False, "procedure": "weights", "bench": "a balance"}
        create(paths[-1], Genesis("x", plan.documents, plan.run_list, True, about), elapsed_s=0.0, utc_s=1.8e9)
    with pytest.raises(UsageError, match=r"does not hold its world: name the world file .* with --world"):
        check_way(paths[0], dry=True, rehearsed=True, world=False)
    check_way(paths[0], dry=True, rehearsed=True, world=True)
    check_way(paths[1], dry=True, rehearsed=True, world=False)
    check_way(paths[0], dry=True, rehearsed=False, world=False)  # --list


# --- people -------------------------------------------------------------------------------------------------------


def test_a_served_bench_follows_what_it_is_told():
    dry = DryBench(parse_bench(BENCH.format(more=""), "bench.toml"), tomllib.loads(WORLD))
    try:
        hands, said = Hands(dry.sim), []
        for told in (
            b"{}\n",
            b'{"factor": "mass_g", "va',
            b'lue": 20.5}\n',
            b'{"change": "remount", "number": null}\n',
        ):
            hands.on_rx(told, said.append)
        for nonsense in (b"\n", b"[1]\n", b'{"factor": "mass_g"}\n', b"\xff\n"):
            hands.on_rx(nonsense, said.append)
        assert said == [b"0\n", b"0\n", b"1\n", *[b"?\n"] * 4]
        assert dry.sim.plant.laboratory.true("mass_g", 1.0) == 20.5
    finally:
        dry.close()


@pytest.mark.parametrize(("steps", "heard"), [(0, [{}, "a", "b", "c"]), (2, [{}, "c"])])
def test_a_bench_that_was_not_started_anew_is_changed_already(steps, heard):
    lines = []

    class Told(socketserver.StreamRequestHandler):
        def handle(self):
            lines.append(json.loads(self.rfile.readline()))
            self.wfile.write(f"{steps}\n".encode())

    with answering(Told) as port:
        bench = ServedBench(f"127.0.0.1:{port}")
        for change in "ab":
            bench.recall(change, None)
        bench.done("c", None)
    assert [line.get("change", line) for line in lines] == heard


def test_a_bench_that_is_gone_is_said():
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = f"127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(Unreachable, match=r"what a person has done .* is rig sim still running\?"):
        ServedBench(address).recall_setting("mass_g", 1.0)
    with pytest.raises(BenchFault, match="is rig sim still running"):
        ServedBench(address).recall("remount", None)


def test_weights_that_are_put_on_by_hand_are_read_over_rig_sim(tmp_path):
    (tmp_path / "bench.toml").write_text(BENCH.format(more=""))
    (tmp_path / "world.toml").write_text(WORLD, encoding="utf-8")
    (tmp_path / "procedure.toml").write_text(PROCEDURE.format(levels=[0, 50, 100]))
    live = tmp_path / "LIVE.toml"
    world = ("--world", tmp_path / "world.toml", "--speed", 200, "--live", live, "--for", 60)
    server = process("sim", tmp_path / "bench.toml", *world)
    try:
        wait_for(live.exists, server)
        run = process("run", tmp_path / "procedure.toml", "--bench", live, "--out", tmp_path)
        path = run.stdout.readline().strip()
        for mass in ("0", "50", "100.5"):
            wait_for(lambda mass=mass: rig("done", path, "--value", mass).returncode == 0, run)
        run.communicate(timeout=30)
    finally:
        server.send_signal(signal.SIGTERM)
        server.communicate(timeout=10)
    out = tmp_path / "out.csv"
    assert rig("export", path, "--out", out).returncode == 0
    with out.open() as file:
        read = [float(row["balance_g"]) for row in csv.DictReader(file)]
    assert read == pytest.approx([0.002, 50.0035, 100.505], abs=0.002)
    with RunReader.open(Path(path)) as reader:
        assert reader.documents()["world.toml"] == WORLD


# --- time and ranges ------------------------------------------------------------------------------------------------


def test_lines_over_tcp_are_sent_at_once():
    with socket.create_server(("127.0.0.1", 0)) as server:
        wires = Wires(RealClock())
        try:
            line = wires.serial(f"socket://127.0.0.1:{server.getsockname()[1]}", SerialSettings(9600), "it")
            line.write("*CLS")
            assert line._port._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        finally:
            wires.close()


FLOW = Path(__file__).parents[2] / "examples" / "flow-lab"
POINT_S = 45.0
"""Dwell and readings of a point of the flow example, as `rig plan` says."""


def test_a_point_of_45_s_takes_about_that_long_at_400_times_the_speed(tmp_path):
    """It took 577 s: each exchange over TCP waited for 40 ms of real time, which are 16 s of the bench's."""
    procedure = tmp_path / "procedure.toml"
    procedure.write_text(
        'kind = "general"\nname = "45 s"\nseed = 3\nreplications = 1\n'
        '[factors.valve_V]\nlevels = [1, 4, 7, 10]\norder = "up-down"\n[settle]\ndwell_s = 35\n'
        '[measure]\nreadings = 5\n[model]\nformula = "1 + flow_kg_per_min"\nabscissa = "flow_kg_per_min"\n'
    )
    live = tmp_path / "LIVE.toml"
    world = ("--world", FLOW / "world.toml", "--speed", 400, "--live", live, "--for", 60)
    server = process("sim", FLOW / "bench.toml", *world)
    try:
        wait_for(live.exists, server)
        run = process("run", procedure, "--bench", live, "--out", tmp_path)
        path = run.stdout.readline().strip()
        run.communicate(timeout=60)
    finally:
        server.send_signal(signal.SIGTERM)
        server.communicate(timeout=10)
    out = tmp_path / "out.csv"
    assert rig("export", path, "--out", out).returncode == 0
    with out.open() as file:
        began = [float(row["elapsed_s"]) for row in csv.DictReader(file)]
    points = sorted(later - earlier for earlier, later in pairwise(began))
    print("seconds a point:", points)
    # of one point on a loaded machine all are late, and none is early
    assert POINT_S - 1.0 < points[0] < 1.6 * POINT_S


@pytest.mark.parametrize(("more", "reads"), [({}, 1970.0), ({"overload": 1500.0}, OVERLOAD)])
def test_the_range_of_a_twin_is_that_of_the_bench_file(monkeypatch, more, reads):
    it = Bench(METER | more)
    try:
        monkeypatch.setattr(it.twin.it.plant, "channel_V", lambda *_: 1970.0)
        it.it.prepare()
        it.it.start(1)
        assert it.it.fetch() == {"input": [pytest.approx(reads)]}
    finally:
        it.dry.close()


@pytest.mark.parametrize(("levels", "code"), [([1, 2, 190], 3), ([*range(1, 20), 190], 0)])
def test_a_run_that_lost_points_says_so_in_its_last_line(tmp_path, levels, code):
    (tmp_path / "bench.toml").write_text(BENCH.format(more="overload = 150"))
    (tmp_path / "world.toml").write_text(WORLD, encoding="utf-8")
    (tmp_path / "procedure.toml").write_text(PROCEDURE.format(levels=levels))
    files = ("procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml")
    done = rig("run", *files, cwd=tmp_path)
    last = " ".join(done.stderr.split()).rpartition("detect changes of the file")[2]
    assert last.strip().startswith(f"1 of {len(levels)} points were lost, and are in no table: the first, ")
    assert "balance_g out of range" in last
    assert done.returncode == code


def test_the_plan_sees_outputs_beyond_the_range(tmp_path):
    (tmp_path / "bench.toml").write_text(BENCH.format(more="overload = 150"))
    expected = '[expect]\nsigma = { balance = 0.001 }\noutput = { balance = "1.001*mass_g" }\n'
    for levels, told in (([1, 190], True), ([1, 140], False)):
        (tmp_path / "procedure.toml").write_text(PROCEDURE.format(levels=levels) + expected)
        done = rig("plan", "procedure.toml", "--bench", "bench.toml", cwd=tmp_path)
        assert ("goes to 190 g, 1.3e+02 % of the range of balance, 150 g" in " ".join(done.stdout.split())) is told


def test_the_log_says_how_many_points_were_lost(tmp_path):
    (tmp_path / "bench.toml").write_text(BENCH.format(more="overload = 150"))
    (tmp_path / "world.toml").write_text(WORLD, encoding="utf-8")
    (tmp_path / "procedure.toml").write_text(PROCEDURE.format(levels=[1, 2, 190]))
    files = ("procedure.toml", "--bench", "bench.toml", "--dry", "--world", "world.toml", "--log", "run.log")
    rig("run", *files, cwd=tmp_path)
    log = (tmp_path / "run.log").read_text()
    assert "complete, 2 of 3 points in " in log
    assert "1 of 3 points were lost" in log
