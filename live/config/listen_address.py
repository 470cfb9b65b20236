"""Where a server listens: a port of this machine, with or without a token, or a socket of one user in a folder."""

from __future__ import annotations

import contextlib
import ipaddress
import os
import socket
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from acquire.errors import ConfigError
from acquire.text import Message

LOOPBACK = "127.0.0.1"
MIN_TOKEN_LENGTH = 16  # characters
SOCKET = "socket"
"""In place of an address: a unix socket in the folder of the run."""
ALLOWED = "PORT, or HOST:PORT with the address of this machine, PORT from 1024 to 65535 (0: any free one)"


@dataclass(frozen=True, slots=True)
class ListenAddress:
    """An address of this machine and a port."""

    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """From ``PORT`` or ``HOST:PORT``; raises ValueError with what is allowed."""
        host, _, port = text.rpartition(":")
        if not port.isascii() or not port.isdigit() or len(port) > 5 or not _port_allowed(int(port)):
            raise ValueError(ALLOWED)
        host = host or LOOPBACK
        if host != "localhost":
            try:
                ipaddress.IPv4Address(host)
            except ValueError:
                raise ValueError(ALLOWED) from None
        return cls(LOOPBACK if host == "localhost" else host, int(port))

    @property
    def is_loopback(self) -> bool:
        """Whether only programs of this machine can connect."""
        return ipaddress.IPv4Address(self.host).is_loopback

    def listen(self, what: str) -> socket.socket:
        """A listening, non-blocking socket; ``what`` is its name in messages.

        Raises
        ------
        ConfigError
            The port is taken, or the address is not one of this machine.
        """
        try:
            found = listening_socket(self.host, self.port)
        except OSError as error:
            raise ConfigError(
                "{what}: {host}:{port} cannot be listened to ({why}); choose another port",
                what,
                self.host,
                self.port,
                error,
            ) from None
        found.setblocking(False)
        return found


def listening_socket(host: str, port: int, tries: int = 1) -> socket.socket:
    """A socket that listens at the first free one of ``tries`` ports from ``port``.

    Raises
    ------
    OSError
        No port is free; the error of the last one.
    """
    failed = OSError(f"there is no port {port}")
    for candidate in range(port, min(port + tries, 65536)):
        found = socket.socket()
        try:
            # A port in TIME_WAIT is free.
            found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            found.bind((host, candidate))
            found.listen()
            return found
        except OSError as error:
            found.close()
            failed = error
    raise failed


def _port_allowed(port: int) -> bool:
    return port == 0 or 1024 <= port <= 65535


def private_socket(folder: Path, name: str, what: str) -> tuple[socket.socket, Callable[[], None]]:
    """A listening unix socket ``name`` in ``folder`` that this user alone can open, and what removes it at the end.

    Raises
    ------
    ConfigError
        It cannot be made there.
    """
    family = getattr(socket, "AF_UNIX", None)
    if family is None:
        raise ConfigError("{what}: this system has no unix sockets; give [HOST:]PORT and a token file", what)
    found, at = (
        socket.socket(family),
        os.open(folder, os.O_RDONLY),
    )  # that folder, whatever its name becomes

    def remove() -> None:
        with contextlib.suppress(OSError):
            os.unlink(name, dir_fd=at)
        os.close(at)

    try:
        found.bind(min(str(folder / name), os.path.relpath(folder / name), key=len))  # up to 107 bytes
        os.chmod(name, 0o600, dir_fd=at)
        found.listen()  # nobody can connect before
    except OSError as error:
        found.close()
        os.close(at)
        raise ConfigError(
            "{what}: {path} cannot be made ({why}); choose another --out, or give PORT",
            what,
            folder / name,
            error,
        ) from None
    found.setblocking(False)
    return found, remove


def read_token(address: ListenAddress, path: str | None, what: str, *, commands: bool = False) -> str:
    """The token that a client must send first; empty if none is needed: to read, on this machine.

    Raises
    ------
    ConfigError
        A token is needed and there is none, it is too short, or others can read it.
    """
    if path is None:
        if address.is_loopback and not commands:
            return ""
        who = Message("every user") if address.is_loopback else Message("other machines")
        raise ConfigError(
            "{what}: {who} can reach {host}; give token_file, a file of yours alone with a word of {n} letters, or"
            " {instead}",
            what,
            who,
            address.host,
            MIN_TOKEN_LENGTH,
            "--orders alone" if commands else LOOPBACK,
        )
    try:
        if os.name == "posix" and Path(path).stat().st_mode & 0o077:
            raise ConfigError(
                "{what}: {path}: other users can read the token; make a new one, of mode 600", what, path
            )
        token = Path(path).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError("{what}: {path}: no token can be read ({why})", what, path, error) from None
    if len(token) < MIN_TOKEN_LENGTH or len(token.split()) != 1:
        raise ConfigError(
            "{what}: {path}: a token is one word of {n} letters or more", what, path, MIN_TOKEN_LENGTH
        )
    return token
