#!/usr/bin/env python3
"""Run a command in a fresh clone on a bare Debian, as an ordinary user: what somebody has who just cloned it.

    machine.py [--suite forky] -- make demo test

Bare means: Debian's minimal root file system with python3, venv, make and git, and nothing else: no
compiler, no OpenMP, no browser, no fonts, no display. It is made on the spot with debootstrap (about a
minute, 350 MB) and goes afterwards, with all that was written in it; ``--root FOLDER`` keeps it there, clone
included, and takes it again. The clone is of the commit that is checked out. The command sees the host's
devices and network, but has processes and mounts of its own: nothing stays mounted or running, whatever happens.

The exit status is the command's own, or 125 with the reason where no machine could be made. Needs root and
Debian's debootstrap. Nothing but the standard library is used, since this runs before any environment exists.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
SCRIPTS = Path("/usr/share/debootstrap/scripts")
PLACE = Path("/var/tmp")  # on the disk, where /tmp may be memory
NO_MACHINE = 125
PYTHONS = {"trixie": "3.13", "forky": "3.14"}

PACKAGES = ("python3", "python3-venv", "make", "git", "ca-certificates")
USER = "user"
CLONE = f"/home/{USER}/phasedic"
CERTIFICATES = "etc/ssl/certs/ca-certificates.crt"
# How the host reaches the network holds inside too: names, certificates, proxy, package index.
FROM_HOST = ("etc/resolv.conf", "etc/hosts", "etc/pip.conf", CERTIFICATES)
PASSED_ON = re.compile(r"TERM|(https?|no|all)_proxy|PIP_(INDEX_URL|DEFAULT_TIMEOUT)", re.IGNORECASE)

# Runs in name spaces of its own, as the first process there: what is mounted or started ends with it.
INSIDE = """
set -e
root=$1 user=$2 folder=$3; shift 3
mount --make-rprivate /
mount -t proc proc "$root/proc"
for place in dev sys; do mount --rbind "/$place" "$root/$place"; done
set +e
chroot --userspec="$user:$user" "$root" /usr/bin/env --ignore-environment --chdir="$folder" "$@"
"""


class NoMachine(Exception):
    """Why there is no bare machine, and what would help."""


def run(*words: str | Path) -> str:
    """A command's output; ``NoMachine`` with its last words when it fails."""
    argv = [str(word) for word in words]
    done = subprocess.run(argv, text=True, capture_output=True, check=False)
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        raise NoMachine(f"`{shlex.join(argv)}` failed: {last}")
    return done.stdout


# The root file system


@dataclass(frozen=True)
class Machine:
    """A bare root file system: which Debian it is, where it lies, and where its packages come from."""

    suite: str
    root: Path
    mirror: str


def refuse_without_means() -> None:
    """Say what is missing before anything is made.

    Raises
    ------
    NoMachine
        Not Linux, not root, or no debootstrap.
    """
    if sys.platform != "linux":
        raise NoMachine("it needs Linux")
    if os.geteuid() != 0:
        raise NoMachine("only root may make one; try `sudo make bare-test`")
    if not shutil.which("debootstrap"):
        raise NoMachine("debootstrap is missing; `apt-get install debootstrap` installs it")


def mirror() -> str:
    """Debian's package mirror as apt has it.

    Raises
    ------
    NoMachine
        apt is not there, or has no mirror of Debian.
    """
    sites: list[str] = []
    with contextlib.suppress(NoMachine, FileNotFoundError):
        sites = run("apt-get", "indextargets", "--format", "$(SITE)", "Created-By: Packages").split()
    for site in sites:
        if site.rstrip("/").endswith("/debian"):
            return site
    raise NoMachine(
        "apt has no mirror of Debian; `apt-get update` on a Debian machine shows whether it has one"
    )


def recipe(suite: str) -> list[str | Path]:
    """Debian's releases are all made in one way; a debootstrap older than the release lacks its name alone."""
    return [] if (SCRIPTS / suite).exists() else [SCRIPTS / "sid"]


def make(machine: Machine) -> None:
    """Fill an empty folder with a bare Debian and an ordinary user."""
    print(f"bare: making Debian {machine.suite} from {machine.mirror} ...", flush=True)
    variant = ("--variant=minbase", f"--include={','.join(PACKAGES)}")
    run("debootstrap", *variant, machine.suite, machine.root, machine.mirror, *recipe(machine.suite))
    run("chroot", machine.root, "useradd", "--create-home", "--shell", "/bin/bash", USER)


def take_from_host(root: Path) -> None:
    """Copy the host's way to the network; what the host does not have is left as it is."""
    for name in FROM_HOST:
        with contextlib.suppress(FileNotFoundError):
            shutil.copyfile(f"/{name}", root / name)


@contextlib.contextmanager
def ready(machine: Machine) -> Iterator[Machine]:
    """The machine in a folder of its own that goes afterwards, or made once in the one that was given."""
    with contextlib.ExitStack() as kept:
        if not machine.root.name:
            scratch = kept.enter_context(tempfile.TemporaryDirectory(prefix="phasedic-bare-", dir=PLACE))
            machine = Machine(machine.suite, Path(scratch), machine.mirror)
            machine.root.chmod(0o755)  # its user has to come in
        if not (machine.root / "home" / USER).exists():
            make(machine)
        yield machine


# The clone and the command


def clone(root: Path) -> None:
    """A clone of the commit that is checked out, which belongs to the user; one that is there stays."""
    place = root / CLONE.lstrip("/")
    if place.exists():
        return
    head = run("git", "-C", PROJECT, "rev-parse", "HEAD").strip()
    if run("git", "-C", PROJECT, "status", "--porcelain"):
        print(f"bare: what is not committed is not in the clone, which is of {head[:10]}", flush=True)
    run("git", "clone", "--quiet", "--no-hardlinks", PROJECT, place)
    run("git", "-C", place, "checkout", "--quiet", "--detach", head)
    run("git", "-C", place, "remote", "remove", "origin")
    run("chroot", root, "chown", "--recursive", f"{USER}:{USER}", CLONE)


def check_python(machine: Machine) -> None:
    """A Debian that has moved on to another Python is not the one wanted.

    Raises
    ------
    NoMachine
        Another version is there than ``PYTHONS`` has for the suite.
    """
    found = run("chroot", machine.root, "python3", "--version").split()[-1]
    wanted = PYTHONS.get(machine.suite, found)
    if f"{found}.".startswith(f"{wanted}."):
        return
    raise NoMachine(f"Debian {machine.suite} has Python {found} by now; write that in PYTHONS of {__file__}")


def environment() -> dict[str, str]:
    """What a login of the user has; nothing of the host's but how the network is reached."""
    own = {"HOME": f"/home/{USER}", "USER": USER, "LANG": "C.UTF-8", "PATH": "/usr/local/bin:/usr/bin:/bin"}
    passed_on = {name: value for name, value in os.environ.items() if PASSED_ON.fullmatch(name)}
    return {**passed_on, **own, "SSL_CERT_FILE": f"/{CERTIFICATES}"}


def run_inside(root: Path, command: list[str]) -> int:
    """Run the command in the clone, and return its exit status.

    Raises
    ------
    NoMachine
        The host does not let root mount anything.
    """
    apart = ["unshare", "--mount", "--pid", "--fork", "--kill-child"]
    run(*apart, "mount", "--make-rprivate", "/")
    login = [f"{name}={value}" for name, value in environment().items()]
    argv = [*apart, "bash", "-c", INSIDE, "bash", str(root), USER, CLONE, *login, *command]
    return subprocess.run(argv, check=False).returncode


def arguments(words: list[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="machine.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    known = ", ".join(f"{suite} (Python {python})" for suite, python in PYTHONS.items())
    parser.add_argument("--suite", default="forky", help=f"the Debian to make: {known} ... (default forky)")
    parser.add_argument("--root", type=Path, default=Path(), metavar="FOLDER", help="keep it there")
    parser.add_argument("--mirror", help="where Debian's packages are (as apt has it)")
    parser.add_argument("command", nargs="+", metavar="COMMAND")
    return parser.parse_args(words)


def main() -> int:
    """Make the machine, run the command, and turn what prevents it into words."""
    args = arguments()
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # the folder goes then too
    try:
        refuse_without_means()
        with ready(Machine(args.suite, args.root, args.mirror or mirror())) as machine:
            take_from_host(machine.root)
            check_python(machine)
            clone(machine.root)
            print(f"bare: {shlex.join(args.command)} in Debian {machine.suite} ...", flush=True)
            return run_inside(machine.root, args.command)
    except NoMachine as why:
        print(f"bare: no bare machine: {why}", file=sys.stderr)
        return NO_MACHINE


if __name__ == "__main__":
    sys.exit(main())
