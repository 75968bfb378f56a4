"""A tactomo sensor as a camera of LeRobot: its image of touch, with which touch enters its datasets.

LeRobot finds it where it is installed, by its name. Then a robot's camera may be

    --robot.cameras="{touch: {type: tactomo, port: /dev/ttyUSB0, width: 64, height: 64, fps: 30}}"

A pixel is the contact conductance per area there, in 255ths of `full_scale_s_per_m2`, the same in all three channels.
"""

import threading
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import tactomo
from lerobot.cameras import Camera, CameraConfig

__all__ = ["TactomoCamera", "TactomoCameraConfig"]


@CameraConfig.register_subclass("tactomo")
@dataclass(kw_only=True)
class TactomoCameraConfig(CameraConfig):
    """`port` is the board's; without it, and without `simulate`, the board on whichever USB serial port answers.

    `solver` has to be one that makes images. `detector` is a preset or a file, such as the one that `tactomo calibrate rub` writes.
    """

    port: str | None = None
    simulate: bool = False
    detector: str = "square-60"
    solver: str = "tikhonov"
    full_scale_s_per_m2: float = 10.0
    fps: int | None = 30
    width: int | None = 64
    height: int | None = 64


class TactomoCamera(Camera):
    """The image of touch, `(height, width, 3)` uint8, as often as it is read."""

    def __init__(self, config: TactomoCameraConfig):
        super().__init__(config)
        if not config.full_scale_s_per_m2 > 0:
            raise ValueError("full_scale_s_per_m2: a number above 0 is needed")
        self.config = config
        self._changed = threading.Condition()
        self._live = self._thread = None

    @property
    def is_connected(self) -> bool:
        return self._live is not None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """None: a board is asked who it is when it is connected, and one without a port finds it."""
        return []

    def connect(self, warmup: bool = True) -> None:
        """Opens the board; `warmup` waits for its first image."""
        if self.is_connected:
            raise ConnectionError(f"{self} is connected already")
        config = self.config
        detector = tactomo.Detector(config.detector)
        # Images of a solver are on a mesh, which pixels are taken from.
        self._raster = tactomo.Solver(config.solver, detector).mesh.raster(self.width or 64, self.height or 64)
        self._image, self._error, self._is_new, self._taken_s = None, None, False, 0.0
        live = tactomo.Live(config.port, simulate=config.simulate, detector=detector, solver=config.solver)
        try:
            live.__enter__()
        except tactomo.TactomoError as error:
            raise ConnectionError(f"{self}: {error}") from error
        self._live = live
        self._thread = threading.Thread(target=self._run, args=(live,), name="tactomo camera", daemon=True)
        self._thread.start()
        if warmup:
            try:
                self.async_read(timeout_ms=10_000)
            except Exception:
                self.disconnect()
                raise

    def read(self, *_args: Any) -> np.ndarray:
        """The next image."""
        with self._changed:
            self._is_new = False
        return self.async_read(timeout_ms=1000)

    def async_read(self, timeout_ms: float = 200) -> np.ndarray:
        """The newest image that was not read yet; waits for one if need be."""
        self._check()
        with self._changed:
            self._changed.wait_for(lambda: self._is_new or self._error, timeout_ms / 1000)
            if self._error:
                raise ConnectionError(f"{self}: {self._error}")
            if not self._is_new:
                raise TimeoutError(f"{self}: no image within {timeout_ms} ms")
            self._is_new = False
            return self._pixels()

    def read_latest(self, max_age_ms: int = 500) -> np.ndarray:
        """The newest image, read or not."""
        self._check()
        with self._changed:
            if self._image is None:
                raise RuntimeError(f"{self}: no image has come yet")
            if time.monotonic() - self._taken_s > max_age_ms / 1000:
                raise TimeoutError(f"{self}: the newest image is older than {max_age_ms} ms")
            return self._pixels()

    def disconnect(self) -> None:
        """Closes the board."""
        self._check()
        self._live.stop()
        self._thread.join()
        self._live = None

    def __str__(self) -> str:
        return f"TactomoCamera({'simulated' if self.config.simulate else self.config.port or 'any port'})"

    def _check(self) -> None:
        if not self.is_connected:
            raise ConnectionError(f"{self} is not connected")

    def _run(self, live: tactomo.Live) -> None:
        error = "the board has ended"
        try:
            for event in live:
                image = event.solution.image
                if image is None:
                    error = f"the solver {self.config.solver} makes no images"
                    break
                with self._changed:
                    self._image, self._is_new, self._taken_s = image, True, time.monotonic()
                    self._changed.notify_all()
        except tactomo.TactomoError as failed:
            error = str(failed)
        with self._changed:
            self._error = error
            self._changed.notify_all()

    def _pixels(self) -> np.ndarray:
        shares = np.clip(self._raster(self._image) / self.config.full_scale_s_per_m2, 0, 1)
        return np.repeat((255 * shares).astype(np.uint8)[:, :, None], 3, axis=2)
