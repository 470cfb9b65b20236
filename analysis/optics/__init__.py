"""What the camera adds to the motion of a plane, and how it is removed.

``plane`` is the apparent motion of a rigid plane in pictures, and names what motion off it shows; ``layout`` places
the ZOIs of plates beside those of the specimen, ``plates`` measures the apparent motion on them. ``shutter`` removes
what reading line by line adds, for the time that ``readout`` finds; ``burst_motion`` is the error of an uneven motion
during a burst; ``lens`` the distortion, which ``shifts`` finds.
"""

from analysis.optics.lens import LENS_NAMES, LensCorrection, LensModel, LensReading, strain_of_shift
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
from analysis.optics.readout import Readout, ShutterCorrection, readout_of_bands, readout_of_motion
from analysis.optics.shifts import BurstMotion, LensFit, lens_of_shifts

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
