"""Everything at once in real time: gauges, alarm, outputs, orders; values against the truth, and replayed."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from acquire.events import EventKind
from hw_mocks.pty_port import PtyPort
from live.cli import main
from live.operate import OrderPort
from live.tell import TerminalScreen
from tests.live.lines.test_server import Caller
from tests.live.signals.test_strain_out import Listener, free_port, read
from tests.live.test_end_to_end import live_run

CAMERA = "sim:uniform?seconds=6&fps=30&buffers=64&width=224&height=192&bits=12&hold=1.5"
GAUGES = {
    "axial": {"kind": "line", "start": [112, 40], "end": [112, 150]},
    "across": {"kind": "transverse", "box": [40, 60, 140, 70]},
    "middle": {"kind": "zoi", "at": [112, 96]},
    "part": {"kind": "area", "box": [60, 60, 100, 70]},
}


def test_a_test_with_all_that_there_is(tmp_path: Path) -> None:
    folder, again, port, serial = tmp_path / "run", tmp_path / "again", free_port(), PtyPort()
    orders, listeners, answers = (
        OrderPort("0", None, TerminalScreen(quiet=True)),
        list[Listener](),
        list[str](),
    )

    def order(live: Any, m: Any) -> None:
        if m.number == 3:
            listeners.append(Listener(port))
        if m.number == 20:
            caller = Caller(orders.open(live))
            answers.extend(caller.ask(line) for line in ("note half way", "start", "alarm off"))
            caller.close()

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        more = {
            "gauges": GAUGES,
            "alarm": [{"channel": "gauge_axial", "above": 0.003, "name": "limit"}],
            "strain_out": {
                "tcp": str(port), "udp": f"127.0.0.1:{udp.getsockname()[1]}", "serial": serial.path
            },
            "specimen.area_mm2": 40.0,
            "specimen.standard": "iso6892",
            "record.armed": False,
            "measure.reference_burst": 16,
            "measure.burst": 2,
        }  # fmt: skip
        outcome = live_run(folder, CAMERA, each=order, **more)
        first = json.loads(udp.recv(1000))
    orders.close()
    listeners[0].join(5)
    got = [said for _, said in listeners[0].got]
    assert len(got) > 40 and first["gauge_axial"] is not None
    assert json.loads(read(serial, 1)[0])["frame"] == first["frame"]
    serial.close()
    assert answers[0] == "ok" and answers[1] == "no: recording already"
    came = [e for e in outcome.books.journal.events() if e.kind is EventKind.ALARM and e.data.get("on")]
    assert [event.data["alarm"] for event in came] == ["limit"]
    _against_the_truth(outcome)
    replay = [
        "replay",
        str(folder / "session.h5"),
        "--as-measured",
        "--out",
        str(again),
        "--no-view",
        "--no-rrd",
    ]
    assert main(replay) == 0
    with h5py.File(folder / "strain.h5") as one, h5py.File(again / "strain.h5") as other:
        for name in (
            *(f"gauge_{gauge}" for gauge in GAUGES),
            "eyy",
            "sigma_eyy",
            "force_N",
            "true_stress_Pa",
        ):
            np.testing.assert_array_equal(one["entry/mean"][name][()], other["entry/mean"][name][()], name)


def _against_the_truth(outcome: Any) -> None:
    """The gauges within 1 % and five sigma."""
    specimen, instants = outcome.rig.specimen, outcome.books.history.instants
    reference = next(e for e in outcome.books.journal.events() if e.kind is EventKind.REFERENCE)
    assert specimen.axial_strain(specimen.elapsed(reference.t)) < 1e-5, "the reference was taken late"
    t = specimen.elapsed(np.array([i.t for i in instants]))
    for name, truth in (
        ("axial", specimen.axial_strain(t)),
        ("part", specimen.axial_strain(t)),
        ("across", specimen.transverse_strain(t)),
    ):
        values = np.array([i.gauges[name].value for i in instants])
        sigmas = np.array([i.gauges[name].sigma for i in instants])
        assert (np.abs(values - truth) < 0.01 * np.abs(truth) + 5 * sigmas).all(), name
