"""A fake GigE camera keeps the contract of all cameras."""

from __future__ import annotations

from collections.abc import Iterator
from inspect import signature

import pytest

from acquire.camera.contract import Camera
from acquire.camera.opening import open_camera
from tests.contracts import test_camera_contract as contract
from tests.genicam.inside.fakes import FakeCameraProcess

OF_ONE_CAMERA = {
    name: test
    for name, test in vars(contract).items()
    if name.startswith("test_") and list(signature(test).parameters) == ["camera"]
}
globals().update(OF_ONE_CAMERA)


@pytest.fixture(scope="module")
def fake() -> Iterator[FakeCameraProcess]:
    with FakeCameraProcess() as started:
        yield started


@pytest.fixture(params=["Mono8", "Mono12p"])
def camera(request: pytest.FixtureRequest, fake: FakeCameraProcess) -> Iterator[Camera]:
    opened = open_camera(f"genicam:127.0.0.1?format={request.param}&fps=50&width=64&height=48")
    yield opened
    opened.close()


def test_the_whole_contract_is_here() -> None:
    assert len(OF_ONE_CAMERA) >= 9
