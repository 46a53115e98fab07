"""What is installed: the locks, what `make` does where a file is not the one that was locked, and what users get."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import Distribution, PackageNotFoundError, PathDistribution, distribution
from pathlib import Path

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LOCKS = sorted((ROOT / "locks").glob("*.txt"))
_STANZA = re.compile(
    r"^([\w.-]+)==([\w.!+]+)(?: ; (.+?))? \\\n((?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", re.MULTILINE
)


def pins(path):
    """(name, version, condition) of everything in a lock; nothing else may be in it."""
    text = path.read_text()
    assert re.fullmatch(r"#.+\n", _STANZA.sub("", text)), f"{path.name} has more in it than pins with hashes"
    return [found.groups()[:3] for found in _STANZA.finditer(text)]


def names(requirements):
    return {canonicalize_name(Requirement(one).name) for one in requirements}


def test_every_package_is_in_one_lock_and_the_constraints_say_the_same():
    locked = [pin for path in LOCKS for pin in pins(path)]
    assert len(set(locked)) == len(locked)
    constrained = (ROOT / "constraints.txt").read_text().splitlines()[1:]
    assert sorted(constrained) == sorted(f"{name}=={version}{f' ; {of}' if of else ''}" for name, version, of in locked)


def test_the_locks_have_what_pyproject_asks_for():
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    extras = PROJECT["optional-dependencies"]
    asked = {
        "run": PROJECT["dependencies"],
        "build": build,
        "make": extras["dev"] + extras["peers"] + extras["dask"] + extras["visa"],
        "mutants": extras["mutants"],
        "lock": extras["lock"],
    }
    before = set()
    for lock, wanted in asked.items():
        before |= {name for name, _, _ in pins(ROOT / "locks" / f"{lock}.txt")}
        assert names(wanted) <= before, lock
    versions = {name: version for path in LOCKS for name, version, _ in pins(path)}
    for requirement in map(Requirement, [one for wanted in asked.values() for one in wanted]):
        assert requirement.specifier.contains(versions[canonicalize_name(requirement.name)]), requirement


def test_what_runs_here_is_what_was_locked():
    """From the project on, whatever the installed packages say that they need is there in the locked version."""
    locked = {n: v for path in LOCKS for n, v, of in pins(path) if not of or Marker(of).evaluate()}
    wrong, seen, waiting = [], set(), [(distribution("calibration-rig"), frozenset({"dev", "peers"}))]
    while waiting:
        asking, extras = waiting.pop()
        for requirement in map(Requirement, asking.requires or ()):
            name = canonicalize_name(requirement.name)
            marker = requirement.marker
            needed = marker is None or any(marker.evaluate({"extra": extra}) for extra in extras or {""})
            if not needed or (name, frozenset(requirement.extras)) in seen:
                continue
            seen.add((name, frozenset(requirement.extras)))
            try:
                found = distribution(name)
            except PackageNotFoundError:
                wrong.append(f"{name} is not here")
                continue
            if locked.get(name) != found.version:
                wrong.append(f"{name} {found.version}, locked {locked.get(name)}")
            waiting.append((found, frozenset(requirement.extras)))
    assert wrong == []
    assert len(seen) > 50


def test_users_get_no_development_tools_and_no_peers(tmp_path):
    build = "import sys, hatchling.build; print(hatchling.build.build_wheel(sys.argv[1]))"
    done = subprocess.run([sys.executable, "-c", build, tmp_path], cwd=ROOT, capture_output=True, text=True, check=True)
    wheel = tmp_path / done.stdout.split()[-1]
    with zipfile.ZipFile(wheel) as archive:
        inside = {name.partition("/")[0] for name in archive.namelist()}
        archive.extractall(tmp_path / "wheel", [n for n in archive.namelist() if ".dist-info/" in n])
    (about,) = (tmp_path / "wheel").glob("*.dist-info")
    metadata: Distribution = PathDistribution(about)
    wanted = [Requirement(one) for one in metadata.requires or ()]
    pulled = {canonicalize_name(one.name) for one in wanted if one.marker is None or one.marker.evaluate({"extra": ""})}
    assert pulled == names(PROJECT["dependencies"])
    others = {n for extra in PROJECT["optional-dependencies"].values() for n in names(extra)}
    assert {canonicalize_name(one.name) for one in wanted} == pulled | others
    assert others & pulled == set()
    assert inside == {"rig", about.name}
    run = {name for name, _, _ in pins(ROOT / "locks" / "run.txt")}
    assert run & (others - pulled) == set()
    assert names(PROJECT["dependencies"]) <= run


def test_no_file_that_says_what_is_installed_names_an_index():
    for path in (
        *LOCKS,
        ROOT / "constraints.txt",
        *(ROOT / "tools").iterdir(),
        ROOT / "Makefile",
        ROOT / ".ci" / "run",
    ):
        if path.is_file():
            assert not re.search(r"https?:|file:|index-url [^{]|find-links [^{]", path.read_text()), path


def small_wheel(folder):
    """A package of nobody's, as an index serves it."""
    wheel = folder / "nobodys-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("nobodys.py", "")
        about = "nobodys-1.0.dist-info"
        archive.writestr(f"{about}/METADATA", "Metadata-Version: 2.1\nName: nobodys\nVersion: 1.0\n")
        archive.writestr(f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{about}/RECORD", f"nobodys.py,,\n{about}/METADATA,,\n{about}/WHEEL,,\n{about}/RECORD,,\n")
    return wheel


@pytest.mark.parametrize(
    ("lock", "says"),
    [
        ("nobodys==1.0 --hash=sha256:{wrong}\n", r"Expected sha256 0{{64}}\s+Got\s+{right}"),
        ("nobodys==2.0 --hash=sha256:{right}\n", "No matching distribution found for nobodys==2.0"),
    ],
)
def test_make_installs_no_file_that_is_not_locked_and_says_what_to_do(tmp_path, lock, says):
    served = tmp_path / "served"
    served.mkdir()
    right = hashlib.sha256(small_wheel(served).read_bytes()).hexdigest()
    for folder in ("tools", "locks", "rig"):
        (tmp_path / "project" / folder).mkdir(parents=True)
    shutil.copy(ROOT / "tools" / "make-venv", tmp_path / "project" / "tools")
    (tmp_path / "project" / ".venv").symlink_to(sys.prefix)
    for name in ("run", "build", "make"):
        text = lock.format(right=right, wrong="0" * 64) if name == "run" else ""
        (tmp_path / "project" / "locks" / f"{name}.txt").write_text(text)
    settings = {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(served), "PIP_TARGET": str(tmp_path / "installed")}
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("PIP_", "RIG_"))}
    done = subprocess.run(
        [tmp_path / "project" / "tools" / "make-venv", tmp_path / "stamp"],
        env={**clean, **settings, "PIP_CONFIG_FILE": os.devnull, "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert re.search(says.format(right=right), done.stderr), done.stderr
    assert "RIG_UNHASHED=1 make" in done.stderr
    assert not (tmp_path / "stamp").exists()
    assert not (tmp_path / "installed").exists()
