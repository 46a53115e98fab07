"""Commands that are killed while they write, and several at once: nothing torn keeps a name, and nothing is lost."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from datetime import date
from pathlib import Path
from unittest.mock import patch

import pytest
from command import rig
from test_seal import command

from proving.crashes.damages import small_finished
from rig.errors import UsageError
from rig.files.atomic import write_whole
from rig.files.temporary import locked, open_temporary, sweep, temporary_in
from rig.verbs.certificate.files import FORMS, check_free, issuing, next_number, taken, write_once

KILLED = """
import os, signal, sys
from pathlib import Path
folder, step, number = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
from rig.verbs.certificate.files import issuing, write_once
passed = 0
def stopping(real):
    def call(*args, **more):
        global passed
        if passed == step:
            os.kill(os.getpid(), number)
        passed += 1
        return real(*args, **more)
    return call
for name in ("open", "fsync", "link", "replace", "unlink"):
    setattr(os, name, stopping(getattr(os, name)))
forms = {form: ("first " + form).encode() for form in ("pdf", "html", "xml", "json")}
with issuing(folder):
    write_once(folder, "K-1", forms)
os._exit(0)
"""
SECOND = {form: f"second {form}".encode() for form in FORMS}


def killed_at(folder: Path, step: int, number: signal.Signals = signal.SIGKILL) -> bool:
    """Write a certificate in a process that is killed before its n-th call of the system; whether it was."""
    ended = subprocess.run([sys.executable, "-c", KILLED, folder, str(step), str(int(number))], check=False)
    assert ended.returncode in (0, -number)
    return ended.returncode != 0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_a_certificate_that_is_cut_anywhere_is_whole_or_can_be_made_again(tmp_path, number):
    """Of the three signals each one is sent at another third of the steps, and SIGKILL at all."""
    signals = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)
    steps = range(100) if number == signal.SIGKILL else range(signals.index(number), 100, 4)
    cut, seen = 0, set()
    for step in steps:
        folder = tmp_path / str(step)
        folder.mkdir()
        if not killed_at(folder, step, number):
            break
        cut += 1
        for path in taken(folder, "K-1"):
            assert path.read_text() == f"first {path.suffix[1:]}", "a name has a torn file"
        issued = (folder / "K-1.json").exists()
        marked = (folder / ".K-1.issuing").exists()
        seen.add((issued, len(taken(folder, "K-1"))))
        with issuing(folder) as discarded:
            wanted = next_number(folder, "K-{next}", date(2026, 1, 1))
            write_once(folder, wanted, SECOND)
        assert discarded == (["K-1"] if marked and not issued else [])
        assert wanted == ("K-2" if issued else "K-1"), f"step {step}"
        assert {path.read_bytes() for path in taken(folder, wanted)} == set(SECOND.values())
        assert {path.name for path in folder.iterdir()} == {
            path.name for name in {"K-1", wanted} for path in taken(folder, name)
        }, "nothing else is left"
    assert cut >= (15 if number == signal.SIGKILL else 4)
    if number == signal.SIGKILL:
        assert {(False, 0), (False, 1), (False, 2), (False, 3), (True, 4)} <= seen, "every state was reached"


@pytest.mark.parametrize("name", ["link", "replace", "fsync"])
def test_a_disk_that_refuses_a_step_leaves_nothing(tmp_path, name):
    real, calls = getattr(os, name), 0
    for refused in range(10):
        calls = 0

        def refuse(*args, at=refused):
            nonlocal calls
            calls += 1
            if calls == at + 1:
                raise OSError(28, "No space left on device")
            return real(*args)

        with patch(f"os.{name}", refuse):
            try:
                with issuing(tmp_path):
                    write_once(tmp_path, "K-1", SECOND)
            except UsageError as error:
                assert "nothing was written" in str(error)
                assert list(tmp_path.iterdir()) == []
            else:
                break
    assert refused >= {"link": 4, "replace": 1, "fsync": 7}[name]


def test_a_file_system_without_links_has_certificates_too(tmp_path):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    with patch("os.link", refuse):
        with issuing(tmp_path):
            assert len(write_once(tmp_path, "K-1", SECOND)) == 4
        with pytest.raises(UsageError, match=r"exists in .* and is never overwritten"), issuing(tmp_path):
            write_once(tmp_path, "K-1", SECOND)
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"K-1.{form}" for form in sorted(FORMS)]


def test_files_without_a_json_and_without_a_mark_are_not_discarded(tmp_path):
    (tmp_path / "K-1.pdf").write_text("handed to the customer")
    with pytest.raises(UsageError, match=r"has K-1.pdf and no K-1.json: .* move K-1.pdf away if nobody has it"):
        check_free(tmp_path, "K-1")
    with issuing(tmp_path) as discarded:
        assert discarded == []
    assert (tmp_path / "K-1.pdf").read_text() == "handed to the customer"


def test_two_that_issue_at_once_have_two_numbers(tmp_path):
    code = """
import sys
from datetime import date
from pathlib import Path
from rig.verbs.certificate.files import issuing, next_number, write_once
folder = Path(sys.argv[1])
with issuing(folder):
    number = next_number(folder, "K-{next}", date(2026, 1, 1))
    write_once(folder, number, {form: number.encode() for form in ("pdf", "html", "xml", "json")})
"""
    at_once = [subprocess.Popen([sys.executable, "-c", code, tmp_path]) for _ in range(6)]
    assert [one.wait() for one in at_once] == [0] * 6
    assert sorted(path.name for path in tmp_path.glob("*.json")) == [f"K-{n}.json" for n in range(1, 7)]


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the keys")
def test_six_seals_at_once_are_six(tmp_path):
    pytest.importorskip("cryptography")
    run_file = shutil.copy(small_finished("attitude", tmp_path / "made"), tmp_path / "a-run.sqlite")
    command("genpkey", "-algorithm", "ed25519", "-out", "lab.pem", cwd=tmp_path)
    line = [sys.executable, "-m", "rig", "seal", str(run_file), "--key", str(tmp_path / "lab.pem"), "--operator"]
    at_once = [subprocess.Popen([*line, f"N. {n}"], stdout=subprocess.DEVNULL) for n in range(6)]
    assert [one.wait() for one in at_once] == [0] * 6
    seals = json.loads((tmp_path / "a-run.seal").read_text())["seals"]
    assert sorted(one["by"] for one in seals) == [f"N. {n}" for n in range(6)]


def dead() -> int:
    """Number of a process that has ended."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    return ended.pid


def test_temporary_files_of_dead_processes_are_swept_and_no_others(tmp_path):
    names = {
        "dead": f".rig-{dead()}-0123abcd.tmp",
        "living": f".rig-{os.getppid()}-0123abcd.tmp",
        "other": ".rig-notes.tmp",
        "elsewhere": f".rig-{dead()}-89abcdef.tmp",
    }
    for name in names.values():
        (tmp_path / name).write_text("half")
    with open_temporary(tmp_path / "x") as held:  # as a process of another machine holds it
        os.replace(tmp_path / "x", tmp_path / names["elsewhere"])
        held.write(b"at work")
        write_whole(tmp_path / "a.csv", lambda file: file.write("new"))
        left = {path.name for path in tmp_path.iterdir()}
    assert left == {"a.csv", names["living"], names["other"], names["elsewhere"]}
    sweep(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"a.csv", names["living"], names["other"]}


def test_a_command_that_was_killed_leaves_nothing_for_the_next(tmp_path):
    code = (
        "import os, signal, sys; from pathlib import Path; from rig.files.atomic import write_whole\n"
        "write_whole(Path(sys.argv[1]), lambda file: (file.write('half'), os.kill(os.getpid(), signal.SIGKILL)))"
    )
    path = tmp_path / "a.csv"
    assert subprocess.run([sys.executable, "-c", code, path], check=False).returncode == -signal.SIGKILL
    assert [one.suffix for one in tmp_path.iterdir()] == [".tmp"]
    write_whole(path, lambda file: file.write("new"))
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("a.csv", "new")]


def test_a_folder_on_a_file_system_without_locks_on_folders_is_locked_by_a_file(tmp_path):
    import fcntl  # noqa: PLC0415

    real = fcntl.flock

    def as_nfs(file, how):
        if os.path.isdir(f"/proc/self/fd/{file}"):
            raise OSError(9, "Bad file descriptor")
        real(file, how)

    with patch("fcntl.flock", as_nfs), locked(tmp_path):
        assert [path.name for path in tmp_path.iterdir()] == [".rig-lock"]
    refused = pytest.raises(UsageError, match="cannot be locked against another command: Input/output error")
    with patch("fcntl.flock", side_effect=OSError(5, "Input/output error")), refused, locked(tmp_path):
        raise AssertionError
    assert temporary_in(tmp_path).parent == tmp_path


@pytest.mark.parametrize("ending", [".h5", ".xlsx", ".feather", ".json"])
def test_csv_is_not_written_under_the_name_of_another_format(tmp_path, ending):
    done = rig("export", tmp_path / "run.sqlite", "--out", tmp_path / f"x{ending}")
    assert (done.returncode, list(tmp_path.iterdir())) == (2, [])
    assert f"a name that says {ending}: only this is written; name it" in " ".join(done.stderr.split())


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("infer c.json t.csv --out x.xlsx", "CSV under a name that says .xlsx: only this is written; name it x.csv"),
        ("infer c.json t.csv --out x.parquet", "CSV under a name that says .parquet"),
        ("fit t.csv --response y --formula x --out x.csv", "JSON under a name that says .csv"),
        ("trace t.csv --response y --formula x --report x.pdf", "HTML under a name that says .pdf"),
        ("chart a.json@2026-01-01 b.json@2026-02-01 --report x.xlsx", "HTML under a name that says .xlsx"),
        ("budget run.sqlite --report x.json", "HTML under a name that says .json"),
        ("confirm run.sqlite --report x.pdf", "HTML under a name that says .pdf"),
    ],
)
def test_no_command_writes_its_format_under_the_name_of_another(tmp_path, command, says):
    done = rig(*command.split(), cwd=tmp_path)
    assert (done.returncode, list(tmp_path.iterdir())) == (2, [])
    assert says in " ".join(done.stderr.split())
