"""What the testing machine does to the virtual specimen over time, and the metal that it pulls.

- ``Programme``: hold, pull to yield, pull on, hold. Two constant strain rates, as ISO 6892-1 has them: a slow one
  through the elastic part, where most is to be measured, and a faster one beyond yield. Times are seconds since
  the test began (``TestClock``).
- ``Pull``: when an operator lets the programme pull, and how slowly.
- ``Machine``: driven by another program, which sends ``speed V`` (1/s: over the free length of the specimen) over
  TCP and gets ``ok``. The machine is soft: while the specimen is elastic, part of the way goes into the machine,
  beyond yield all goes into the specimen. So the strain rate is not the speed, and jumps at yield; to hold it takes
  a controller.
- ``FlowCurve``: elastic, then plastic with Voce and linear hardening; uniaxial and rate independent. Nothing here
  unloads.
- ``PowerLaw``: a sheet metal of given r and n at large strains.
"""

from __future__ import annotations

import contextlib
import math
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from acquire.clock import Clock
from acquire.errors import ConfigError

Array = NDArray[np.float64]

ELASTIC_SHARE = 0.6
"""Of the crosshead's way that reaches an elastic specimen."""
MAX_SPEED = 0.1  # 1/s

PLASTIC_NU = 0.5  # plastic flow keeps the volume
NEWTON_STEPS = 20
BISECTIONS = 60
YIELD_PLASTIC = 0.002  # plastic strain where the power law begins


class Machine:
    """Strain over time, from the speeds that were commanded.

    Parameters
    ----------
    port : int
        Of 127.0.0.1; 0: any free one.
    yield_strain : float
    elapsed : callable
        Seconds since the start of the test, at a monotonic time.
    clock : callable giving monotonic seconds
    """

    def __init__(
        self,
        port: int,
        yield_strain: float,
        elapsed: Callable[[float], float],
        clock: Clock = time.monotonic,
    ) -> None:
        self.port = port
        self._yield_strain, self._elapsed, self._clock = yield_strain, elapsed, clock
        self._knots = [(0.0, 0.0, 0.0)]  # time, strain there, speed from there on
        self._lock = threading.Lock()
        self._listening: socket.socket | None = None

    def drive(self, speed: float) -> None:
        """Pull with ``speed`` (1/s) from now on."""
        with self._lock:
            t = max(self._elapsed(self._clock()), self._knots[-1][0])
            self._knots.append((t, float(self._from(self._knots[-1], t)), min(max(speed, 0.0), MAX_SPEED)))

    def strain(self, t: ArrayLike) -> Array:
        """Strain of the specimen at ``t`` seconds since the start."""
        with self._lock:
            knots = list(self._knots)
        times = np.asarray(t, float)
        begun = np.searchsorted([knot[0] for knot in knots], times, side="right") - 1
        strains = np.zeros(times.shape)
        for number in np.unique(np.maximum(begun, 0)):
            here = np.maximum(begun, 0) == number
            strains[here] = self._from(knots[number], times[here])
        return strains

    def _from(self, knot: tuple[float, float, float], t: ArrayLike) -> Array:
        """The strain at ``t`` with the speed of ``knot``, which bends at yield."""
        t0, strain, speed = knot
        way = speed * np.maximum(np.asarray(t, float) - t0, 0.0)
        elastic = max(self._yield_strain - strain, 0.0) / ELASTIC_SHARE
        return np.asarray(strain + ELASTIC_SHARE * np.minimum(way, elastic) + np.maximum(way - elastic, 0.0))

    def listen(self) -> None:
        """Take commands from now on; raises ConfigError where the port is taken."""
        try:
            self._listening = socket.create_server(("127.0.0.1", self.port))
        except OSError as error:
            raise ConfigError(
                "machine={port}: cannot be listened to ({why}); choose another", self.port, error
            ) from None
        self.port = self._listening.getsockname()[1]
        threading.Thread(target=self._serve, args=(self._listening,), name="machine", daemon=True).start()

    def close(self) -> None:
        """Take no more commands."""
        if self._listening is not None:
            with contextlib.suppress(OSError):
                self._listening.shutdown(socket.SHUT_RDWR)
            self._listening.close()
            self._listening = None

    def _serve(self, listening: socket.socket) -> None:
        """One client at a time."""
        with contextlib.suppress(OSError):
            while True:
                connection, _ = listening.accept()
                with (
                    contextlib.suppress(OSError),
                    connection,
                    # For reading alone: a text file that is also written to forgets what it has read ahead.
                    connection.makefile("r", newline="\n", encoding="utf-8", errors="replace") as lines,
                ):
                    for line in lines:
                        connection.sendall(f"{self._answer(line)}\n".encode())

    def _answer(self, line: str) -> str:
        word, _, value = line.strip().partition(" ")
        with contextlib.suppress(ValueError):
            if word == "speed" and math.isfinite(speed := float(value)):
                self.drive(speed)
                return "ok"
        return "no: give speed V, 1/s"


class Pull:
    """The pull of a programme that waits for its operator: as programmed until ``start`` is called.

    Attributes
    ----------
    told : (float, float) or None, s
        When it begins, since the start of the test, and how long it takes.
    """

    def __init__(self) -> None:
        self.told: tuple[float, float] | None = None

    def start(self, begins_s: float, lasts_s: float) -> None:
        """Pull from ``begins_s`` on for ``lasts_s``; it must be later than any picture that is made already."""
        self.told = begins_s, lasts_s


@dataclass(frozen=True, slots=True)
class Programme:
    """Strain over time, made of straight pieces.

    Attributes
    ----------
    hold_s : float, s
        At rest, for the reference burst; the longest where it waits for its operator.
    ramp_s : float, s
        Pulling.
    end_s : float, s
        At rest at the highest strain.
    knee_strain, max_strain : float
        Axial strain where the rate changes, and at the end of the ramp.
    knee : float
        Part of the ramp's time spent up to ``knee_strain``.
    machine : Machine or None
        Driven from outside; then it alone decides the strain, and the times are those of the test.
    pull : Pull or None
        Given where the programme waits for its operator.
    """

    hold_s: float = 2.0
    ramp_s: float = 17.0
    end_s: float = 1.0
    knee_strain: float = 2e-3
    max_strain: float = 8e-3
    knee: float = 0.6
    machine: Machine | None = None
    pull: Pull | None = None

    @property
    def knots_s(self) -> tuple[float, float, float]:
        """Times since the start at which the pull begins, the rate changes, and the pull ends, s."""
        told = None if self.pull is None else self.pull.told
        begins, lasts = told or (self.hold_s, self.ramp_s)
        return begins, begins + self.knee * lasts, begins + lasts

    @property
    def duration_s(self) -> float:
        """Length of the whole test, s."""
        return self.knots_s[2] + self.end_s

    @property
    def knee_s(self) -> float:
        """Time since the start at which the rate changes, s."""
        return self.knots_s[1]

    def strain(self, t: ArrayLike) -> Array:
        """Axial strain at ``t`` seconds since the start; 0 before."""
        if self.machine is not None:
            return self.machine.strain(t)
        strains = (0.0, self.knee_strain, self.max_strain)
        return np.asarray(np.interp(np.asarray(t, float), self.knots_s, strains))

    def stiffness(self, t: ArrayLike) -> Array:
        """Share of the stiffness of the material that the specimen still has: all of it."""
        return np.ones(np.shape(t))

    def progress(self, t: ArrayLike) -> Array:
        """Part of the ramp that is done, 0 to 1."""
        begins, _, ends = self.knots_s
        return np.clip((np.asarray(t, float) - begins) / (ends - begins), 0.0, 1.0)


class TestClock:
    """When the test began, on the clock of its driver; shared by both devices.

    A simulated camera claims the start, so that the hold is not spent while a view opens; without
    one, the load cell begins the test.
    """

    __test__ = False  # for pytest: not a test case

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._start: float | None = None
        self.claimed = False

    @property
    def start(self) -> float | None:
        """Monotonic seconds, or None before the test began."""
        return self._start

    def begin(self, now: float) -> float:
        """Begin at ``now`` unless the test has begun already; gives the start, s."""
        with self._lock:
            if self._start is None:
                self._start = now
            return self._start

    def elapsed(self, now: float) -> float:
        """Seconds since the start; 0 before it began."""
        return 0.0 if self._start is None else now - self._start


@dataclass(frozen=True, slots=True)
class FlowCurve:
    """Flow stress ``yield_stress + voce (1 - exp(-voce_rate ep)) + hardening ep`` over plastic strain ep.

    Attributes
    ----------
    E : float, Pa
    nu : float
        Elastic Poisson's ratio; that of the plastic part is 0.5.
    yield_stress : float, Pa
    voce : float, Pa
        Rise of the flow stress at saturation; 0 leaves linear hardening alone.
    voce_rate : float
        How fast it saturates, per unit of plastic strain.
    hardening : float, Pa
        Linear hardening modulus.
    """

    E: float = 70e9
    nu: float = 0.33
    yield_stress: float = 140e6
    voce: float = 60e6
    voce_rate: float = 300.0
    hardening: float = 1e9

    @property
    def yield_strain(self) -> float:
        """Axial strain where plastic flow begins."""
        return self.yield_stress / self.E

    def plastic_strain(self, strain: ArrayLike) -> Array:
        """Plastic part of an axial strain >= 0, by Newton's rule.

        The balance of flow stress and E (strain - ep) is concave and rising in ep, so that Newton
        from ep = 0 approaches from one side and cannot overshoot.
        """
        total = np.asarray(strain, float)
        ep = np.zeros_like(total)
        for _ in range(NEWTON_STEPS):
            decay = np.exp(-self.voce_rate * ep)
            flow = self.yield_stress + self.voce * (1 - decay) + self.hardening * ep
            slope = self.voce * self.voce_rate * decay + self.hardening + self.E
            ep = np.maximum(ep - (flow - self.E * (total - ep)) / slope, 0.0)
        return ep

    def stress(self, strain: ArrayLike) -> Array:
        """Axial stress, Pa, at an axial strain >= 0."""
        return np.asarray(self.E * (np.asarray(strain, float) - self.plastic_strain(strain)))

    def strain_at(self, stress: ArrayLike) -> Array:
        """Axial strain at an axial stress >= 0, Pa; Newton's rule cannot overshoot here either."""
        total = np.asarray(stress, float)
        ep = np.zeros_like(total)
        for _ in range(NEWTON_STEPS):
            decay = np.exp(-self.voce_rate * ep)
            flow = self.yield_stress + self.voce * (1 - decay) + self.hardening * ep
            ep = np.maximum(ep + (total - flow) / (self.voce * self.voce_rate * decay + self.hardening), 0.0)
        return np.asarray(total / self.E + ep)

    def transverse(self, strain: ArrayLike) -> Array:
        """Transverse strain at an axial strain >= 0."""
        plastic = self.plastic_strain(strain)
        return np.asarray(-self.nu * (np.asarray(strain, float) - plastic) - PLASTIC_NU * plastic)


@dataclass(frozen=True, slots=True)
class PowerLaw:
    """Sheet metal that hardens as ``C ep^n`` in true stress and true plastic strain ep, at strains of any size.

    It flows at its yield stress until the power law passes that, at a plastic strain of 0.2 %.

    Attributes
    ----------
    n : float
        Strain hardening exponent; the highest force comes near a true strain of n.
    r : float
        Plastic anisotropy: true plastic strain of the width over that of the thickness.
    E : float, Pa
    nu : float
        Elastic Poisson's ratio.
    yield_stress : float, Pa
    """

    n: float
    r: float = 1.0
    E: float = 70e9
    nu: float = 0.33
    yield_stress: float = 140e6

    @property
    def yield_strain(self) -> float:
        """Axial strain where plastic flow begins."""
        return self.yield_stress / self.E

    @property
    def uniform_strain(self) -> float:
        """Axial engineering strain at the highest force, where a neck begins.

        A. Considere, Ann. Ponts Chauss. 9 (1885) 574-775: the true stress rises as fast as the section shrinks, at a
        plastic strain of n (1 - stress / E).
        """
        plastic = self.n
        for _ in range(NEWTON_STEPS):
            plastic = self.n * (1 - float(self._flow_stress(np.asarray(plastic))) / self.E)
        return math.expm1(plastic + float(self._flow_stress(np.asarray(plastic))) / self.E)

    def plastic_strain(self, strain: ArrayLike) -> Array:
        """True plastic strain at an axial engineering strain >= 0, by bisection."""
        total = np.log1p(np.asarray(strain, float))
        low, high = np.zeros_like(total), np.maximum(total, 0.0)
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            above = middle + self._flow_stress(middle) / self.E > total
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return np.asarray(np.where(total * self.E <= self.yield_stress, 0.0, (low + high) / 2))

    def _flow_stress(self, plastic: Array) -> Array:
        return np.asarray(self.yield_stress * np.maximum(plastic / YIELD_PLASTIC, 1.0) ** self.n)

    def _true_stress(self, strain: ArrayLike) -> Array:
        return np.asarray(self.E * (np.log1p(np.asarray(strain, float)) - self.plastic_strain(strain)))

    def stress(self, strain: ArrayLike) -> Array:
        """Force over the first section, Pa, at an axial engineering strain >= 0."""
        return np.asarray(self._true_stress(strain) / (1 + np.asarray(strain, float)))

    def transverse(self, strain: ArrayLike) -> Array:
        """Engineering strain of the width at an axial engineering strain >= 0."""
        elastic = -self.nu * self._true_stress(strain) / self.E
        return np.asarray(np.expm1(elastic - self.r / (1 + self.r) * self.plastic_strain(strain)))
