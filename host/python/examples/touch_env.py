"""A simulated touch as a Gymnasium environment: a fingertip on a sensor is to be moved onto a marked place, by touch alone.

    python touch_env.py

Observation: the sensor's image, `(16, 16)` float32, and the place of the mark (shares of the half side). Action: a step in x and y and a change of
pressure, each -1 to 1. Reward: minus the distance to the mark in half sides, minus 1 where nothing is pressed. An episode is over on the mark.
"""

import gymnasium
import numpy as np
import tactomo
from gymnasium import spaces

# Longest step of the finger (m), its radius (m), and conductances from the lightest press to the firmest (S).
STEP_M = 0.004
RADIUS_M = 0.004
LIGHTEST_S, FIRMEST_S = 1e-4, 3e-3
# On the mark (m).
NEAR_M = 0.003


class TouchEnv(gymnasium.Env):
    """Each episode presses on another detector, as built around the one described."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, detector="square-60", pixels=16, render_mode=None):
        self.render_mode = render_mode
        self.described = tactomo.Detector(detector)
        self.solver = tactomo.Solver("nonlinear", self.described)
        self.raster = self.solver.mesh.raster(pixels, pixels)
        self.reach_m = 0.85 * np.array(self.described.size_m) / 2
        self.action_space = spaces.Box(-1, 1, (3,), np.float32)
        self.observation_space = spaces.Dict(
            image=spaces.Box(-np.inf, np.inf, (pixels, pixels), np.float32), mark=spaces.Box(-1, 1, (2,), np.float32)
        )

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        seed = int(self.np_random.integers(1 << 31))
        self.board = tactomo.Simulator(self.described.as_built(seed), seed=seed)
        self.solver.reset()
        self.place_m, self.mark_m = self.np_random.uniform(-1, 1, (2, 2)) * self.reach_m
        self.pressure = 0.5
        return self._observation(), {}

    def step(self, action):
        dx, dy, dp = np.clip(action, -1, 1)
        self.place_m = np.clip(self.place_m + STEP_M * np.array([dx, dy]), -self.reach_m, self.reach_m)
        self.pressure = float(np.clip(self.pressure + 0.2 * dp, 0, 1))
        away_m = np.linalg.norm(self.place_m - self.mark_m)
        is_on_mark = bool(away_m < NEAR_M and self.pressure > 0)
        reward = -float(away_m / self.reach_m[0]) - float(self.pressure == 0)
        return self._observation(), reward, is_on_mark, False, {"away_m": away_m}

    def render(self):
        image = self.image / max(self.image.max(), 1e-12)
        return (255 * np.clip(np.repeat(image[:, :, None], 3, axis=2), 0, 1)).astype(np.uint8)

    def _observation(self):
        conductance_s = LIGHTEST_S * (FIRMEST_S / LIGHTEST_S) ** self.pressure
        presses = [(*self.place_m, RADIUS_M, conductance_s)] if self.pressure > 0 else []
        self.image = self.raster(self.solver.solve(self.board.readings(presses)).image)
        return {"image": self.image, "mark": (self.mark_m / self.reach_m).astype(np.float32)}


gymnasium.register("TactomoTouch-v0", TouchEnv, max_episode_steps=100)


def towards_mark(observation):
    """A policy by hand: from the brightest pixel, where the finger is felt, towards the mark."""
    image, mark = observation["image"], observation["mark"]
    row, column = np.unravel_index(image.argmax(), image.shape)
    felt = (np.array([column, image.shape[0] - 1 - row]) + 0.5) / image.shape[0] * 2 - 1
    return np.array([*np.clip(4 * (0.85 * mark - felt), -1, 1), 0], np.float32)


if __name__ == "__main__":
    environment = gymnasium.make("TactomoTouch-v0")
    for episode in range(5):
        observation, _ = environment.reset(seed=episode)
        total, is_over = 0.0, False
        while not is_over:
            observation, reward, terminated, truncated, info = environment.step(towards_mark(observation))
            total, is_over = total + reward, terminated or truncated
        print(f"episode {episode}: {'on the mark' if terminated else 'missed'}, {info['away_m'] * 1e3:.1f} mm away, return {total:.1f}")
