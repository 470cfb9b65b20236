"""HDF5 that survives a kill, a full disk and bad bytes.

``superblock`` reads a file's state without the library, ``child`` lets another process read it first,
``failure`` lets go of a file that can no longer be written, ``tables`` grow row by row, ``pictures`` chunk by
chunk with a checksum of our own, ``pace`` says when to flush, ``nexus`` has the words of NeXus, ``disk``
forecasts the room.
"""

from acquire.hdf5.child import probe
from acquire.hdf5.disk import forecast, free_bytes, network_share
from acquire.hdf5.failure import let_go
from acquire.hdf5.nexus import NO_UNIT, new_group, new_json, say, to_json, word
from acquire.hdf5.pace import Pace
from acquire.hdf5.pictures import PictureStack, compile_loops
from acquire.hdf5.superblock import check_size, read_superblock
from acquire.hdf5.tables import GrowingDataset, Table

__all__ = [
    "NO_UNIT",
    "GrowingDataset",
    "Pace",
    "PictureStack",
    "Table",
    "check_size",
    "compile_loops",
    "forecast",
    "free_bytes",
    "let_go",
    "network_share",
    "new_group",
    "new_json",
    "probe",
    "read_superblock",
    "say",
    "to_json",
    "word",
]
