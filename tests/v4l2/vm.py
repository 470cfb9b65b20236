#!/usr/bin/env python3
"""Run the V4L2 tests, or any command, in a small virtual machine that has cameras.

    vm.py --tests [PYTEST ARGUMENT ...]     the suite of this folder
    vm.py [--rw DIR] -- COMMAND [ARG ...]   anything

The machine boots Debian's kernel and sees the host's files at the same paths, so it uses the
same virtual environment and working tree; what it writes is lost except below ``--rw``. It has

    /dev/video0   vivid, the kernel's virtual camera (input 1 loops back what is written to
    /dev/video1   its output node)
    /dev/ttyACM0  a USB serial port (cdc_acm); the far end of the cable is
    /dev/ttyGS0   (g_serial over dummy_hcd)

``--tests`` runs the suite inside, then the part that measures what was recorded there outside,
where nothing is emulated. It says how many tests ran, and fails on a failure, a skip, or
nothing run at all. Where the machine cannot be had it says why and fails as well, unless
PHASEDIC_ALLOW_NO_VM=1.

Needs Debian's apt-get; QEMU, v4l-utils, a kernel and busybox are fetched when missing. Nothing
but the standard library is used, since this runs before any environment exists.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent.parent
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "phasedic-vm"
TIMED_OUT, NO_MACHINE = 124, 125

# Needed before the host's files can be reached.
EARLY = ("virtio_pci", "virtio_console", "9pnet_virtio", "9p", "overlay")
# One camera node (webcam, loop-back input), one output node, and a serial cable through USB.
DEVICES = (
    "vivid n_devs=1 node_types=0x101 num_inputs=2 input_types=0xc num_outputs=1 output_types=1",
    "dummy_hcd",
    "g_serial",
    "cdc_acm",
)
# Not OPENBLAS_CORETYPE: the host's kind of processor is not that of an emulated machine.
INHERITED = re.compile(
    r"PATH|HOME|LANG|LC_\w+|TERM|VIRTUAL_ENV|(PYTHON|PYTEST|PHASEDIC|NUMBA|OMP|OPENBLAS(?!_CORETYPE))\w*"
)

INIT = """#!/bin/busybox sh
bb=/bin/busybox
$bb mkdir -p /proc /sys /dev /job /host /top /root
$bb --install -s /bin
mount -t proc none /proc && mount -t sysfs none /sys && mount -t devtmpfs none /dev
give_up() {{ echo "vm: $*" >/dev/kmsg; poweroff -f; }}
share() {{ mount -t 9p -o trans=virtio,version=9p2000.L,msize=524288,$3 $1 "$2" || give_up "cannot share $2"; }}
modprobe -a {early} || give_up "modules are missing"
share job /job rw
share host /host ro,cache=loose
mount -t tmpfs -o size=70% none /top && mkdir /top/changed /top/scratch
mount -t overlay -o lowerdir=/host,upperdir=/top/changed,workdir=/top/scratch none /root || give_up "no root"
for place in proc sys dev; do mount -o move /$place /root/$place; done
mkdir -p /root/dev/pts /root/dev/shm /root/run /root/lib/modules
mount -t devpts none /root/dev/pts
mount -t tmpfs none /root/dev/shm
mount -t tmpfs none /root/run
mount -t configfs none /root/sys/kernel/config 2>/dev/null
mkdir -p /root/run/vm/job /root/run/vm/bin
mount -o move /job /root/run/vm/job
cp /bin/busybox /root/run/vm/bin/
for tool in modprobe rmmod lsmod; do ln -s busybox /root/run/vm/bin/$tool; done
mount -o bind "/root{modules}" /root/lib/modules
mount -o bind "/root{modules}" /lib/modules
echo /bin/modprobe >/root/proc/sys/kernel/modprobe  # the kernel asks for modules by itself
ip link set lo up
n=0
while read -r place; do share rw$n "/root$place" rw; n=$((n + 1)); done </root/run/vm/job/writable
chroot /root /bin/sh /run/vm/job/script
sync
poweroff -f
"""

SCRIPT = """
exec </dev/null >/dev/vport0p1 2>&1
export PATH=/run/vm/bin:$PATH PHASEDIC_IN_VM=1
{exports}
{modules}
tries=0
while [ ! -e /dev/ttyACM0 ] && [ $tries -lt 50 ]; do sleep 0.1; tries=$((tries + 1)); done
cd {folder}
{command}
echo $? >/run/vm/job/status
"""


class NoMachine(Exception):
    """Why there is no virtual machine, and what would help."""


def run(*words: str | Path, **more: object) -> str:
    """A command's output; ``NoMachine`` with its last words when it fails."""
    argv = [str(word) for word in words]
    done = subprocess.run(argv, text=True, capture_output=True, check=False, **more)  # type: ignore[call-overload]
    if done.returncode:
        last = (done.stderr or done.stdout or "no message").strip().splitlines()[-1]
        raise NoMachine(f"`{shlex.join(argv)}` failed: {last}")
    return str(done.stdout)


# What the machine is made of


def install(package: str, program: str) -> None:
    """Make sure a program of a Debian package is there."""
    if shutil.which(program):
        return
    if not shutil.which("apt-get"):
        raise NoMachine(f"{program} is missing and there is no apt-get; install {package} by hand")
    print(f"vm: installing {package} ...", flush=True)
    root = [] if os.geteuid() == 0 else ["sudo", "-n"]
    with contextlib.suppress(NoMachine):
        run(*root, "apt-get", "update", "-qq")
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    run(*root, "apt-get", "install", "-y", "-qq", "--no-install-recommends", package, env=quiet)


@dataclass(frozen=True)
class GuestKernel:
    """Unpacked packages: Debian's kernel and busybox."""

    root: Path
    version: str

    @property
    def image(self) -> Path:
        return self.root / "boot" / f"vmlinuz-{self.version}"

    @property
    def modules(self) -> Path:
        return self.root / "lib/modules" / self.version

    @property
    def busybox(self) -> Path:
        return self.root / "bin/busybox"


def guest_kernel() -> GuestKernel:
    """Debian's present kernel, fetched once into the cache."""
    root, stamp = CACHE / "root", CACHE / "version"
    if stamp.exists():
        return GuestKernel(root, stamp.read_text())
    if not shutil.which("apt-get"):
        raise NoMachine("there is no apt-get to fetch a kernel with; this needs Debian or Ubuntu")
    found = _kernel_package()
    print(f"vm: fetching {found} (about 70 MB, once) ...", flush=True)
    packages = CACHE / "packages"
    for old in (root, packages):  # of an interrupted fetch; compiled loops lie beside them
        shutil.rmtree(old, ignore_errors=True)
        old.mkdir(parents=True)
    run("apt-get", "download", "-qq", found, "busybox-static", cwd=packages)
    for package in packages.glob("*.deb"):
        run("dpkg-deb", "-x", package, root)
        package.unlink()
    kernel = GuestKernel(root, next((root / "lib/modules").iterdir()).name)
    run(kernel.busybox, "depmod", "-b", root, kernel.version)
    stamp.write_text(kernel.version)
    return kernel


def _kernel_package() -> str:
    pattern = re.compile(r"linux-image-\d\S+-amd64\b")
    for _ in range(2):
        with contextlib.suppress(NoMachine):
            found = pattern.search(run("apt-cache", "depends", "linux-image-amd64"))
            if found:
                return found[0]
        root = [] if os.geteuid() == 0 else ["sudo", "-n"]
        run(*root, "apt-get", "update", "-qq")
    raise NoMachine("apt knows no package linux-image-amd64; is this Debian on x86-64?")


def cpio(entries: Iterator[tuple[str, int, bytes]]) -> bytes:
    """An archive in the kernel's own "newc" format of (name, mode, content)."""
    parts = []
    for inode, (name, mode, content) in enumerate([*entries, ("TRAILER!!!", 0, b"")], 1):
        fields = (inode, mode, 0, 0, 1, 0, len(content), 0, 0, 0, 0, len(name) + 1, 0)
        head = b"070701" + b"".join(b"%08x" % number for number in fields) + name.encode() + b"\0"
        parts += [head, bytes(-len(head) % 4), content, bytes(-len(content) % 4)]
    return b"".join(parts)


def first_files(kernel: GuestKernel) -> Iterator[tuple[str, int, bytes]]:
    """What the kernel finds in memory when it starts: /init, busybox and the early modules."""
    needed = _with_dependencies(kernel)
    folders = {"bin", "lib"}
    for path in needed:
        folders |= {str(parent) for parent in (Path("lib/modules") / kernel.version / path).parents}
    for folder in sorted(folders - {"."}):
        yield folder, 0o40755, b""
    yield "init", 0o100755, INIT.format(early=" ".join(EARLY), modules=kernel.root / "lib/modules").encode()
    yield "bin/busybox", 0o100755, kernel.busybox.read_bytes()
    for path in sorted(needed | {"modules.dep", "modules.builtin", "modules.order"}):
        if (kernel.modules / path).exists():
            yield f"lib/modules/{kernel.version}/{path}", 0o100644, (kernel.modules / path).read_bytes()


def _with_dependencies(kernel: GuestKernel) -> set[str]:
    table = dict(line.split(":", 1) for line in (kernel.modules / "modules.dep").read_text().splitlines())
    by_name = {Path(path).name.split(".")[0].replace("-", "_"): path for path in table}
    files = {by_name[name] for name in EARLY if name in by_name}
    return files.union(*(table[path].split() for path in files))


# Running it


@dataclass(frozen=True)
class Options:
    """How the machine runs."""

    accel: str
    smp: int
    memory: str
    timeout_s: float
    verbose: bool


def command_line(kernel: GuestKernel, job: Path, writable: list[Path], options: Options) -> list[str]:
    """QEMU's arguments."""
    kvm = options.accel == "kvm"
    # An emulated processor without AVX runs numeric code faster than one with it.
    processor = (
        ["-accel", "kvm", "-cpu", "host"] if kvm else ["-accel", "tcg,thread=multi", "-cpu", "Nehalem"]
    )
    shares = [("job", job, ""), ("host", Path("/"), ",readonly=on")]
    shares += [(f"rw{k}", folder, "") for k, folder in enumerate(writable)]
    argv = ["qemu-system-x86_64", "-nodefaults", "-no-reboot", "-display", "none", "-nic", "none", *processor]
    argv += ["-smp", str(options.smp), "-m", options.memory]
    argv += ["-kernel", str(kernel.image), "-initrd", str(job / "initrd")]
    argv += ["-append", "console=ttyS0 panic=-1 mitigations=off random.trust_cpu=on"]
    argv += ["-serial", f"file:{job / 'console'}"]
    argv += ["-device", "virtio-serial", "-chardev", "stdio,id=words,signal=off"]
    argv += ["-device", "virtserialport,chardev=words"]
    argv += ["-object", "rng-random,id=rng,filename=/dev/urandom", "-device", "virtio-rng-pci,rng=rng"]
    for tag, folder, more in shares:
        argv += ["-virtfs", f"local,path={folder},mount_tag={tag},security_model=none,multidevs=remap{more}"]
    return argv


def write_job(job: Path, kernel: GuestKernel, command: list[str], writable: list[Path]) -> None:
    """The files through which the machine is told what to do."""
    exports = (
        f"export {key}={shlex.quote(value)}" for key, value in os.environ.items() if INHERITED.fullmatch(key)
    )
    modules = (f"modprobe {device} || echo vm: no {device.split()[0]}" for device in DEVICES)
    (job / "script").write_text(
        SCRIPT.format(
            exports="\n".join(line for line in exports if not line.startswith("export PATH=")),
            modules="\n".join(modules),
            folder=shlex.quote(str(Path.cwd())),
            command=shlex.join(command),
        )
    )
    (job / "writable").write_text("".join(f"{folder}\n" for folder in writable))
    (job / "initrd").write_bytes(cpio(first_files(kernel)))


def run_inside(command: list[str], writable: list[Path], options: Options) -> int:
    """Boot, run the command, power off.

    Returns
    -------
    int
        The command's exit status; 124 after a time-out.

    Raises
    ------
    NoMachine
        It could not be made, or did not come to its end.
    """
    if sys.platform != "linux":
        raise NoMachine("the virtual machine needs Linux")
    install("qemu-system-x86", "qemu-system-x86_64")
    install("v4l-utils", "v4l2-ctl")
    kernel = guest_kernel()
    with tempfile.TemporaryDirectory(prefix="phasedic-vm-") as scratch:
        job = Path(scratch)
        write_job(job, kernel, command, writable)
        # Its standard input is never written to, but the guest's port closes with it.
        machine = subprocess.Popen(command_line(kernel, job, writable, options), stdin=subprocess.PIPE)
        try:
            machine.wait(options.timeout_s)
        except subprocess.TimeoutExpired:
            print(f"vm: stopped after {options.timeout_s:g} s", file=sys.stderr)
            return TIMED_OUT
        finally:
            machine.kill()
            machine.wait()
            console = _read(job / "console")
            if options.verbose:
                print(console, file=sys.stderr)
        status = _read(job / "status").strip()
        if not status:
            last = (console.strip().splitlines() or ["no word on its console"])[-1]
            raise NoMachine(f"the machine did not come to its end: {last}")
        return int(status)


def _read(path: Path) -> str:
    return path.read_text(errors="replace") if path.exists() else ""


# The suite


@dataclass(frozen=True)
class Count:
    """What a pytest run reported."""

    ran: int
    failed: int
    skipped: int


def count(report: Path) -> Count:
    """Read a JUnit report; nothing ran when there is none."""
    if not report.exists():
        return Count(0, 0, 0)
    suites = list(ET.parse(report).getroot().iter("testsuite"))
    total, failed, errors, skipped = (
        sum(int(suite.get(key, 0)) for suite in suites) for key in ("tests", "failures", "errors", "skipped")
    )
    return Count(total - skipped, failed + errors, skipped)


def python() -> str:
    """The virtual environment's python, where there is one."""
    own = PROJECT / ".venv/bin/python"
    return str(own if own.exists() else sys.executable)


def pytest(report: Path, *words: str) -> list[str]:
    """The command that runs tests of this folder."""
    patient = ("-o", "timeout=900", "-o", "faulthandler_timeout=0")  # emulated machines are slow
    return [python(), "-m", "pytest", "-p", "no:cacheprovider", *patient, f"--junit-xml={report}", *words]


def prepare(kept: Path) -> None:
    """Render and compile out here what would take minutes in there.

    Numba's compiled loops are valid for one processor: both sides are told the same one, older
    than any that is emulated or shared.
    """
    compiled = CACHE / "numba"
    compiled.mkdir(parents=True, exist_ok=True)
    os.environ |= {"NUMBA_CACHE_DIR": str(compiled), "NUMBA_CPU_NAME": "nehalem", "NUMBA_CPU_FEATURES": ""}
    run(python(), "-m", "tests.v4l2.prepare", kept)


def run_tests(extra: list[str], options: Options) -> int:
    """The suite inside, and what it recorded measured outside."""
    os.chdir(PROJECT)
    with tempfile.TemporaryDirectory(prefix="phasedic-v4l2-") as scratch:
        kept = Path(scratch)
        os.environ["PHASEDIC_VM_KEPT"] = str(kept)
        inside_report, outside_report = kept / "inside.xml", kept / "outside.xml"
        prepare(kept)
        writable = [kept, CACHE / "numba"]
        status = run_inside(pytest(inside_report, *(extra or [str(HERE / "inside")])), writable, options)
        inside = count(inside_report)
        outside = Count(0, 0, 0)
        if status != TIMED_OUT and not extra:
            done = subprocess.run(pytest(outside_report, str(HERE / "outside")), check=False)
            outside, status = count(outside_report), status or done.returncode
    return verdict(inside, outside, status, partial=bool(extra))


def verdict(inside: Count, outside: Count, status: int, *, partial: bool) -> int:
    """Say how many tests ran, and what that means."""
    skipped = inside.skipped + outside.skipped
    print(
        f"v4l2-test: {inside.ran} tests ran in the virtual machine and {outside.ran} on what they recorded; "
        f"{inside.failed + outside.failed} failed, {skipped} were skipped"
    )
    if status:
        return status
    if skipped or not inside.ran or (not outside.ran and not partial):
        print("v4l2-test: a test that does not run counts as failed", file=sys.stderr)
        return 1
    return 0


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="vm.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tests", action="store_true", help="run the suite of this folder")
    parser.add_argument(
        "--rw", type=Path, action="append", default=[], metavar="DIR", help="writes below it are kept"
    )
    parser.add_argument(
        "--accel", choices=["tcg", "kvm"], default="tcg", help="emulate (tcg), or share the processor"
    )
    parser.add_argument("--smp", type=int, default=2, help="processors (2)")
    parser.add_argument("--memory", default="3G")
    parser.add_argument("--timeout", type=float, default=1800, metavar="S", help="for the whole run (1800)")
    parser.add_argument("-v", "--verbose", action="store_true", help="show the kernel's console")
    parser.add_argument("words", nargs="*", metavar="COMMAND | PYTEST ARGUMENT")
    return parser.parse_args()


def main() -> int:
    """Run, and turn what prevents it into words."""
    args = arguments()
    options = Options(args.accel, args.smp, args.memory, args.timeout, args.verbose)
    if not (args.tests or args.words):
        print("vm.py: give --tests or a command", file=sys.stderr)
        return 2
    try:
        if args.tests:
            return run_tests(args.words, options)
        return run_inside(args.words, [folder.resolve(strict=True) for folder in args.rw], options)
    except NoMachine as why:
        print(f"vm: no virtual machine: {why}", file=sys.stderr)
        if args.tests and os.environ.get("PHASEDIC_ALLOW_NO_VM") == "1":
            print("v4l2-test: 0 tests ran; accepted, since PHASEDIC_ALLOW_NO_VM=1")
            return 0
        return NO_MACHINE


if __name__ == "__main__":
    sys.exit(main())
