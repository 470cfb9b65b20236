"""What the system, the shell or a file refuses: one message that says what to do, an exit code, and no traceback."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from acquire.system import HANGUP, signal_handler
from hw_mocks.specimen import KINDS
from live import cli
from live.cli import main
from live.commands import arguments as arguments_module
from live.commands.arguments import COMMANDS, full_parser, parse, subparsers
from live.commands.demo import SPECIMENS
from live.commands.process import ended_by_sigterm, interrupts
from tests.adversary.test_terminal import HOSTILE
from tests.live.ended import code_of
from tests.live.made_run import make_run

ROOT = Path(__file__).parents[3]


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    """Exit code and message of a command that must not end with a traceback."""
    capsys.readouterr()
    code = code_of(list(words))
    said = "".join(capsys.readouterr())
    assert "Traceback" not in said and "please report it" not in said, said
    return code, said


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("run", 2, "no camera is given"),
        ("run --camera /dev/video77", 3, "/dev/video77"),
        (
            "run --camera firewire:0",
            2,
            "known: /dev/..., files:, genicam:, opencv:, pylon:, session:, video:, sim:",
        ),
        ("run --camera sim: --burst 0", 2, "burst"),
        ("run --camera sim:?lockstep=yes --roi 600,0,100,100", 2, "leaves the picture"),
        ("run --camera sim: --config nowhere.toml", 2, "no such configuration file"),
        ("run --camera sim:?lockstep=yes --load /dev/ttyUSB77", 3, "/dev/ttyUSB77"),
        ("replay files:nowhere/*.tif", 4, "nowhere"),
        ("replay nowhere.h5", 4, "no such file"),
        (
            "check --camera sim: --snapshot nowhere/x.png",
            2,
            "nowhere/x.png: there is no folder nowhere; make it",
        ),
        ("sides . ../HERE", 2, "as front and as back"),
        # words that are empty
        ("run --camera sim: --out ''", 2, "is empty; give a value, or leave it out"),
        ("run --camera ''", 2, "is empty; give a value, or leave it out"),
        ("replay ''", 2, "is empty; give a value, or leave it out"),
        ("map run ''", 2, "is empty; give a value, or leave it out"),
        ("batch '' --out a", 2, "is empty; give a value, or leave it out"),
        ("check --config ''", 2, "is empty; give a value, or leave it out"),
        # options without effect; those for experts are accepted without their help
        ("check --camera sim:?fsp=1 --report", 2, "unrecognized arguments"),
        ("check --camera sim:?fsp=1 --standard=free", 2, "unrecognized arguments"),
        ("check --camera sim:?fsp=1 --strain=green", 2, "unrecognized arguments"),
        ("page --camera sim:?fsp=1 --report", 2, "unrecognized arguments"),
        ("run --camera sim:?fsp=1 --window tukey", 2, "unknown setting 'fsp'"),
        # slips of the keys
        ("rnu --camera sim:", 2, "there is no command 'rnu' (did you mean run?)"),
        ("reprot --camera sim:", 2, "(did you mean report?)"),
        ("qqqqqq --camera sim:", 2, "there is no command 'qqqqqq'; "),
        ("run --camra sim:", 2, "(did you mean --camera?)"),
        ("replay shots --zio=32", 2, "(did you mean --zoi?)"),
        ("run --camera sim:unifrom", 2, "(did you mean uniform?)"),
        ("run --camera sim:?noize=1", 2, "(did you mean noise?)"),
        ("run --camera opncv:0", 2, "(did you mean opencv?)"),
    ],
)
def test_what_is_typed_is_refused_with_what_to_do(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: str, code: int,
    message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    found, said = refused(capsys, *shlex.split(words.replace("HERE", tmp_path.name)))
    assert found == code and message in said
    assert not list(tmp_path.rglob("session.h5"))


LONG = "x" * 300
OF_A_FILE = [
    ("replay", LONG),
    ("replay", "~nosuchuser/session.h5"),
    ("replay", "files:~nosuchuser/*.tif"),
    ("replay", "video:~nosuchuser/film.mp4"),
    ("batch", "~nosuchuser/session.h5", "--out", "out"),
    ("batch", LONG, "--out", "out"),
    ("report", LONG),
    ("show", LONG),
    ("export", LONG, "--to", "csv"),
    ("map", LONG, "map.png"),
    ("recover", LONG),
    ("run", "--camera", "sim:", "--config", LONG),
    ("check", "--camera", "sim:", "--snapshot", f"{LONG}.png"),
    ("init", f"{LONG}.toml", "--camera", "sim:"),
    ("scale", "--camera", "sim:", "--config", LONG, "--points", "1,1,9,9", "--length", "1"),
    ("study", LONG),
    ("inspect", LONG, "--zoi", "1,1", "--frame", "0"),
]


@pytest.mark.parametrize("words", OF_A_FILE, ids=lambda words: " ".join(words)[:40])
def test_names_that_cannot_be(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    code, said = refused(capsys, *words)
    assert code in (2, 4), said
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
@pytest.mark.parametrize(
    "words", [("export", "RUN", "--to", "csv"), ("report", "RUN"), ("map", "RUN", "RUN/a.png")]
)
def test_a_folder_of_somebody_else(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...]
) -> None:
    run = make_run(tmp_path / "run")
    run.chmod(0o500)
    try:
        code, said = refused(capsys, *(word.replace("RUN", str(run)) for word in words))
    finally:
        run.chmod(0o700)
    assert code == 4 and "ermission denied" in said


@pytest.mark.parametrize("command", [("run", "--camera", "sim:?fsp=1"), ("demo",), ("replay", "SHOTS")])
def test_a_folder_that_is_taken_is_refused_first(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, command: tuple[str, ...]
) -> None:
    """Before a camera is opened or anything is compiled."""
    import cv2

    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((64, 64), np.uint8))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "strain.h5").touch()
    (tmp_path / "file").touch()
    words = [word.replace("SHOTS", f"files:{tmp_path}/a.png") for word in command]
    for out, why in (("out", "already holds strain.h5"), ("file/below", "cannot be made (Not a directory)")):
        code, said = refused(capsys, *words, "--out", str(tmp_path / out))
        assert code == 2 and why in said


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("NUMBA_THREADING_LAYER", "zz"),
        ("NUMBA_THREADING_LAYER", ""),
        ("NUMBA_THREADING_LAYER_PRIORITY", "omp"),
    ],
)
def test_a_threading_layer_that_numba_cannot_load(name: str, value: str) -> None:
    """In a process of its own: numba chooses its layer once."""
    done = subprocess.run(
        [sys.executable, "-m", "live.cli", "devices"],
        cwd=ROOT, env={**os.environ, name: value}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith(f"phasedic: {name}={value} is not possible (")
    assert done.stderr.endswith("); give omp or workqueue, or unset it\n")


REFUSED_SOON = [
    "run",
    "run --camera firewire:0",
    "run --camera /dev/video77",
    "run --camera sim: --load /dev/ttyUSB77",
    "run --camera sim: --zoi 3",
    "check --camera sim: --load /dev/ttyUSB77",
    "demo --specimen xx",
    "demo --out .",
    "replay nowhere.h5",
    "replay files:nowhere/*.tif",
    "batch nowhere.h5 --out x",
    "study nowhere.h5",
    "map nowhere a.png",
    "show nowhere",
    "export nowhere --to csv",
    "report nowhere",
    "inspect nowhere.h5 --zoi 1,1 --frame 0",
    "load-check --load /dev/ttyUSB77",
    "recover nowhere.h5 --out r.h5",
]
AND_LIBRARIES = """
import sys
from live.cli import main
for line in sys.argv[1:]:
    try:
        code = main(line.split())
    except SystemExit as ended:
        code = ended.code
    print(f"{line}: {code}", *({"numba", "scipy", "matplotlib", "rerun"} & set(sys.modules)))
"""


def test_refusals_load_no_slow_library(tmp_path: Path) -> None:
    """Each of them takes half a second or more to load, which is how long a refusal may take."""
    (tmp_path / "strain.h5").touch()
    done = subprocess.run(
        [sys.executable, "-c", AND_LIBRARIES, *REFUSED_SOON],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    endings = [line.rpartition(": ")[2] for line in done.stdout.splitlines() if ": " in line]
    assert len(endings) == len(REFUSED_SOON), done.stderr
    assert set(endings) <= {"2", "3", "4"}, done.stdout


@pytest.mark.parametrize("name", ["run", "check"])
def test_a_port_that_is_not_there_is_refused_before_the_camera_opens(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    opened: list[object] = []
    monkeypatch.setattr("live.setup.devices.open_camera", lambda *words: opened.append(words))
    code, said = refused(capsys, name, "--camera", "/dev/video0", "--load", "/dev/ttyUSB77?unit=N")
    assert code == 3 and "/dev/ttyUSB77: there is no such port; " in said
    assert opened == []


def test_the_specimens_of_the_demo_are_those_of_the_simulator() -> None:
    assert set(SPECIMENS) == set(KINDS)


def test_escapes_in_a_title_are_shown(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    run = make_run(tmp_path / "run")
    assert refused(capsys, "map", str(run), str(tmp_path / "a.png"), "--title", HOSTILE)[0] == 0
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_a_pipe_in_the_place_of_the_recording_holds_nothing_up(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    run = make_run(tmp_path / "run", session=False)
    os.mkfifo(run / "session.h5")
    assert refused(capsys, "report", str(run))[0] == 0
    assert (run / "report.html").exists()


def test_a_folder_whose_name_reads_as_settings(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    run = make_run(tmp_path / "a&b?c=d")
    code, said = refused(capsys, "replay", f"{run}/session.h5", "--from", "99")
    assert "unknown setting" not in said and "no such session" not in said
    assert code == 4 and f"{run}/session.h5: of the burst of frames 0 to 7 only 2 of 8 are recorded" in said


@pytest.mark.parametrize("part", ["the whole", "one picture", "the events"])
@pytest.mark.parametrize(
    "command",
    [
        ("report", "RUN"),
        pytest.param(("export", "RUN", "--to", "png"), marks=pytest.mark.slow),
        ("export", "RUN", "--to", "r3xa"),
    ],
)
def test_results_do_not_need_the_recording(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, command: tuple[str, ...], part: str
) -> None:
    """strain.h5 is whole: a damaged session.h5 costs its pictures and events, and a note says so."""
    import h5py

    run = make_run(tmp_path / "run")
    path = run / "session.h5"
    content = bytearray(path.read_bytes())
    with h5py.File(path) as file:
        name, numbers = ("frames/image", (0, 1)) if part == "one picture" else ("events", (0,))
        chunks = [file[f"entry/{name}"].id.get_chunk_info(number) for number in numbers]
    places = [slice(chunk.byte_offset, chunk.byte_offset + 11) for chunk in chunks]
    for at in [slice(0, 48)] if part == "the whole" else places:
        content[at] = bytes(b ^ 0xFF for b in content[at])
    path.write_bytes(content)
    code, said = refused(capsys, *(word.replace("RUN", str(run)) for word in command))
    assert code == 0, said
    needed = (
        command[0] == "report"
        or part in {"png": ("the whole", "one picture"), "r3xa": ("the whole",)}[command[-1]]
    )
    assert ("note: the recording cannot be read, the results can: " in said) is needed, said


@pytest.mark.parametrize("number", [signal.SIGTERM, *HANGUP])
def test_sigterm_and_hangup_end_a_command_without_a_handler_of_its_own(
    number: signal.Signals, capsys: pytest.CaptureFixture[str]
) -> None:
    def command(arguments: object) -> int:
        os.kill(os.getpid(), number)
        threading.Event().wait(60)
        return 0

    before = signal.signal(number, signal.SIG_DFL)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(cli, "parse", lambda words: (command, arguments_module.argparse.Namespace()))
        assert main(["devices"]) == 130
    assert capsys.readouterr().err == "phasedic: interrupted\n"
    assert signal.signal(number, before) is signal.SIG_DFL


def test_nohup_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    with signal_handler(signal.SIG_IGN, *HANGUP), ended_by_sigterm():
        os.kill(os.getpid(), *HANGUP)


def test_sigterm_is_no_ctrl_c() -> None:
    """Ctrl-C ends ``check --watch`` with a full check; SIGTERM ends it."""
    with ended_by_sigterm(), interrupts() as stop:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        assert not stop.is_set()
        signal.raise_signal(signal.SIGINT)
        assert stop.is_set()


@pytest.mark.parametrize("name", ["run", "replay", "check"])
def test_expert_options_are_in_the_long_help(capsys: pytest.CaptureFixture[str], name: str) -> None:
    short, long = (refused(capsys, name, word)[1] for word in ("--help", "--help-all"))
    for option in ("--window", "--bending", "--estimator", "--noise"):
        assert option in long and option not in short
    for option in ("--zoi", "--config", "--roi", "--help-all"):
        assert option in long and option in short
    assert len(short.splitlines()) < 0.8 * len(long.splitlines())


@pytest.mark.parametrize(
    ("language", "usage", "missing", "unknown"),
    [
        ("en", "usage: ", "the following arguments are required: ", "unrecognized arguments: --no"),
        ("de", "Aufruf: ", "diese Argumente fehlen: ", "unbekannte Argumente: --no"),
        ("fr", "usage : ", "arguments manquants : ", "arguments inconnus : --no"),
    ],
)
def test_the_words_of_argparse_are_in_the_language_of_the_terminal(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    language: str,
    usage: str,
    missing: str,
    unknown: str,
) -> None:
    monkeypatch.setenv("LC_ALL", f"{language}_XX.UTF-8")
    code, said = refused(capsys, "map")
    assert code == 2 and usage in said and missing in said
    code, said = refused(capsys, "devices", "--no")
    assert code == 2 and unknown in said


def test_a_second_file_or_device_of_one_option_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = refused(capsys, "run", "--load", "sim:", "--camera=sim:", "--load", "/dev/ttyUSB0")
    assert code == 2 and "--load is given twice" in said
    code, said = refused(
        capsys, "run", "--camera", "sim:unifrom", "--camera=sim:unifrom", "--meta", "a=1", "--meta", "b=2"
    )
    assert code == 2 and "given twice" not in said
    _, settings = parse(["run", "--camera", "sim:", "--zoi", "32", "--zoi", "48"])
    assert vars(settings)["measure.zoi"] == 48, "of a setting the last one counts"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_number_on_the_command_line_has_bounds(name: str) -> None:
    """What float and int take alone: nan, inf, and a rate of 0 that something is divided by."""
    parser = subparsers(full_parser([name])).choices[name]
    free = [one.option_strings for one in parser._actions if one.type in (int, float) and not one.choices]
    assert free == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        *((f"png --limit {limit}", "give a number above 0") for limit in ("0", "nan", "-1", "inf")),
        ("npz --layout=wide", "--layout has no effect with --to npz"),
        ("csv --fps=5", "--fps has no effect with --to csv"),
        ("vtk --limit=1", "--limit has no effect with --to vtk"),
        ("mat --no-picture", "--no-picture has no effect with --to mat"),
    ],
)
def test_options_of_an_export_that_cannot_be(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: str, message: str
) -> None:
    code, said = refused(capsys, "export", str(make_run(tmp_path, [0.0])), "--to", *words.split())
    assert code == 2 and message in said and not (tmp_path / "export").exists()
