"""The rooms of the house as plain data: a new room is one line of ``ROOMS``."""

from __future__ import annotations

PACKAGES = ("acquire", "analysis", "hw_mocks", "live")

# Room -> what it may import besides itself: rooms by name, "*" for all. The longest name that fits a module is
# its room, so "acquire" is the ground floor of acquire (frame, errors, events ...), "analysis" is its face,
# and "live" holds the version. What a type checker alone imports counts too: a type is knowledge of a room.
ROOMS = {
    "acquire": "",
    "acquire.hdf5": "acquire",
    "acquire.files": "acquire",
    "acquire.burst": "acquire acquire.files",
    "acquire.camera": "acquire",
    "acquire.load_cell": "acquire",
    "acquire.protocols": "acquire",
    "acquire.opencv": "acquire acquire.camera acquire.files",
    "acquire.v4l2": "acquire acquire.camera acquire.opencv",
    "acquire.serial_line": "acquire acquire.load_cell acquire.protocols",
    "acquire.session": "acquire acquire.hdf5",
    "analysis.field": "",
    "analysis.compiled": "",
    "analysis.picture": "analysis.field analysis.compiled",
    "analysis.follow": "analysis.field analysis.compiled",
    "analysis.evaluate": "analysis.field",
    "analysis.paper_estimator": "analysis.field",
    "analysis.quality": "analysis.field analysis.picture",
    "analysis.fit": "analysis.field analysis.compiled analysis.picture",
    "analysis.self_test": "analysis.field analysis.compiled",
    "analysis.kernel": "analysis.field analysis.compiled analysis.picture analysis.fit analysis.follow"
    " analysis.self_test",
    "analysis": "analysis.field analysis.kernel analysis.self_test",
    "hw_mocks": "acquire acquire.camera acquire.load_cell",
    "live": "",
    "live.lines": "acquire",
    "live.measure": "acquire acquire.burst acquire.load_cell analysis analysis.field analysis.evaluate",
    "live.channels": "acquire live.measure",
    "live.setup": "acquire acquire.burst acquire.camera acquire.files acquire.hdf5 acquire.load_cell acquire.opencv"
    " analysis analysis.evaluate live.channels live.measure live.lines",
    "live.results": "acquire acquire.hdf5 analysis.evaluate analysis.field live.measure",
    "live.tell": "acquire acquire.load_cell analysis.evaluate live.measure live.setup",
    "live.maps": "acquire acquire.opencv analysis.field analysis.evaluate live.results",
    "live.specimen": "acquire acquire.burst acquire.files acquire.opencv analysis analysis.field analysis.quality"
    " live.measure live.setup",
    "live.check": "acquire acquire.camera acquire.load_cell analysis analysis.evaluate analysis.field analysis.picture"
    " analysis.quality live.measure live.setup live.specimen",
    "live.operate": "acquire live.lines live.measure",
    "live.pace": "",
    "live.view.exchange": "acquire analysis.field live.measure",
    "live.view.painting": "acquire live.measure live.view.exchange",
    "live.view.drawing": "acquire analysis.field live.lines live.maps live.measure live.view.exchange"
    " live.view.painting",
    "live.view": "acquire analysis.field live.measure live.pace live.view.exchange",
    "live.view.consumers": "acquire live.measure live.outputs live.tell live.view",
    "live.outputs": "acquire acquire.load_cell analysis live.measure live.pace live.results live.setup live.tell",
    "live.signals": "acquire acquire.serial_line live.channels live.lines live.measure live.outputs live.setup"
    " live.tell",
    "live.run": "acquire acquire.burst acquire.camera acquire.hdf5 acquire.load_cell acquire.session analysis"
    " analysis.evaluate live.channels live.measure live.operate live.pace live.setup"
    " live.tell live.outputs",
    "live.replay": "acquire acquire.burst acquire.camera acquire.files acquire.load_cell acquire.opencv"
    " acquire.protocols acquire.session analysis"
    " live.measure live.setup live.specimen live.tell live.outputs",
    "live.characterise": "acquire acquire.opencv analysis analysis.field analysis.picture analysis.paper_estimator"
    " hw_mocks live.maps live.measure",
    "live.characterise.experiments": "acquire analysis analysis.field analysis.picture analysis.paper_estimator"
    " hw_mocks live.maps live.characterise",
    "live.commands": "*",
    "live.cli": "acquire.errors acquire.printable live.commands.arguments live.commands.exit_codes live.unhurried",
    # A finished run is its results and its recording, or the images it measured.
    "live.finished": "acquire acquire.camera acquire.session analysis.evaluate analysis.field live.measure"
    " live.results live.setup",
    "live.export": "acquire analysis.field live.measure live.results live.maps live.finished",
    "live.report": "acquire analysis.field analysis.evaluate analysis.picture live.measure live.results live.maps"
    " live.tell live.setup live.finished live.export",
    "live.show": "acquire analysis analysis.field analysis.evaluate live.measure live.setup live.tell live.finished"
    " live.view live.view.exchange",
    "live.batch.work": "acquire acquire.camera acquire.files analysis.evaluate live.measure live.replay live.results"
    " live.setup live.tell",
    "live.batch.workers": "acquire analysis live.measure live.setup live.tell live.batch.work",
    "live.batch": "acquire acquire.files analysis live.measure live.replay live.setup live.tell live.batch.work"
    " live.batch.workers",
    "live.study": "acquire analysis.evaluate analysis.field analysis.quality live.measure live.replay live.setup",
    "live.serve.web": "acquire live.lines live.pace",
    "live.serve": "acquire acquire.camera acquire.files analysis.field analysis.evaluate live.measure live.setup"
    " live.specimen live.check live.maps live.pace live.operate live.tell live.outputs live.serve.web",
}
# Rooms that have their line before they have a folder.
TO_COME: set[str] = set()
# The one door to the simulated devices; it stands in one module, not in its whole room.
DOORS = {"live.setup.rig": "hw_mocks"}

# What is started by a command alone: no other room's line may name these (a batch replays).
STARTED = {
    "live.commands", "live.run", "live.replay", "live.check", "live.characterise", "live.batch", "live.study",
    "live.serve",
}  # fmt: skip
# The page judges the still specimen as the check does.
MAY_START = {
    "live.batch": {"live.replay"}, "live.batch.work": {"live.replay"}, "live.study": {"live.replay"},
    "live.serve": {"live.check"}, "live.characterise.experiments": {"live.characterise"},
}  # fmt: skip

# Library -> the rooms that alone import it.
LIBRARIES = {
    "ctypes": "acquire.v4l2",
    "distributed": "live.batch.workers",
    "cv2": "acquire analysis.follow",
    "fcntl": "acquire.v4l2",
    "h5py": "acquire.hdf5 acquire.session live.results",
    "llvmlite": "analysis.compiled",
    "matplotlib": "live.characterise",
    "rerun": "live.view.drawing",
    "serial": "acquire.serial_line",
    "tifffile": "live.export",
    "PIL": "live.export",
    "shtab": "live.commands",
    "tomlkit": "live.setup",
}
# Room (and all in it) -> what it never imports.
NEVER = {
    # The numerics touch no file, thread, device or clock, and draw nothing.
    "analysis": "threading multiprocessing subprocess socket time datetime io rerun serial h5py asyncio queue"
    " select matplotlib",
    # The one path of live and replay: no thread, file, device or clock.
    "live.measure": "threading multiprocessing subprocess socket time datetime io os pathlib tempfile shutil rerun"
    " serial h5py cv2 asyncio queue select",
    # A session of somebody else is data: nothing of it is executed.
    "acquire": "pickle marshal shelve dill",
    "hw_mocks": "pickle marshal shelve dill",
    "live": "pickle marshal shelve dill",
}  # fmt: skip
# Where a room may have what the house around it does without, and what for.
EXCEPT = {"analysis.compiled": "threading multiprocessing"}  # locks of the loops; no thread and no process
# Numba takes half a second to import: loaded with these rooms (and */*_loops.py), by others when first used.
COMPILED = ("analysis.compiled", "analysis.picture", "analysis.fit", "analysis.follow")
# Whose modules may read another's private attributes: numba's cache has no public face.
PRIVATE = ("analysis.compiled",)
# More than MOST_FILES files: one file a protocol, one a command; the mocks stay flat.
MANY_FILES = {"acquire.protocols", "hw_mocks", "live.commands"}
MOST_FILES = 16
MOST_LINES = 370
