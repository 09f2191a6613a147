"""A picture of the marker boards and the world behind them by the true camera."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.docks import Docks
from sim.camera.backdrop import Backdrop
from sim.camera.conditions import CLEAR, Conditions
from sim.camera.kernels import draw_panel
from sim.camera.lens import Drops, glare_map
from sim.camera.model import TrueCamera, corner_rays
from sim.camera.motion import Motion
from sim.camera.panels import Panel, build_panels
from sim.camera.params import CameraParams
from sim.camera.scenery import Scenery
from sim.camera.sensor import expose
from sim.camera.still import StillScene
from sim.camera.view import View

Array = NDArray[np.float64]
Grey = NDArray[np.uint8]

_SAMPLES = 64  # places in a pixel where edges meet
_MAP_STEPS = 9  # times in a picture at which poses are evaluated; linear in between
_BANK = 1 << 19
_QUAD_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])


class Renderer:
    """Pictures of one camera.

    docks: their boards are drawn. random: the source of all noise: equal generator states give equal pictures.
    scenery: the world behind the boards; None: sky and ground alone.
    """

    def __init__(
        self,
        camera: TrueCamera,
        docks: Docks,
        params: CameraParams,
        random: np.random.Generator,
        scenery: Scenery | None = None,
    ) -> None:
        self._camera, self._params, self._random = camera, params, random
        self._size = (camera.intrinsics.height, camera.intrinsics.width)
        self._rays = corner_rays(camera.intrinsics)
        self._view = View(camera.intrinsics)
        self._panels = build_panels(docks, params.board)
        self._backdrop = Backdrop(camera.intrinsics, params, scenery or Scenery())
        self._seed = int(random.integers(1 << 31))
        self._bank = random.standard_normal(_BANK + camera.intrinsics.width, np.float32)
        self._drops = Drops(self._size, np.random.default_rng(self._seed))
        self._samples = _spread_samples(_SAMPLES)
        self._image = np.empty(self._size, np.float32)
        self._still = StillScene()

    def render(self, motion: Motion, conditions: Conditions = CLEAR, out: Grey | None = None) -> Grey:
        """(height, width) picture, its middle row exposed around ``motion.time_s``. out: memory to write it into."""
        times = self._times(motion.time_s)
        cameras = motion.base.at(times) @ self._camera.mounting
        boards = {name: track.at(times) for name, track in motion.boards.items()}
        if not self._still.same(cameras, boards, conditions):
            self._compose(cameras, boards, conditions)
        return self._expose(conditions, np.empty(self._size, np.uint8) if out is None else out)

    def _compose(self, cameras: Array, boards: Mapping[str, Array], conditions: Conditions) -> None:
        """The light that falls on the sensor. cameras, boards: (k, 4, 4) poses in map at the moments of a picture."""
        middle = len(cameras) // 2
        poses = {name: poses[middle] for name, poses in boards.items()}
        depth = self._backdrop.draw(cameras[middle], poses, self._white(conditions), self._image)
        for panel in self._panels:
            if panel.dock in boards:
                self._draw(panel, cameras, boards[panel.dock] @ panel.pose, conditions, depth)
        if conditions.rain > 0.0:
            self._drops.refract(self._image, conditions.rain)
        if conditions.glare is not None:
            self._image += glare_map(self._size, conditions.glare)

    def _times(self, time_s: float) -> Array:
        """(k,) moments from before the first row's exposure to after the last row's."""
        shutter = self._params.shutter
        half = 0.5 * (self._size[0] * shutter.row_time_s + shutter.exposure_s)
        return time_s + np.linspace(-half, half, _MAP_STEPS)

    def _white(self, conditions: Conditions) -> float:
        return self._params.sensor.white_dn * conditions.illumination

    def _draw(
        self, panel: Panel, cameras: Array, panels: Array, conditions: Conditions, depth: NDArray[np.float32]
    ) -> None:
        inside = np.linalg.inv(panels) @ cameras  # the camera in the panel's frame
        window, farthest_m = self._window(panel, inside)
        if window is None:
            return
        maps = _maps(inside)
        board = self._params.board
        front = bool(inside[len(inside) // 2, 2, 3] > 0.0)
        cells = panel.paint(board, conditions) if front else np.full(panel.black.shape, board.panel, np.float32)
        dirt = panel.dirt(conditions, self._seed) if front else np.zeros((0, 0, 0), np.float32)
        draw_panel(
            self._image,
            self._rays,
            window,
            maps,
            self._clock(maps),
            panel.rect,
            board.panel,
            panel.grids,
            cells,
            self._samples,
            self._light(panel, conditions),
            dirt,
            board.dirt,
            depth,
            self._params.backdrop.divisor,
            farthest_m,
        )
        self._blur(window, float(np.linalg.norm(inside[len(inside) // 2, :3, 3])), conditions)

    def _clock(self, maps: Array) -> Array:
        shutter = self._params.shutter
        half = 0.5 * (self._size[0] * shutter.row_time_s + shutter.exposure_s)
        first_row = -0.5 * (self._size[0] - 1) * shutter.row_time_s
        moves = bool(np.abs(maps - maps[0]).max() > 0.0)
        step = 2.0 * half / (_MAP_STEPS - 1)
        return np.array([-half, step, first_row, shutter.row_time_s, shutter.exposure_s, float(moves)])

    def _light(self, panel: Panel, conditions: Conditions) -> Array:
        u, v = 0.5 * (panel.rect[0] + panel.rect[1]), 0.5 * (panel.rect[2] + panel.rect[3])
        light = [self._white(conditions), *conditions.gradient_per_m, u, v, 0.0, 0.0, 0.0, 0.0, 0.0]
        if conditions.shadow is not None:
            edge = conditions.shadow
            light[5:] = [edge.depth, np.cos(edge.angle_rad), np.sin(edge.angle_rad), edge.offset_m, edge.softness_m]
        return np.array(light)

    def _window(self, panel: Panel, inside: Array) -> tuple[NDArray[np.int64] | None, float]:
        """Rows and columns that the panel can touch, None if it is out of view; depth of its farthest corner, m."""
        windows, farthest_m = [], 0.0
        for view in (inside[0], inside[len(inside) // 2], inside[-1]):
            corners = (panel.corners() - view[:3, 3]) @ view[:3, :3]  # in the optical frame
            farthest_m = max(farthest_m, float(corners[:, 2].max()))
            window = self._view.window(corners, _QUAD_EDGES)
            if window is not None:
                windows.append(window)
        if not windows:
            return None, farthest_m
        low, high = np.min(windows, axis=0), np.max(windows, axis=0)
        return np.array([low[0], high[1], low[2], high[3]]), farthest_m

    def _blur(self, window: NDArray[np.int64], distance_m: float, conditions: Conditions) -> None:
        """Point spread of the lens over the panel's part of the picture; the backdrop is soft already."""
        lens = self._params.lens
        focal = self._camera.intrinsics.fx
        # A point out of focus becomes a disc; a gaussian of a quarter of its diameter has the same second moment.
        disc = 0.25 * focal * lens.aperture_m * abs(1.0 / max(distance_m, 0.05) - 1.0 / lens.focus_m)
        sigma = float(np.sqrt(lens.blur_px**2 + disc**2 + conditions.blur_px**2))
        if sigma < 0.05:
            return
        pad = int(np.ceil(3.0 * sigma)) + 1
        top, bottom = max(window[0] - pad, 0), min(window[1] + pad, self._size[0])
        left, right = max(window[2] - pad, 0), min(window[3] + pad, self._size[1])
        part = self._image[top:bottom, left:right]
        kernel = 2 * int(np.ceil(3.0 * sigma)) + 1
        part[:] = cv2.GaussianBlur(part, (kernel, kernel), sigma, borderType=cv2.BORDER_REPLICATE)

    def _expose(self, conditions: Conditions, out: Grey) -> Grey:
        sensor = self._params.sensor
        gain = float(np.clip(1.0 / max(conditions.illumination, 1e-6), 1.0, sensor.max_gain))
        offsets = self._random.integers(_BANK, size=self._size[0])
        factor = conditions.noise_factor
        shot = factor**2 * 255.0 / sensor.full_well_e
        expose(self._image, gain, self._bank, offsets, factor * sensor.read_noise_dn, shot, out)
        return out


def _maps(inside: Array) -> Array:
    """(k, 10) numbers of the kernel's maps from (k, 4, 4) poses of the camera in the panel's frame."""
    x, y, z = inside[:, 0, 3, None], inside[:, 1, 3, None], inside[:, 2, 3, None]
    right, up, out = inside[:, 0, :3], inside[:, 1, :3], inside[:, 2, :3]
    return np.ascontiguousarray(np.concatenate([x * out - z * right, y * out - z * up, out, -z], axis=1))


def _spread_samples(count: int) -> NDArray[np.float32]:
    """(count, 3) places in a pixel and in the exposure: each coordinate takes every multiple of 1/count once."""
    index = np.arange(count)
    bits = count.bit_length() - 1
    reversed_bits = np.array([int(format(i, f"0{bits}b")[::-1], 2) for i in index])
    scattered = (index * 19 + 7) % count
    return np.ascontiguousarray((np.stack([index, reversed_bits, scattered], axis=1) + 0.5) / count, dtype=np.float32)
