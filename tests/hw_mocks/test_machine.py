"""The soft machine: part of its way goes into the machine until the specimen yields."""

from __future__ import annotations

import socket

import numpy as np
import pytest

from acquire.errors import ConfigError
from hw_mocks.machine import ELASTIC_SHARE, Machine, PowerLaw, Programme


def test_the_strain_follows_the_speed_and_bends_at_yield() -> None:
    now = 0.0
    machine = Machine(0, 3e-3, lambda t: t, lambda: now)
    machine.drive(1e-3)
    # 3e-3 is reached after 3 / 0.6 = 5 s; beyond it the whole way goes into the specimen.
    expected = [0, ELASTIC_SHARE * 2e-3, ELASTIC_SHARE * 4e-3, 3e-3, 4e-3, 5e-3]
    assert machine.strain([0, 2, 4, 5, 6, 7]) == pytest.approx(expected, rel=1e-12)
    now = 6.0
    machine.drive(2e-3)
    assert machine.strain([2, 6, 7]) == pytest.approx([1.2e-3, 4e-3, 6e-3], rel=1e-12)


def test_it_neither_pushes_nor_goes_too_fast() -> None:
    now = 0.0
    machine = Machine(0, 1.0, lambda t: t, lambda: now)
    machine.drive(-1.0)
    assert machine.strain([0, 10]) == pytest.approx([0, 0])
    machine.drive(5.0)
    assert machine.strain([1]) == pytest.approx([ELASTIC_SHARE * 0.1])


def test_another_program_drives_it_line_by_line() -> None:
    now = 0.0
    machine = Machine(0, 3e-3, lambda t: t, lambda: now)
    machine.listen()
    nonsense = (b"speed nan", b"speed inf", b"speed", b"sped 1", b"s 1", b"", b"\xff")
    said = (b"speed 0.001", *nonsense, b"speed 0.002")
    with socket.create_connection(("127.0.0.1", machine.port), 5) as client, client.makefile("r") as lines:
        client.sendall(b"".join(line + b"\n" for line in said))  # at once: none is forgotten
        answers = [lines.readline().strip() for _ in said]
    assert answers == ["ok", *["no: give speed V, 1/s"] * 7, "ok"]
    assert machine.strain([1.0]) == pytest.approx([ELASTIC_SHARE * 2e-3])
    with pytest.raises(
        ConfigError, match=f"machine={machine.port}: cannot be listened to .*; choose another"
    ):
        Machine(machine.port, 1.0, lambda t: t).listen()
    machine.close()
    machine.close()


def test_its_elastic_share_and_its_greatest_speed() -> None:
    now = 0.0
    machine = Machine(0, 1.0, lambda t: t, lambda: now)
    machine.drive(1.0)
    assert machine.strain([0.0, 1.0]) == pytest.approx([0.0, 0.06])
    assert machine.strain(-1.0) == 0.0


def test_sheet_metal_flows_at_its_yield_stress_up_to_a_plastic_strain_of_two_thousandths() -> None:
    metal = PowerLaw(0.2, 1.5)
    plastic = np.array([0.0005, 0.001, 0.002, 0.004, 0.02])
    true_stress = 140e6 * np.array([1, 1, 1, 2**0.2, 10**0.2])
    strain = np.expm1(plastic + true_stress / 70e9)
    assert metal.plastic_strain(strain) == pytest.approx(plastic, rel=1e-9)
    assert metal.stress(strain) == pytest.approx(true_stress / (1 + strain), rel=1e-9)
    width = -0.33 * true_stress / 70e9 - 1.5 / 2.5 * plastic
    assert metal.transverse(strain) == pytest.approx(np.expm1(width), rel=1e-9)


def test_a_programme_of_which_nothing_is_said() -> None:
    plain = Programme()
    assert (plain.hold_s, plain.ramp_s, plain.end_s, plain.machine) == (2.0, 17.0, 1.0, None)
    assert (plain.knee_strain, plain.max_strain, plain.knee) == (2e-3, 8e-3, 0.6)
    assert (plain.knee_s, plain.duration_s) == pytest.approx((12.2, 20.0))
    assert plain.progress([0.0, 2.0, 10.5, 19.0, 20.0]) == pytest.approx([0, 0, 0.5, 1, 1])
