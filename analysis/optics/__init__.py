"""What the camera adds to the motion of a plane, and how it is removed.

``plane`` is the apparent motion of a rigid plane in pictures, and names what motion off it shows; ``plates`` places
the ZOIs of plates beside those of the specimen, and measures the apparent motion on them. ``motion`` is what moves
while a picture or a burst is taken: a rolling shutter with its readout time, an uneven burst. ``lens`` is the
distortion, which ``shifts`` finds.
"""

from analysis.optics.lens import LENS_NAMES, LensCorrection, LensModel, LensReading, strain_of_shift
from analysis.optics.motion import (
    BurstMotion,
    Readout,
    ShutterCorrection,
    readout_of_bands,
    readout_of_motion,
)
from analysis.optics.plane import MODELS, NAMES, SCALE, ApparentMotion, Keystone, Model, alike, keystones
from analysis.optics.plates import (
    ASSUMED_TILT,
    Box,
    ChosenModel,
    PlateFit,
    PlateLayout,
    choose_model,
    trouble,
    without_plates,
)
from analysis.optics.shifts import LensFit, lens_of_shifts

__all__ = [
    "ASSUMED_TILT",
    "LENS_NAMES",
    "MODELS",
    "NAMES",
    "SCALE",
    "ApparentMotion",
    "Box",
    "BurstMotion",
    "ChosenModel",
    "Keystone",
    "LensCorrection",
    "LensFit",
    "LensModel",
    "LensReading",
    "Model",
    "PlateFit",
    "PlateLayout",
    "Readout",
    "ShutterCorrection",
    "alike",
    "choose_model",
    "keystones",
    "lens_of_shifts",
    "readout_of_bands",
    "readout_of_motion",
    "strain_of_shift",
    "trouble",
    "without_plates",
]
