"""What every number of the results means, and in which unit it is kept."""

from __future__ import annotations

from dataclasses import dataclass

UNITLESS = ""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of the results.

    Attributes
    ----------
    name : str
        As in ``strain.h5``, without a unit.
    unit : str
        "px", "s", "N", "Pa", "GL" or "" (dimensionless).
    words : str
        Its definition.
    """

    name: str
    unit: str
    words: str

    @property
    def is_strain(self) -> bool:
        """A strain, a gradient or the uncertainty of one: what percent are made of."""
        plain = self.name.removeprefix("sigma_")
        return plain in _STRAINS or plain.startswith(_GAUGE)

    @property
    def turns(self) -> bool:
        """Changes its sign when the y axis is turned upwards."""
        return self.name in _TURNING


_STRAINS = ("exx", "eyy", "exy", "true_strain", "du_dx", "du_dy", "dv_dx", "dv_dy")
# One index y (of place or of displacement) changes the sign, two restore it.
_TURNING = ("v", "exy", "du_dy", "dv_dx", "y")

_FIELDS = (
    Quantity("u", "px", "displacement along x since the reference"),
    Quantity("v", "px", "displacement along y since the reference"),
    Quantity("du_dx", UNITLESS, "displacement gradient du/dx, fitted over the ZOI"),
    Quantity("du_dy", UNITLESS, "displacement gradient du/dy, fitted over the ZOI"),
    Quantity("dv_dx", UNITLESS, "displacement gradient dv/dx, fitted over the ZOI"),
    Quantity("dv_dy", UNITLESS, "displacement gradient dv/dy, fitted over the ZOI"),
    Quantity("exx", UNITLESS, "normal strain along x"),
    Quantity("eyy", UNITLESS, "normal strain along y"),
    Quantity("exy", UNITLESS, "shear strain, tensor component: half of the engineering shear gamma_xy"),
    Quantity("residual", UNITLESS, "variance left by the fit over that expected from the noise; about 1"),
    Quantity("status", UNITLESS, "0 where the ZOI has a value, else the reason why it has none"),
    Quantity("iterations", UNITLESS, "iterations of the fit"),
)
_PLACES = (
    Quantity("x", "px", "centre of the ZOI on the reference picture"),
    Quantity("y", "px", "centre of the ZOI on the reference picture"),
    Quantity("row", UNITLESS, "row of the ZOI in the grid, from 0"),
    Quantity("column", UNITLESS, "column of the ZOI in the grid, from 0"),
    Quantity("instant", UNITLESS, "number of the measurement in strain.h5, from 0"),
)
_INSTANTS = (
    Quantity("time", "s", "middle of the burst, since the start of the test"),
    Quantity("force", "N", "force at that time, tension positive; nan where it is not known"),
    Quantity("stress", "Pa", "force over the undeformed section"),
    Quantity("true_strain", UNITLESS, "logarithm of one plus the axial engineering strain"),
    Quantity(
        "true_stress", "Pa", "stress times one plus the axial engineering strain; volume taken as constant"
    ),
    Quantity("force_raw", "N", "force before the lag was taken off"),
    Quantity("zero", "N", "what tares had taken off the force by then"),
    Quantity("n_valid", UNITLESS, "ZOIs with a value"),
    Quantity("n_zoi", UNITLESS, "ZOIs asked for"),
    Quantity("noise", "GL", "temporal standard deviation of one frame; nan for a burst of one"),
    Quantity("frame", UNITLESS, "sequence number of the first frame of the burst"),
    Quantity("last_frame", UNITLESS, "sequence number of the last frame of the burst"),
    Quantity("n_frames", UNITLESS, "frames averaged"),
    Quantity("lost", UNITLESS, "frames lost or damaged since the burst before"),
    Quantity("duration", "s", "time of the last frame of the burst minus that of the first"),
    Quantity("kernel", "s", "time that the kernel took; nan where nobody measured it"),
    Quantity("latency", "s", "from the stamp of the last frame of the burst to the result; nan in a replay"),
)
_GAUGE = "gauge_"
_KNOWN = {q.name: q for q in (*_FIELDS, *_PLACES, *_INSTANTS)}

MEANS = {
    "time_s": "time", "force_N": "force", "stress_Pa": "stress", "true_stress_Pa": "true_stress",
    "force_raw_N": "force_raw", "zero_N": "zero", "noise_GL": "noise",
    "duration_s": "duration", "kernel_s": "kernel", "latency_s": "latency", "u_px": "u", "v_px": "v",
}  # fmt: skip
"""Columns of ``Strain.values`` whose name carries the unit, and the quantity each is; others have its name."""


def quantity_of(name: str) -> Quantity:
    """The quantity behind the name of a map or a column; one that is not known has no words."""
    plain = MEANS.get(name, name)
    if plain in _KNOWN:
        return _KNOWN[plain]
    gauge = plain.removeprefix("sigma_")
    if gauge.startswith(_GAUGE):
        words = f"strain of the virtual gauge {gauge.removeprefix(_GAUGE)!r}; nan where it was lost"
        return Quantity(
            plain, UNITLESS, words if plain == gauge else f"standard uncertainty (1 sigma) of {gauge}"
        )
    of = _KNOWN.get(plain.removeprefix("sigma_"))
    if of is None or not plain.startswith("sigma_"):
        return Quantity(plain, UNITLESS, "see docs/strain-format.md")
    return Quantity(plain, of.unit, f"standard uncertainty (1 sigma) of {of.name}")
