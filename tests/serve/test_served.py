"""The server as a process: connections, TLS, the queue, its OpenAPI file, and acts from the command line."""

from __future__ import annotations

import json
import re
import socket
import ssl
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from lab_people import WORD, laboratory, typed
from small_run import write_small

from rig.acts import acts
from rig.drivers.clock import RealClock
from rig.engine.session import Signals
from rig.errors import BusyError
from rig.queue import Queue, QueueFile, open_queue, work, worker
from rig.run_file.events.queues import QueueBegan, Queued, QueueEnded
from rig.serve import openapi

ROOT = Path(__file__).parents[2]


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = laboratory(tmp_path / "lab", "attitude-lab")
    write_small(folder)
    return folder


@contextmanager
def served(lab: Path, *options: str) -> Iterator[str]:
    command = [sys.executable, "-m", "rig", "serve", str(lab), "--port", "0", *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.terminate()
        process.communicate(timeout=30)


def test_a_thousand_connections_keep_nobody_out(lab: Path):
    """Half of them silent, half with an endless header; then a person comes."""
    silent: list[socket.socket] = []
    with served(lab, "--no-queue") as address:
        port = int(address.rpartition(":")[2].strip("/"))
        try:
            for i in range(1000):
                silent.append(socket.create_connection(("127.0.0.1", port), timeout=10))
                if i % 2:
                    silent[-1].sendall(b"POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
            for _ in range(3):
                with urllib.request.urlopen(f"{address}login", timeout=10) as answer:
                    assert answer.status == 200
            still = sum(_open(one) for one in silent)
            assert still <= 64
        finally:
            for one in silent:
                one.close()


def _open(one: socket.socket) -> bool:
    one.setblocking(False)
    try:
        return one.recv(1) != b""
    except BlockingIOError:
        return True
    except OSError:
        return False


def _certificate(folder: Path) -> tuple[Path, Path]:
    x509 = pytest.importorskip("cryptography.x509")
    from cryptography.hazmat.primitives import hashes, serialization  # noqa: PLC0415
    from cryptography.hazmat.primitives.asymmetric import ec  # noqa: PLC0415

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "localhost")])
    now = datetime.fromtimestamp(RealClock().utc(), UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
        .sign(key, hashes.SHA256())
    )
    chain, private = folder / "chain.pem", folder / "key.pem"
    chain.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    plain = serialization.NoEncryption()
    private.write_bytes(key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, plain))
    return chain, private


def test_tls_by_certificate_files(lab: Path, tmp_path: Path):
    chain, key = _certificate(tmp_path)
    with served(lab, "--no-queue", "--host", "localhost", "--certificate", str(chain), "--key", str(key)) as address:
        assert address.startswith("https://localhost:")
        context = ssl.create_default_context(cafile=str(chain))
        with urllib.request.urlopen(f"{address}login", timeout=10, context=context) as answer:
            assert answer.headers["strict-transport-security"]
        port = int(address.rpartition(":")[2].strip("/"))
        old = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        old.load_verify_locations(str(chain))
        with pytest.warns(DeprecationWarning, match="TLSv1_1"):
            old.maximum_version = ssl.TLSVersion.TLSv1_1
        with pytest.raises((ssl.SSLError, OSError)), socket.create_connection(("localhost", port), 10) as plain:
            old.wrap_socket(plain, server_hostname="localhost")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--host", "0.0.0.0"), "give --certificate and --key"),
        (("--host", "192.0.2.1"), "passwords would cross the network unencrypted"),
        (("--certificate", "bench.toml"), "TLS needs both"),
        (("--certificate", "bench.toml", "--key", "bench.toml"), "are no certificate and its key"),
    ],
)
def test_other_machines_only_with_tls(options: tuple[str, ...], says: str, lab: Path):
    done = typed("serve", lab, "--port", "0", *options, cwd=lab)
    assert (done.returncode, says in done.stderr) == (2, True), done.stderr


def test_a_folder_without_people_is_not_served(tmp_path: Path):
    done = typed("serve", tmp_path)
    assert (done.returncode, "rig person add" in done.stderr) == (2, True)


def test_the_document_of_the_api_is_the_present_one():
    path = ROOT / "docs" / "reference" / "openapi.json"
    told = json.loads(path.read_text(encoding="utf-8"))
    assert told == json.loads(json.dumps(openapi())), "python -m rig.serve > docs/reference/openapi.json"
    paths = {f"/api/act/{act.name}" for act in acts()}
    assert paths <= told["paths"].keys()
    for act in acts():
        described = told["paths"][f"/api/act/{act.name}"]["post"]
        schema = described["requestBody"]["content"]["application/json"]["schema"]
        assert schema["properties"].keys() - {"confirm"} == act.model_fields.keys()
        assert ("confirm" in schema["properties"]) == act.moves
        assert ("security" in described) == act.again


def test_a_further_act_is_everywhere_without_another_edit(lab: Path, monkeypatch: pytest.MonkeyPatch):
    from rig.acts import act as base  # noqa: PLC0415

    monkeypatch.setattr(base, "_ACTS", dict(base._ACTS))

    class Wave(base.Act, act="wave"):
        """Wave to somebody."""

        to: str

        def carry_out(self, places, by):
            return base.Told(f"{by.name} waves to {self.to}")

    assert "/api/act/wave" in openapi()["paths"]
    assert re.search(r"wave to=\.\.\.", typed("act", cwd=lab).stdout)
    done = typed("act", "wave", "to=ben", "--login", "anna", lines=f"{WORD['anna']}\n", cwd=lab)
    assert done.stdout.strip() == "Anna (anna) waves to ben"


def test_acts_of_the_command_line_ask_as_the_pages_do(lab: Path):
    assert "role operator" in typed("act", "pause", cwd=lab).stderr
    word = f"{WORD['anna']}\n"
    assert typed("act", "pause", "--login", "anna", lines=word, cwd=lab).returncode == 0
    refused = typed("act", "go-on", "--login", "anna", lines=word, cwd=lab)
    assert (refused.returncode, "Confirm it with --yes" in refused.stderr) == (2, True)
    assert typed("act", "go-on", "--yes", "--login", "anna", lines=word, cwd=lab).returncode == 0
    assert typed("act", "fly", cwd=lab).returncode == 2
    assert not open_queue(lab / "runs" / "queue.sqlite")[1].paused


# --- the queue beside it ---------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of the process that is left alone
def test_one_worker_at_a_time_and_one_that_leaves_lets_runs_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    fake = tmp_path / "fake.py"
    fake.write_text(
        "import os, pathlib, sys\n"
        "folder = pathlib.Path(sys.argv[sys.argv.index('--out') + 1])\n"
        "(folder / 'who').write_text(os.environ['RIG_OPERATOR'] + ' ' + os.environ['RIG_OPERATOR_BY'])\n"
        "pathlib.Path(folder / 'go').exists() or os.mkfifo(folder / 'go')\n"
        "open(folder / 'go').read()\n"
        "(folder / 'done').write_text('')\n"
    )
    monkeypatch.setattr(worker, "RIG", (sys.executable, str(fake)))
    monkeypatch.setattr(worker, "_POLL_S", 0.01)
    file = QueueFile(tmp_path / "queue.sqlite")
    folder = file.folder_of(1)
    file.append(Queued(item=0, command="run", procedure="p", bench="b", who="Anna (anna)", who_by="password"))
    leave = threading.Event()
    how = {"has": frozenset[str](), "signals": Signals(), "said": lambda _: None, "stay": True}
    thread = threading.Thread(target=lambda: work(file, RealClock(), **how, leave=leave.is_set))  # type: ignore[arg-type]
    thread.start()
    clock = RealClock()
    while not (folder / "go").exists():
        clock.sleep(0.01)
    with pytest.raises(BusyError, match="another"):
        work(file, RealClock(), **how)  # type: ignore[arg-type]
    leave.set()
    thread.join(10)
    assert not (folder / "done").exists()
    assert file.read().at_work
    (folder / "go").open("w").close()
    while not (folder / "done").exists():
        clock.sleep(0.01)
    assert (folder / "who").read_text() == "Anna (anna) password"


def test_a_run_that_a_person_resumes_begins_on_a_held_bench_and_frees_it(tmp_path: Path):
    queue = Queue()
    file = QueueFile(tmp_path / "queue.sqlite")
    first = Queued(item=0, command="run", procedure="p", bench="b")
    again = Queued(item=0, command="resume", procedure="runs/x.sqlite", bench="b")
    queue = file.append(first, first, QueueBegan(item=1), QueueEnded(item=1, code=4), again)
    assert queue.held == {"b": 1}
    assert [one.number for one in queue.next(0.0, frozenset())] == [3]
    queue = file.append(QueueBegan(item=3), QueueEnded(item=3, code=0))
    assert (queue.held, [one.number for one in queue.next(0.0, frozenset())]) == ({}, [2])
