"""Instruments in the bench file itself, in docs/how_to/own_instrument.md: in dry runs, and its commands."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest
from command import rig

from rig.bench.bench_file import check_options
from rig.bench.config import parse_bench
from rig.drivers.roles import Reader, Source
from rig.instruments.opening import open_bench
from rig.sims.serve import toml
from rig.simulated.dry_run import DryBench

TEXT = (Path(__file__).parents[2] / "docs" / "how_to" / "own_instrument.md").read_text(encoding="utf-8")


def block(name: str) -> str:
    (found,) = re.findall(rf"^```\w+ {re.escape(name)}\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
    return found


def benches() -> dict[str, str]:
    """The bench of the page, and the same with the other source."""
    first = tomllib.loads(block("voltmeter/bench.toml"))
    second = first | {"instruments": first["instruments"] | tomllib.loads(block("voltmeter/smu.toml"))["instruments"]}
    return {"calibrator": block("voltmeter/bench.toml"), "smu": toml(second)}


@pytest.mark.parametrize("which", benches())
def test_the_instruments_of_the_page_work_on_their_twins(which: str) -> None:
    dry = DryBench(parse_bench(benches()[which], "bench.toml"), {"sensors": {"dmm": {"formula": "volts_V"}}})
    bench = open_bench(dry.config, check_options(dry.config, "bench"), dry.world, dry.wires)
    source, meter = bench.instruments["calibrator"], bench.instruments["dmm"]
    assert isinstance(source, Source)
    assert isinstance(meter, Reader)
    for one in (source, meter):
        one.identify()
        one.prepare()
    for volts in (7.5, -10.0):
        source.set(volts)
        for _ in range(60):
            dry.world.sleep(1.0)
            if source.read().settled:
                break
        assert source.read().settled
        meter.start(5)
        assert meter.fetch()["input"] == pytest.approx([volts] * 5, abs=0.01)
    source.make_safe()
    assert source.read().safe
    dry.close()


@pytest.mark.parametrize("which", benches())
def test_the_commands_of_the_page(tmp_path: Path, which: str) -> None:
    (tmp_path / "bench.toml").write_text(benches()[which])
    (tmp_path / "procedure.toml").write_text(block("voltmeter/procedure.toml"))
    commands = [line.split()[1:] for line in block("voltmeter/run").splitlines()]
    assert [command[0] for command in commands] == ["plan", "run"]
    for command in commands:
        done = rig(*command, cwd=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
    run = Path(tmp_path, done.stdout.splitlines()[0])
    fitted = rig("fit", run, "--json", cwd=tmp_path)
    assert fitted.returncode == 0, fitted.stderr
    found = json.loads(fitted.stdout)
    assert "volts_V" in json.dumps(found)
