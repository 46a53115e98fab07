"""`rig seal`: what a seal proves, and that a change of anything in it is found."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from command import rig

from proving.crashes.damages import small_finished
from proving.forger import forge

pytest.importorskip("cryptography")
openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes keys and time stamps as others do")


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    return small_finished("attitude", tmp_path_factory.mktemp("finished"))


@pytest.fixture
def run_file(finished, tmp_path) -> Path:
    path = tmp_path / "a-run.sqlite"
    shutil.copy(finished, path)
    return path


@pytest.fixture(scope="module")
def keys(tmp_path_factory) -> Path:
    """Keys made by another program, as docs/how_to/verify.md has it."""
    folder = tmp_path_factory.mktemp("keys")
    for name in ("lab", "other"):
        command("genpkey", "-algorithm", "ed25519", "-out", f"{name}.pem", cwd=folder)
        command("pkey", "-in", f"{name}.pem", "-pubout", "-out", f"{name}.pub", cwd=folder)
    return folder


def command(*arguments: str, cwd: Path) -> None:
    subprocess.run(["openssl", *arguments], cwd=cwd, check=True, capture_output=True)


def larger(opened) -> None:
    """A consistent forgery: all outputs a thousandth larger."""
    for record in opened.all("observation"):
        outputs = record["body"]["outputs"]
        for one in outputs.values():
            for name in ("mean", "sd"):
                one[name] *= 1.001
            one["readings"] = [1.001 * value for value in one["readings"]]


def sealed(run_file: Path, keys: Path, *more: object) -> dict:
    done = rig("seal", run_file, "--key", keys / "lab.pem", "--operator", "A. Byron", *more, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@openssl
def test_verify_says_who_sealed_it_and_when(run_file, keys):
    made = sealed(run_file, keys)
    done = rig("verify", run_file, "--sealed-by", keys / "lab.pub", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    (seal,) = told["seals"]
    assert (seal["holds"], seal["by"], seal["when"]) == (True, "A. Byron", made["when"])
    assert made["head"] == told["head"]
    assert "sealed by A. Byron" in rig("verify", run_file).stdout


@openssl
def test_another_key_is_told(run_file, keys):
    sealed(run_file, keys)
    done = rig("verify", run_file, "--sealed-by", keys / "other.pub")
    assert done.returncode == 1
    assert "none of the given keys" in done.stderr


@openssl
def test_a_file_without_the_asked_seal_is_told(run_file, keys):
    done = rig("verify", run_file, "--sealed-by", keys / "lab.pub")
    assert (done.returncode, "no seal by the given key" in done.stderr) == (1, True)


@openssl
def test_a_consistent_forgery_breaks_the_seal(run_file, keys, tmp_path):
    sealed(run_file, keys)
    forged = forge(run_file, tmp_path / "forged.sqlite", larger)
    assert rig("verify", forged).returncode == 0, "a forgery without a seal is not seen: what seals are for"
    shutil.copy(run_file.with_suffix(".seal"), forged.with_suffix(".seal"))
    done = rig("verify", forged)
    assert (done.returncode, "of another file" in done.stderr) == (1, True)


@openssl
@pytest.mark.parametrize("key", ["by", "when", "run_id", "records", "head", "files", "public_key", "signature"])
def test_every_word_of_a_seal_is_signed(run_file, keys, key):
    sealed(run_file, keys)
    file = run_file.with_suffix(".seal")
    told = json.loads(file.read_text())
    value = told["seals"][0][key]
    changed = {"records": lambda v: v - 1, "files": lambda v: {**v, "K-1.pdf": "0" * 64}}.get(key, _other)
    told["seals"][0][key] = changed(value)
    file.write_text(json.dumps(told))
    done = rig("verify", run_file)
    assert (done.returncode, "does not prove it" in done.stderr) == (1, True), done.stdout


def _other(text: str) -> str:
    """The text with another first character of its kind."""
    return ("B" if text[0] == "A" else "A" if text[0].isalpha() else "1" if text[0] == "0" else "0") + text[1:]


@openssl
def test_certificates_are_sealed_too(run_file, keys, tmp_path):
    certificate = tmp_path / "K-1.pdf"
    certificate.write_bytes(b"%PDF a certificate")
    sealed(run_file, keys, "--certificate", certificate)
    assert "certificate K-1.pdf is unchanged since" in rig("verify", run_file).stdout
    certificate.write_bytes(b"%PDF another")
    assert "certificate K-1.pdf is NOT the sealed one" in rig("verify", run_file).stdout
    certificate.unlink()
    assert "is sealed too and not beside the run file" in rig("verify", run_file).stdout


@openssl
def test_seals_are_added_never_replaced(run_file, keys):
    first = sealed(run_file, keys)
    done = rig("seal", run_file, "--key", keys / "other.pem", "--operator", "C. Wheat")
    assert done.returncode == 0
    told = json.loads(rig("verify", run_file, "--json").stdout)["seals"]
    assert [one["by"] for one in told] == ["A. Byron", "C. Wheat"]
    assert json.loads(run_file.with_suffix(".seal").read_text())["seals"][0]["signature"] == first["signature"]


@openssl
def test_a_damaged_file_is_not_sealed(run_file, keys):
    data = bytearray(run_file.read_bytes())
    data[len(data) // 2] ^= 0xFF
    run_file.write_bytes(data)
    done = rig("seal", run_file, "--key", keys / "lab.pem")
    assert done.returncode == 1
    assert not run_file.with_suffix(".seal").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("no key", "is not a private key in PEM"),
        (None, "cannot be read|No such file"),
    ],
)
def test_a_key_that_is_none_is_refused(run_file, tmp_path, text, words):
    key = tmp_path / "key.pem"
    if text is not None:
        key.write_text(text)
    done = rig("seal", run_file, "--key", key)
    assert done.returncode == 2
    assert re.search(words, done.stderr)


@openssl
def test_a_key_of_another_kind_is_refused(run_file, tmp_path):
    command("genpkey", "-algorithm", "EC", "-pkeyopt", "ec_paramgen_curve:P-256", "-out", "ec.pem", cwd=tmp_path)
    done = rig("seal", run_file, "--key", tmp_path / "ec.pem")
    assert (done.returncode, "openssl genpkey -algorithm ed25519" in done.stderr) == (2, True)


def test_a_file_of_seals_that_is_none_is_told(run_file):
    run_file.with_suffix(".seal").write_text("[1, 2]")
    done = rig("verify", run_file)
    assert (done.returncode, "is no file of seals" in done.stderr) == (1, True)


def test_one_way_of_sealing_is_asked_for(run_file, tmp_path):
    assert rig("seal", run_file).returncode == 2
    assert rig("seal", run_file, "--key", tmp_path / "k", "--statement", tmp_path / "s").returncode == 2


EC = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
AUTHORITY = """
[tsa]
default_tsa = own
[own]
serial = serial
crypto_device = builtin
signer_digest = sha256
default_policy = 1.2.3.4.1
digests = sha256
accuracy = secs:1
ess_cert_id_alg = sha256
[stamps]
extendedKeyUsage = critical,timeStamping
"""


@pytest.fixture(scope="module")
def authority(tmp_path_factory) -> Path:
    """A time-stamp authority by openssl: a root, and a certificate that may stamp."""
    folder = tmp_path_factory.mktemp("authority")
    (folder / "tsa.cnf").write_text(AUTHORITY)
    (folder / "serial").write_text("01")
    root = ("-keyout", "root.key", "-out", "root.pem", "-days", "9000", "-subj", "/CN=Root")
    command("req", "-x509", *EC, *root, cwd=folder)
    command("req", *EC, "-keyout", "tsa.key", "-out", "tsa.csr", "-subj", "/CN=Stamps", cwd=folder)
    command("x509", "-req", "-in", "tsa.csr", "-CA", "root.pem", "-CAkey", "root.key", "-CAcreateserial",
            "-out", "tsa.pem", "-days", "9000", "-extfile", "tsa.cnf", "-extensions", "stamps", cwd=folder)  # fmt: skip
    return folder


def stamped(statement: Path, authority: Path) -> Path:
    """The answer of the authority."""
    answer = statement.with_suffix(".tsr")
    command("ts", "-query", "-sha256", "-cert", "-data", str(statement), "-out", "question.tsq", cwd=authority)
    command("ts", "-reply", "-queryfile", "question.tsq", "-inkey", "tsa.key", "-signer", "tsa.pem",
            "-config", "tsa.cnf", "-out", str(answer), cwd=authority)  # fmt: skip
    return answer


@openssl
def test_a_time_stamp_of_others_is_checked(run_file, authority, tmp_path):
    pytest.importorskip("rfc3161_client")
    statement = tmp_path / "a.statement"
    assert rig("seal", run_file, "--statement", statement).returncode == 0
    assert not run_file.with_suffix(".seal").exists()
    answer = stamped(statement, authority)
    assert rig("seal", run_file, "--time-stamp", answer).returncode == 0
    told = rig("verify", run_file, "--authority", authority / "root.pem")
    assert (told.returncode, "by an authority of root.pem" in told.stdout) == (0, True), told.stderr
    assert "was NOT verified" in rig("verify", run_file).stdout
    command(
        "req",
        "-x509",
        "-newkey",
        "ec",
        "-pkeyopt",
        "ec_paramgen_curve:P-256",
        "-nodes",
        "-keyout",
        "x.key",
        "-out",
        "x.pem",
        "-subj",
        "/CN=X",
        cwd=tmp_path,
    )
    assert rig("verify", run_file, "--authority", tmp_path / "x.pem").returncode == 1


@openssl
def test_a_time_stamp_of_something_else_is_refused(run_file, authority, tmp_path):
    pytest.importorskip("rfc3161_client")
    other = tmp_path / "other.statement"
    other.write_bytes(b"something else")
    done = rig("seal", run_file, "--time-stamp", stamped(other, authority))
    assert (done.returncode, "is the time stamp of something else" in done.stderr) == (2, True)
    assert not run_file.with_suffix(".seal").exists()
