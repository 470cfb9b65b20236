"""A guard for your machine: it stops as soon as a value is not known, phasedic is silent, or the connection ends.

It reads the strain output (``phasedic run --strain-out 5600``). A line comes at least every 0.5 s: the last measurement
again, with its age, where there is no new one; a value that is not known is null. ``python -m examples.stop_machine
5600`` waits for the first values, then prints why it stops; rewrite ``stop`` for your machine.
"""

from __future__ import annotations

import json
import socket
import sys
from collections.abc import Iterator, Sequence
from typing import Any

SILENCE_S = 1.0  # two heartbeats
WATCHED = ("axial", "force_N")


class NotAlive(Exception):
    """Its text is why the machine must stop."""


def values(connection: socket.socket, watched: Sequence[str] = WATCHED) -> Iterator[dict[str, Any]]:
    """Each line of the strain output once ``watched`` are known; raises NotAlive when the machine must stop."""
    connection.settimeout(SILENCE_S)
    begun = False
    with connection.makefile("r", encoding="utf-8") as lines:
        while True:
            try:
                line = lines.readline()
            except TimeoutError:
                raise NotAlive(f"no line for {SILENCE_S:g} s") from None
            if not line.endswith("\n"):
                raise NotAlive("phasedic has closed the connection")
            if line[0] != "{":
                raise NotAlive(f"an alarm: {line.strip()}")
            now = json.loads(line)
            unknown = [
                name for name in watched if now.get(name, 0.0) is None
            ]  # absent: there is no such source
            if unknown and begun:
                raise NotAlive(f"{unknown[0]} is not known any more ({now.get('state')})")
            begun = begun or not unknown
            if begun:
                yield now


def stop(why: str) -> None:
    """Stop the machine."""
    print(f"STOP: {why}")


def main(port: str) -> int:
    """Guard a machine until it has been stopped."""
    with socket.create_connection(("127.0.0.1", int(port)), 10) as connection:
        try:
            for now in values(connection):
                print(*(f"{name} {now[name]:.6g}" for name in (*WATCHED, "age_s") if name in now))
        except NotAlive as why:
            stop(str(why))
    return 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:2]))
