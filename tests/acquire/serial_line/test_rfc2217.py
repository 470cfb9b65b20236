"""Telnet and the COM port option: data out of it, whatever else is in it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquire.errors import DeviceError
from acquire.serial_line.ports import LineSettings, open_port
from acquire.serial_line.rfc2217 import Telnet, escaped, line_settings
from tests.adversary.peers import LINE, Rfc2217Peer, SocketPeer, paced, silence


@given(data=st.binary(max_size=300), cuts=st.lists(st.integers(1, 40), min_size=1, max_size=20))
def test_escaped_data_comes_back_however_it_is_cut(data: bytes, cuts: list[int]) -> None:
    telnet, sent, out = Telnet(), escaped(data), bytearray()
    while sent:
        size = cuts[len(sent) % len(cuts)]
        out += telnet.feed(sent[:size])
        sent = sent[size:]
    assert bytes(out) == data


@given(
    data=st.lists(st.sampled_from([b"\xff", b"\xfa", b"\xf0", b"\xfb", b"\x2c", b"\xfd", b"1"]), max_size=400)
)
def test_no_server_makes_it_grow_or_fail(data: list[bytes]) -> None:
    telnet = Telnet()
    for byte in data:
        telnet.feed(byte)
    assert len(telnet.replies) <= 3 * 512 and len(telnet._begun) <= 64


def test_a_negotiation_without_end_is_let_go() -> None:
    telnet = Telnet()
    telnet.feed(b"\xff\xfa" + b"x" * 100_000)
    assert len(telnet._begun) <= 64
    assert telnet.feed(b"1 N\r\n").endswith(b"1 N\r\n")


def test_offers_are_answered_once() -> None:
    telnet = Telnet()
    telnet.feed(b"\xff\xfd\x18" * 50 + b"\xff\xfb\x01" * 50)
    assert telnet.take_replies() == b"\xff\xfc\x18\xff\xfe\x01"


def test_the_settings_of_the_line() -> None:
    sent = line_settings(9600, 7, "E", 2)
    assert sent.startswith(b"\xff\xfa\x2c\x01\x00\x00\x25\x80\xff\xf0\xff\xfa\x2c\x02\x07\xff\xf0")


def test_a_server_gives_its_lines() -> None:
    with Rfc2217Peer(paced(200.0)) as peer:
        port = open_port(LineSettings(peer.url, 19200, 7, "E"))
        heard = b"".join(port.receive(100) for _ in range(20))
        port.write(b"\xff")
        port.close()
    assert LINE * 3 in heard


def test_what_speaks_no_rfc2217_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquire.serial_line.rfc2217.CONNECT_S", 0.1)
    with SocketPeer(silence) as peer:
        url = peer.url.replace("socket", "rfc2217")
        with pytest.raises(DeviceError, match="speaks no RFC 2217; use socket://"):
            open_port(LineSettings(url))
