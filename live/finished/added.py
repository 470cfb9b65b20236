"""Virtual gauges laid over a finished run: read from its maps as they would have been read in the test."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquire.errors import ConfigError
from analysis.evaluate import Gauge
from live.finished.run_folder import RunFolder
from live.results import gauge_columns
from live.setup import gauges_for, load_config


def add_gauges(run: RunFolder, path: Path) -> tuple[str, ...]:
    """Add the ``[gauges.NAME]`` of a TOML file to ``run``, as long as it is open; its files stay as they are.

    Values are those that a replay with this file would give, and so are the uncertainties of extensometers and single
    ZOIs. That of a mean over an area is of the overlap of the windows alone, which is low on dense grids (by 6 % at a
    step of a quarter of a ZOI, by a third at most). One of a name that is there already takes its place.

    Raises
    ------
    ConfigError
        The file cannot be read, says nothing of gauges, or no ZOI lies where one is.
    DataError
        The maps cannot be read.
    """
    config = load_config(path, {"specimen.axis": run.specimen.axis})
    if not config.gauges:
        raise ConfigError(f"{path}: holds no gauge; give a table [gauges.NAME] each")
    gauges, strain = gauges_for(config.gauges, config.specimen.first_axis, run.strain.grid), run.strain
    values, sigmas = _read(run, gauges)
    stored = run.section("gauges")
    strain.config["gauges"] = {**stored, **config.gauges}
    for k, gauge in enumerate(gauges):
        strain.values |= dict(zip(gauge_columns(gauge.name), (values[:, k], sigmas[:, k]), strict=True))
    run.__dict__.pop("gauges", None)  # worked out anew when it is asked for
    return tuple(gauge.name for gauge in gauges)


def _read(run: RunFolder, gauges: tuple[Gauge, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Values and sigmas, (T, number of gauges) each."""
    shape = (run.strain.n, len(gauges))
    values, sigmas = np.full(shape, np.nan), np.full(shape, np.nan)
    for row in range(run.strain.n):
        field = run.field(row)
        for k, gauge in enumerate(gauges):
            read = gauge.measure(field)
            values[row, k], sigmas[row, k] = read.value, read.sigma
    return values, sigmas
