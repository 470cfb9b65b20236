"""Run the GenICam tests, or any command, in a network of its own, so that nothing leaves the machine.

    python -m tests.genicam.namespace --tests [PYTEST ARGUMENT ...]
    python -m tests.genicam.namespace -- COMMAND [ARG ...]

``--tests`` fails on a failure, on a skip, or when nothing ran. Needs the Aravis library, which is installed with
apt-get where it is missing, and root or name spaces for users.
"""

from __future__ import annotations

import argparse
import ctypes
import fcntl
import os
import socket
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.v4l2.vm import NoMachine, count, run

PROJECT = Path(__file__).resolve().parents[2]
LIBRARY, PACKAGE = "libaravis-0.8.so.0", "libaravis-0.8-0"
SIOCSIFFLAGS, SIOCSIFADDR, IFF_UP, IFF_RUNNING = 0x8914, 0x8916, 0x1, 0x40
SECOND = "127.0.0.2"  # of a second camera
NO_NETWORK = 125


def install() -> None:
    """Make sure the library is there."""
    try:
        ctypes.CDLL(LIBRARY)
    except OSError:
        root = [] if os.geteuid() == 0 else ["sudo", "-n"]
        run(*root, "apt-get", "update", "-qq")
        quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
        run(*root, "apt-get", "install", "-y", "-qq", "--no-install-recommends", PACKAGE, env=quiet)


def inside(command: list[str]) -> int:
    """Run the command in a new network; its exit status."""
    unshare = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--net", "--map-root-user"]
    environment = {**os.environ, "PHASEDIC_IN_NAMESPACE": "1"}
    words = [*unshare, sys.executable, "-m", "tests.genicam.namespace", "--up", "--", *command]
    return subprocess.run(words, env=environment, check=False).returncode


def raise_loop_back() -> None:
    """A new network has its loop-back switched off; give it a second address too."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        address = struct.pack("16sHH4s8x", b"lo:1", socket.AF_INET, 0, socket.inet_aton(SECOND))
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sh", b"lo", IFF_UP | IFF_RUNNING))
        fcntl.ioctl(any_socket, SIOCSIFADDR, address)


def run_tests(extra: list[str]) -> int:
    """The suite, and what its outcome means."""
    with tempfile.TemporaryDirectory(prefix="phasedic-genicam-") as scratch:
        report = Path(scratch) / "report.xml"
        folder = str(PROJECT / "tests/genicam/inside")
        pytest = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", f"--junit-xml={report}"]
        status = inside([*pytest, *(extra or [folder])])
        found = count(report)
    print(f"genicam-test: {found.ran} tests ran; {found.failed} failed, {found.skipped} were skipped")
    if not status and (found.skipped or not found.ran):
        print("genicam-test: a test that does not run counts as failed", file=sys.stderr)
        return 1
    return status


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="namespace", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tests", action="store_true", help="run the suite of this folder")
    parser.add_argument("--up", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("words", nargs="*", metavar="COMMAND | PYTEST ARGUMENT")
    options = parser.parse_args()
    if options.up:
        raise_loop_back()
        os.execvp(options.words[0], options.words)
    try:
        install()
    except NoMachine as error:
        print(f"genicam-test: the library cannot be installed: {error}", file=sys.stderr)
        return NO_NETWORK
    return run_tests(options.words) if options.tests else inside(options.words)


if __name__ == "__main__":
    sys.exit(main())
