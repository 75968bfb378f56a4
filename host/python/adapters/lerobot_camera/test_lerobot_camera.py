import pathlib
import sys

import numpy as np
import pytest

pytest.importorskip("lerobot.cameras")
sys.path.insert(0, str(pathlib.Path(__file__).parent))

import draccus
import tactomo
from lerobot.cameras import CameraConfig, make_cameras_from_configs
from lerobot_camera_tactomo import TactomoCamera, TactomoCameraConfig


def test_lerobot_makes_it_from_a_configuration_by_its_type():
    config = draccus.decode(CameraConfig, {"type": "tactomo", "simulate": True, "width": 48, "height": 32})
    assert isinstance(config, TactomoCameraConfig) and config.type == "tactomo"
    camera = make_cameras_from_configs({"touch": config})["touch"]
    assert isinstance(camera, TactomoCamera) and (camera.width, camera.height, camera.fps) == (48, 32, 30)
    with camera:
        assert camera.is_connected
        for image in (camera.read(), camera.async_read(timeout_ms=5000), camera.read_latest(max_age_ms=60_000)):
            assert image.shape == (32, 48, 3) and image.dtype == np.uint8
        with pytest.raises(ConnectionError, match="connected already"):
            camera.connect()
    assert not camera.is_connected


def test_a_press_is_the_brightest_where_it_is():
    camera = TactomoCamera(TactomoCameraConfig(simulate=True, full_scale_s_per_m2=1.0))
    camera.connect()
    try:
        camera._live.press([tactomo.Contact(0.01, 0.015, 0.004, 2e-3)])
        for _ in range(500):
            image = camera.async_read(timeout_ms=5000)[:, :, 0]
            row, column = np.unravel_index(image.argmax(), image.shape)
            # Right of the middle, and in the upper half: row 0 is the largest y. What wanders in the scene begins at the lower left.
            if image.max() > 20 and column > 36 and row < 28:
                break
        else:
            pytest.fail(f"the brightest pixel is {row}, {column}")
    finally:
        camera.disconnect()


def test_what_is_wrong_is_raised():
    with pytest.raises(ConnectionError, match="is not connected"):
        TactomoCamera(TactomoCameraConfig(simulate=True)).async_read()
    with pytest.raises(ConnectionError, match="/dev/not-there"):
        TactomoCamera(TactomoCameraConfig(port="/dev/not-there")).connect()
    with pytest.raises(ValueError, match="above 0"):
        TactomoCamera(TactomoCameraConfig(full_scale_s_per_m2=0))
    with pytest.raises(tactomo.TactomoError, match="there is no solver"):
        TactomoCamera(TactomoCameraConfig(simulate=True, solver="jazz")).connect()
