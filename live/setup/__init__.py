"""From words to objects: configuration, devices, grid, folder.

``sections`` are the keys of the configuration with their ``checks`` and options, ``config`` reads and
overlays it, ``rig`` opens the devices (and is the one door to the simulated ones), ``grid`` lays the ZOIs,
``gauges`` the virtual gauges on it, ``pictures`` reads mask, dark and flat, ``prepared`` joins these
and the kernel, ``rigfile`` writes a configuration, ``compiling`` has the loops compiled ahead, ``folder`` makes the
place for the files.
"""

from live.setup.checks import ALL, AUTO, GIVEN
from live.setup.compiling import compile_ahead
from live.setup.config import Config, from_dict, load_config, options, settings_in
from live.setup.folder import FILES, installed, make_folder, other_digits, versions
from live.setup.gauges import GaugeTable, complete_gauges, gauges_for, outlines
from live.setup.grid import grid_for, kernel_settings, whole_picture
from live.setup.pictures import correction, read_mask, with_flat_field, with_mask
from live.setup.prepared import MeasurePlan, PreparedKernel
from live.setup.rig import Rig, open_load, open_rig
from live.setup.rigfile import new_rig, write_rig
from live.setup.sections import DEFAULT_BURST, DEFAULT_REFERENCE_BURST, AlarmConfig, SpecimenConfig

__all__ = [
    "ALL",
    "AUTO",
    "DEFAULT_BURST",
    "DEFAULT_REFERENCE_BURST",
    "FILES",
    "GIVEN",
    "AlarmConfig",
    "Config",
    "GaugeTable",
    "MeasurePlan",
    "PreparedKernel",
    "Rig",
    "SpecimenConfig",
    "compile_ahead",
    "complete_gauges",
    "correction",
    "from_dict",
    "gauges_for",
    "grid_for",
    "installed",
    "kernel_settings",
    "load_config",
    "make_folder",
    "new_rig",
    "open_load",
    "open_rig",
    "options",
    "other_digits",
    "outlines",
    "read_mask",
    "settings_in",
    "versions",
    "whole_picture",
    "with_flat_field",
    "with_mask",
    "write_rig",
]
