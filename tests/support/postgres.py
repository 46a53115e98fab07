"""A PostgreSQL server of the system's packages, on a socket in a folder of its own."""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

USER = "postgres"


def program(name: str) -> str | None:
    """A program of the server: in the path, or where Debian has it."""
    found = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    return shutil.which(name) or (str(found[-1]) if found else None)


def another_user() -> dict[str, Any]:
    """How a process is started: a server refuses to be root."""
    return {"user": USER, "group": pwd.getpwnam(USER).pw_gid, "extra_groups": []} if os.geteuid() == 0 else {}


def _missing() -> str | None:
    if not all(map(program, ("initdb", "pg_ctl", "psql"))):
        return "PostgreSQL is not installed"
    if os.geteuid() == 0 and USER not in [one.pw_name for one in pwd.getpwall()]:
        return f"there is no user {USER}, and a server refuses to be root"
    return None


MISSING = _missing()


@dataclass
class Server:
    """A server.

    Attributes:
        folder: of its data and its socket.
    """

    folder: Path

    @classmethod
    def made(cls) -> Server:
        """A new one, started."""
        # not in pytest's folder: nobody but us may enter that one, and a path of a socket is short
        server = cls(Path(tempfile.mkdtemp(prefix="rig-pg-", dir="/dev/shm" if Path("/dev/shm").is_dir() else "/tmp")))
        if os.geteuid() == 0:
            shutil.chown(server.folder, USER)
        server.call("initdb", "-D", server.data, "-U", USER, "-A", "trust", "--no-sync")
        server.start()
        return server

    @property
    def data(self) -> str:
        """Folder of its data."""
        return str(self.folder / "data")

    def start(self) -> None:
        """Start it."""
        settings = f"-c listen_addresses='' -c unix_socket_directories={self.folder} -c fsync=off -c max_connections=40"
        self.call("pg_ctl", "-D", self.data, "-l", str(self.folder / "log"), "-w", "-o", settings, "start")

    def stop(self) -> None:
        """Stop it at once, as after a crash: connections break."""
        self.call("pg_ctl", "-D", self.data, "-w", "-m", "immediate", "stop")

    def end(self) -> None:
        """Stop it and remove everything."""
        self.stop()
        shutil.rmtree(self.folder)

    def database(self, name: str) -> str:
        """The address of a new database."""
        self.sql(f'CREATE DATABASE "{name}"')
        return f"postgresql://{USER}:secret@/{name}?host={self.folder}"

    def sql(self, text: str, database: str = USER) -> str:
        """What psql answers."""
        return self.call(
            "psql", "-h", str(self.folder), "-U", USER, "-At", "-v", "ON_ERROR_STOP=1", "-c", text, database
        )

    def call(self, name: str, *arguments: str) -> str:
        """Run a program of the server to its end."""
        command = [str(program(name)), *arguments]
        done = subprocess.run(
            command, cwd="/", stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **another_user()
        )
        assert done.returncode == 0, done.stdout
        return done.stdout.strip()
