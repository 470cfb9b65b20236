"""A finished run in other programs' formats.

``formats`` lists them and runs a ``job``; ``tables`` are text, ``arrays`` numpy, MATLAB and xarray, ``vtk`` and
``tiff`` for ParaView and ImageJ, ``films`` the maps over their pictures as ``painting`` paints them, ``r3xa`` the
metadata of an experiment; ``target`` lets files appear whole or not at all.
"""

from live.export.arrays import to_xarray
from live.export.formats import FORMATS, ExportRequest, export
from live.export.job import Job, Options
from live.export.painting import Levels, Painter, Scale, caption, status_table
from live.export.target import check_free, new_file, new_folder

__all__ = [
    "FORMATS",
    "ExportRequest",
    "Job",
    "Levels",
    "Options",
    "Painter",
    "Scale",
    "caption",
    "check_free",
    "export",
    "new_file",
    "new_folder",
    "status_table",
    "to_xarray",
]
