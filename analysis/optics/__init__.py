"""What the camera adds to the motion of a plane, and how it is removed.

``plane`` is the apparent motion of a rigid plane in pictures, ``layout`` places the ZOIs of plates beside those of the
specimen, ``plates`` measures the apparent motion on them. ``shutter`` removes
what reading line by line adds.
"""

from analysis.optics.layout import Box, PlateLayout, without_plates
from analysis.optics.plane import MODELS, NAMES, SCALE, ApparentMotion, Model
from analysis.optics.plates import ASSUMED_TILT, ChosenModel, PlateFit, choose_model, trouble
from analysis.optics.shutter import ShutterCorrection

__all__ = [
    "ASSUMED_TILT",
    "MODELS",
    "NAMES",
    "SCALE",
    "ApparentMotion",
    "Box",
    "ChosenModel",
    "Model",
    "PlateFit",
    "PlateLayout",
    "ShutterCorrection",
    "choose_model",
    "trouble",
    "without_plates",
]
