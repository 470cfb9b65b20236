"""Who may import whom, as plain data. A new package is one line here."""

from __future__ import annotations

PACKAGES = ("acquire", "analysis", "hw_mocks", "live", "phasedic")

# Package -> what it may import besides itself. A line also covers the sub-packages that have none of
# their own. Imports for a type checker count too.
ACQUIRE = {
    "acquire.text": "",
    "acquire": "acquire.text",  # frame, errors, events, addresses ...
    "acquire.hdf5": "acquire acquire.text",
    "acquire.files": "acquire acquire.text",
    "acquire.burst": "acquire acquire.text acquire.files",
    "acquire.camera": "acquire acquire.text",
    "acquire.load_cell": "acquire acquire.text acquire.files",
    "acquire.protocols": "acquire acquire.text",
    "acquire.opencv": "acquire acquire.text acquire.camera acquire.files",
    "acquire.v4l2": "acquire acquire.text acquire.camera acquire.opencv",
    "acquire.genicam": "acquire acquire.text acquire.camera",
    "acquire.pylon": "acquire acquire.text acquire.camera acquire.genicam",
    "acquire.serial_line": "acquire acquire.text acquire.load_cell acquire.protocols",
    "acquire.session": "acquire acquire.text acquire.hdf5",
}
ANALYSIS = {
    "analysis.field": "acquire.text",
    "analysis.compiled": "acquire.compiled_loops",
    "analysis.picture": "analysis.field analysis.compiled",
    "analysis.follow": "analysis.field analysis.compiled",
    "analysis.evaluate": "analysis.field analysis.compiled acquire.text",
    "analysis.optics": "analysis.field analysis.evaluate acquire.text",
    "analysis.quality": "analysis.field analysis.picture",
    "analysis.fit": "analysis.field analysis.compiled analysis.picture",
    "analysis.self_test": "analysis.field analysis.compiled acquire acquire.text",
    "analysis.kernel": "analysis.field analysis.compiled analysis.picture analysis.fit analysis.follow"
    " analysis.self_test acquire.text",
    "analysis": "analysis.field analysis.kernel analysis.self_test",
}
# From the bottom to the top: each may import those before it, and acquire and analysis.
LIVE = (
    "live.words",
    "live.config",
    "live.pipeline",
    "live.stream",
    "live.results",
    "live.setup",
    "live.run",
    "live.replay",
    "live.ui",
    "live.commands",
)
SIDE_BY_SIDE = {"live.replay": "live.run"}
LAYERS = {
    **ACQUIRE,
    **ANALYSIS,
    "hw_mocks": "acquire acquire.text acquire.camera acquire.load_cell",
    "live": "",  # the version
    "phasedic": "*",  # the public names of all others
    "live.__main__": "live.cli",
    **{
        layer: " ".join(
            [
                *ACQUIRE,
                *ANALYSIS,
                "live",
                *(below for below in LIVE[:i] if below not in SIDE_BY_SIDE.get(layer, "").split()),
            ]
        )
        for i, layer in enumerate(LIVE)
    },
    "live.cli": "acquire.errors acquire.text acquire.text.message live.commands.arguments"
    " live.commands.process live.words.language",
}
# One module opens the simulated devices. The demo compares with their truth; the examples have simulated pictures.
EXCEPTIONS = {
    "live.setup.devices": "hw_mocks",
    "live.commands.demo": "hw_mocks",
    "live.commands.examples": "hw_mocks",
}

# Library -> the packages that alone import it.
LIBRARIES = {
    "ctypes": "acquire acquire.genicam acquire.v4l2 analysis.compiled",
    "distributed": "live.replay",
    "cv2": "acquire analysis.follow",
    "fcntl": "acquire.v4l2",
    "h5py": "acquire.hdf5 acquire.session live.results",
    "llvmlite": "analysis.compiled",
    "pypylon": "acquire.pylon",
    "rerun": "live.ui",
    "serial": "acquire.serial_line",
    "tomlkit": "live.config",
}
# Package, and all in it -> what it never imports.
NEVER = {
    # The numerics use no file, thread, device or clock, and draw nothing.
    "analysis": "threading multiprocessing subprocess socket time datetime io rerun serial h5py asyncio queue"
    " select matplotlib",
    # A session of somebody else is data: nothing of it is executed.
    "acquire": "pickle marshal shelve dill",
    "hw_mocks": "pickle marshal shelve dill",
    "live": "pickle marshal shelve dill",
}  # fmt: skip
# The measuring path of live and replay: no thread, file, device or clock.
MEASURING = (
    "live.pipeline.measure",
    "live.pipeline.measurement",
    "live.pipeline.reference",
    "live.setup.dry_run",
)
NEVER_MEASURING = (
    "threading multiprocessing subprocess socket time datetime io os pathlib tempfile shutil rerun serial h5py cv2"
    " asyncio queue select"
)
NEVER |= dict.fromkeys(MEASURING, NEVER_MEASURING)
# What a package may import all the same, and what for.
EXCEPT = {"analysis.compiled": "threading multiprocessing"}  # locks, and no thread or process
# Numba takes half a second to import: these packages (and */*_loops.py) import it, others when first used.
COMPILED = ("analysis.compiled", "analysis.picture", "analysis.fit", "analysis.follow")
# These modules may read private attributes: numba's cache and the actions of argparse have no public interface.
PRIVATE = (
    "analysis.compiled",
    "acquire.compiled_loops",
    "live.commands.arguments",
    "live.commands.completion",
)
# One file a protocol, one a command; the mocks stay flat.
MANY_FILES = {"acquire.protocols", "hw_mocks", "live.commands"}
MAX_FILES = 15
MAX_LINES = 400
