"""Gauges that are added to a finished run, read from its stored maps (``--gauges`` of report, show and export)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquire.errors import ConfigError
from analysis.evaluate import Gauge, GaugeSet
from live.config.gauges import gauges_for
from live.config.loading import load_config
from live.results.row import gauge_columns
from live.results.run_folder import RunFolder


def add_gauges(run: RunFolder, path: Path) -> tuple[str, ...]:
    """Add the ``[gauges.NAME]`` of a TOML file to ``run`` while it is open; its files stay as they are.

    Values are those that a replay with this file would give, to the digits of the maps, and so are the uncertainties of
    extensometers and single ZOIs. That of an area includes only the overlap of the windows (6 % low at a step of a
    quarter of a ZOI, a third at most). Files of earlier versions have no normal matrices: there the ZOIs of an area
    weigh as those of a pattern that is everywhere alike. A gauge replaces an existing one of the same name.

    Raises
    ------
    ConfigError
        The file cannot be read, holds no gauge, or no ZOI lies at a gauge.
    DataError
        The maps cannot be read.
    """
    config = load_config(path, {"specimen.axis": run.specimen.axis})
    if not config.gauges:
        raise ConfigError("{path}: holds no gauge; give a table [gauges.NAME] each", path)
    gauges, strain = gauges_for(config.gauges, config.specimen.first_axis, run.strain.grid), run.strain
    values, sigmas = _read(run, gauges)
    stored = run.section("gauges")
    strain.config["gauges"] = {**stored, **config.gauges}
    for k, gauge in enumerate(gauges):
        strain.values |= dict(zip(gauge_columns(gauge.name)[:2], (values[:, k], sigmas[:, k]), strict=True))
    run.__dict__.pop("gauges", None)  # the cached value is out of date
    return tuple(gauge.name for gauge in gauges)


def _read(run: RunFolder, gauges: tuple[Gauge, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Values and sigmas, (T, number of gauges) each."""
    gauge_set = GaugeSet(gauges)
    read = [gauge_set.read(run.field(row)).values() for row in range(run.strain.n)]
    found = np.array([[(one.value, one.sigma) for one in row] for row in read]).reshape(-1, len(gauges), 2)
    return found[..., 0], found[..., 1]
