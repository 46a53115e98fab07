"""Contract files (EDS, register maps) passed to both sides of a wire.

A driver declares the files it needs (`rig.drivers.driver.ContractFile`). Drivers and twins must not import one another
nor the contracts. The controller reads the file once and passes the same text to both. A bench file may name another
file (`eds = "drive.eds"`, beside the bench file): its text is read with the bench file and stored in the run file. So
is the file of a declared instrument, `driver = "./my_bath.toml"`, whose text then stands in place of the driver's name.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from rig.bench.config import BenchConfig, parse_bench, read_text
from rig.bench.plugins import driver_class, drivers, is_file
from rig.contracts.declared.beside import with_dbc
from rig.contracts.declared.hooks import placed
from rig.errors import ConfigurationError


@cache
def _text(package: str, name: str) -> str:
    return files(package).joinpath(name).read_text(encoding="utf-8")


def with_contracts(driver: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options with the driver's contract files filled in, unless the bench file gives its own."""
    found = driver_class(driver)
    own = {one.option: _text(one.package, one.file) for one in found.contracts}
    return {**own, **getattr(found, "supplied", {}), **options}


def read_bench(path: Path) -> tuple[BenchConfig, dict[str, str]]:
    """A bench file with its contract files read, and their texts by name. Raises `ConfigurationError`."""
    config = parse_bench(read_text(path, "bench"), str(path))
    texts = files_beside(config, path)
    return with_files(config, texts, str(path)), texts


def bench_of_run(documents: Mapping[str, str], where: str) -> BenchConfig:
    """The bench of a run file, with the files that it names; without those that this version cannot read.

    Args:
        documents: texts by document name, with `bench.toml`.
        where: the run file, for messages.

    Raises:
        ConfigurationError: the bench file itself is wrong.
    """
    config = parse_bench(documents["bench.toml"], f"{where} (bench.toml)", strict=False)
    try:
        return with_files(config, documents, where)
    except ConfigurationError:
        return config


def files_beside(config: BenchConfig, bench: Path) -> dict[str, str]:
    """The texts of the contract files named by a bench, by name. Raises `ConfigurationError` for a missing file."""
    found = {}
    for instrument, option, name in _named(config):
        path = bench.parent / name
        text = read_text(path, f"{option} (instruments.{instrument})")
        found[name] = with_hook(text, path) if option == "driver" else text
    return found


def with_hook(text: str, path: Path) -> str:
    """The text of an instrument's file, with its hook by place and SHA-256, and with its DBC.

    Raises:
        ConfigurationError: one of them cannot be read.
    """
    try:
        return with_dbc(placed(text, path.parent), lambda name: (path.parent / name).read_bytes())
    except OSError as error:
        raise ConfigurationError(
            f"{path}: {error.filename} cannot be read ({error.strerror}); it stands beside this file"
        ) from None
    except ValueError as error:
        raise ConfigurationError(f"{path}: {error}") from None


def with_files(config: BenchConfig, texts: Mapping[str, str], where: str) -> BenchConfig:
    """The bench with texts in place of names of contract files. Raises `ConfigurationError` for a missing one."""
    instruments = dict(config.instruments)
    for instrument, option, name in _named(config):
        if name not in texts:
            raise ConfigurationError(f"{where}: instruments.{instrument}.{option} = {name!r} does not exist")
        if option == "driver":
            try:
                driver_class(f"{texts[name]}\n")
            except ConfigurationError as error:
                raise ConfigurationError(f"{where}: instruments.{instrument}.driver: {name}: {error}") from None
        text = f"{texts[name]}\n" if option == "driver" else texts[name]
        instruments[instrument] = instruments[instrument].model_copy(update={option: text})
    return config.model_copy(update={"instruments": instruments})


def _named(config: BenchConfig) -> list[tuple[str, str, str]]:
    """(instrument, option, file name) of every contract given by a name: a single line is a name."""
    found = []
    for name, instrument in config.instruments.items():
        if is_file(instrument.driver):
            found.append((name, "driver", instrument.driver))
            continue
        if instrument.driver not in drivers():
            continue  # `rig.bench.bench_file.check_options` reports it with its place
        for contract in driver_class(instrument.driver).contracts:
            text = instrument.options.get(contract.option)
            if isinstance(text, str) and text.strip() and "\n" not in text:
                found.append((name, contract.option, text))
    return found
