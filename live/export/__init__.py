"""A finished run in other programs' formats.

``formats`` lists them and runs a ``job``; ``tables`` are text, ``arrays`` numpy, MATLAB and xarray, ``vtk`` and
``tiff`` for ParaView and ImageJ, ``films`` the maps over their pictures, ``r3xa`` the metadata of an experiment;
``target`` lets files appear whole or not at all.
"""

from live.export.arrays import to_xarray
from live.export.formats import FORMATS, ExportRequest, export
from live.export.job import Job, Options
from live.export.target import check_free, new_file, new_folder

__all__ = [
    "FORMATS",
    "ExportRequest",
    "Job",
    "Options",
    "check_free",
    "export",
    "new_file",
    "new_folder",
    "to_xarray",
]
