"""`rig sim`: the simulated bench on ports of the operating system, for controllers in other processes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from rig.bench.bench_file import check_options
from rig.bench.config import parse_toml, read_text
from rig.bench.contract_files import read_bench
from rig.errors import ConfigurationError, RigError
from rig.files.atomic import check_added_to, check_writable
from rig.register import register_beside
from rig.sims.physics import WorldError
from rig.sims.serve import serve
from rig.simulated.calendar import dated
from rig.simulated.dry_run import plain, twin_classes
from rig.simulated.stand_ins import with_stand_ins


def serve_bench(
    bench: Path,
    world: Path | None,
    speed: float,
    live: Path,
    seconds: float | None,
    tape: Path | None,
    announce: Callable[[str], None],
) -> None:
    """Serve a bench until told to stop.

    Args:
        bench: the bench file.
        world: the world file; the default world if None.
        speed: bench seconds per real second.
        live: where to write the bench file with the addresses served; removed at the end.
        seconds: real seconds after which it stops by itself; None for never.
        tape: file to which all answers and true events are appended; None for no tape.
        announce: called with a line for each instrument.

    Raises:
        ConfigurationError: one of the files is wrong.
        UsageError: `tape` is one of the other files, a run file, or not a regular file.
        RigError: a port cannot be opened, or `live` or `tape` cannot be written.

    """
    if tape is not None:
        check_writable(tape)
        check_added_to(tape, [bench, world, live])
    config, _ = read_bench(bench)
    check_options(config, str(bench))
    config = with_stand_ins(config)
    text = "" if world is None else read_text(world, "world")
    found = register_beside(config, bench)
    if found is not None and live.parent.resolve() != bench.parent.resolve():
        # The file with the addresses stands elsewhere, and its runs read the same register.
        config = config.model_copy(update={"equipment": str(found[0].resolve())})
    truth = dated(parse_toml(text, str(world)), config, None if found is None else found[1])
    announce("SIMULATED bench; no instrument is real")
    try:
        serve(
            plain(config),
            truth,
            twin_classes(config),
            live,
            world_text=text,
            speed=speed,
            seconds=seconds,
            tape=tape,
            announce=announce,
        )
    except WorldError as error:
        raise ConfigurationError(f"{world}: {error}") from error
    except OSError as error:
        raise RigError(f"the simulated bench cannot be served: {error}") from error
