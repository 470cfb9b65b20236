"""Several cameras: whose settings and names are whose; and the channels of front and back."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquire.errors import ConfigError
from live.config.cameras import camera_configs, names_of, other_cameras
from live.config.figures import JOINT_CHANNELS, channel_names, is_joint, joint_channels
from live.config.loading import load_config
from live.config.sections import CameraConfig

ALARM = [{"channel": "axial", "above": 0.5}]


def test_sides_have_a_mean_and_fields_have_none() -> None:
    back = load_config(None, {"camera.address": "sim:", "camera.back": "/dev/video2"})
    beside = load_config(None, {"camera.address": "sim:", "camera.beside": "/dev/video3"})
    assert (names_of(back), names_of(beside)) == (("front", "back"), ("first", "second"))
    assert (other_cameras(back), other_cameras(beside)) == (("/dev/video2",), ("/dev/video3",))
    alone = load_config(None, {"camera.address": "sim:"})
    assert other_cameras(alone) == () and camera_configs(alone, {}) == {"": alone}
    assert list(camera_configs(beside, {})) == ["first", "second"]


def test_up_to_seven_cameras_may_be_beside_the_first() -> None:
    given = {"camera.address": "sim:", "camera.beside": [f"/dev/video{k}" for k in range(1, 8)]}
    configs = camera_configs(load_config(None, given), {})
    assert list(configs) == ["first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth"]
    assert [one.camera.address for one in configs.values()] == ["sim:", *given["camera.beside"]]
    assert all(one.camera.beside == () for one in configs.values())
    with pytest.raises(ConfigError, match="up to 7 of them"):
        load_config(None, {**given, "camera.beside": ["/dev/video1"] * 8})
    with pytest.raises(ConfigError, match="an address or a rig file in quotes"):
        load_config(None, {**given, "camera.beside": 3})


def test_alarms_commands_and_outputs_are_of_the_first_camera_alone() -> None:
    given = {
        "camera.address": "sim:", "camera.back": "/dev/video2", "alarm": ALARM, "operate.orders": "9000",
        "strain_out.tcp": "9001", "measure.mask": "front.png", "plate.left": {"box": [0, 0, 9, 9]},
    }  # fmt: skip
    front, back = camera_configs(load_config(None, given), {}).values()
    assert (len(front.alarm), front.operate.orders, front.strain_out.tcp) == (1, "9000", "9001")
    assert (back.alarm, back.operate.orders, back.strain_out.tcp) == ((), None, None)
    assert (front.camera.address, front.camera.back) == ("sim:", None)
    assert (back.camera.address, back.measure.mask, dict(back.plate)) == ("/dev/video2", None, {})


def test_a_rig_file_of_the_back_has_its_camera_and_the_front_all_else(tmp_path: Path) -> None:
    rig = tmp_path / "back.toml"
    rig.write_text(
        "[camera]\naddress = '/dev/video1'\ncrop = [1, 2, 300, 200]\n[measure]\nzoi = 48\nroi = [5, 6, 70, 80]\n"
        "[scale]\nmm_per_px = 0.05\n[specimen]\naxis = 'x'\narea_mm2 = 3\n[load]\naddress = 'sim:'\n"
        "[gauges.behind]\nkind = 'area'\nbox = [1, 2, 3, 4]\n"
    )
    given = {
        "camera.address": "sim:", "camera.crop": [0, 0, 100, 100], "load.address": "/dev/ttyUSB0",
        "specimen.area_mm2": 7.0, "measure.zoi": 24, "measure.mask": "front.png", "scale.mm_per_px": 0.02,
        "gauges.axial": {"kind": "line", "start": [1, 1], "end": [1, 50]},
    }  # fmt: skip
    with_rig = load_config(None, given | {"camera.back": str(rig)})
    front, back = camera_configs(with_rig, {"measure.zoi": 32}).values()
    assert back.camera == CameraConfig(address="/dev/video1", crop=(1, 2, 300, 200))
    assert (back.measure.roi, back.measure.zoi, list(back.gauges)) == ((5, 6, 70, 80), 32, ["behind"])
    assert (back.specimen.axis, back.specimen.area_mm2, back.load.address) == ("x", 7.0, "/dev/ttyUSB0")
    assert (back.scale.mm_per_px, front.measure.zoi, front.scale.mm_per_px) == (0.05, 24, 0.02)
    _, plain = camera_configs(load_config(None, given | {"camera.back": "/dev/video2"}), {}).values()
    assert plain.camera == CameraConfig(address="/dev/video2")
    assert (plain.measure.mask, plain.measure.zoi, list(plain.gauges)) == (None, 24, ["axial"])
    both = load_config(None, given | {"camera.back": str(rig), "camera.beside": "sim:"})
    with pytest.raises(ConfigError, match="not both"):
        camera_configs(both, {})
    rig.write_text("[camera]\naddress = 'sim:'\nback = 'sim:'\n")
    with pytest.raises(ConfigError, match=r"no camera\.back or camera\.beside"):
        camera_configs(with_rig, {})


def test_the_channels_of_front_and_back_together() -> None:
    assert joint_channels(["left"]) == (
        *JOINT_CHANNELS, "mean_gauge_left", "bending_gauge_left", "sigma_mean_gauge_left",
    )  # fmt: skip
    assert all(map(is_joint, joint_channels(["left"])))
    own = [name for name in channel_names(["left"], system=True) if not is_joint(name)]
    assert {"axial", "gauge_left", "sigma_gauge_left", "disk_min"} <= set(own)
    assert "disk_min" not in channel_names(["left"])
