"""An instrument of another package is offered by `rig new` once it is installed; no list names it."""

from __future__ import annotations

import outside_package
import pytest
from command import rig

from rig.new.questions import QUESTIONS, completed


@pytest.fixture(scope="module", autouse=True)
def _outside():
    with outside_package.installed():
        yield


def test_it_is_offered_with_its_channels_and_its_files_run_dry(tmp_path):
    (question,) = (one for one in QUESTIONS if one.key == "reads_with")
    assert outside_package.DRIVER in question.choices(completed({}, "nothing"))
    (tmp_path / "given.toml").write_text(
        f'levels = [0, 5]\nreads_with = "{outside_package.DRIVER}"\nchannels = 3\nreplications = 1\n'
    )
    done = rig("new", "lab", "--answers", "given.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert 'channel = "C"' in (tmp_path / "lab" / "bench.toml").read_text()
    dry = rig("run", "procedure.toml", "--bench", "bench.toml", "--dry", cwd=tmp_path / "lab")
    assert dry.returncode == 0, dry.stderr
