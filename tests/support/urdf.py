"""A URDF document read by MuJoCo, which has its own parser and kinematics."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

_ROOT = '<robot name="robot">'
# MuJoCo's extension of URDF: keep links behind fixed joints, keep looks; a document without masses gets some.
_OPTIONS = '<mujoco><compiler fusestatic="false" discardvisual="false" boundmass="1" boundinertia="1"/></mujoco>'

Matrix = NDArray[np.float64]


class Urdf:
    """Raises ValueError for a document that MuJoCo rejects."""

    def __init__(self, text: str) -> None:
        assert text.count(_ROOT) == 1
        self.model = mujoco.MjModel.from_xml_string(text.replace(_ROOT, _ROOT + _OPTIONS))
        self._data = mujoco.MjData(self.model)

    @property
    def links(self) -> list[str]:
        return [self.model.body(i).name for i in range(1, self.model.nbody)]

    @property
    def joints(self) -> list[str]:
        """Joints that move."""
        return [self.model.joint(i).name for i in range(self.model.njnt)]

    def link_poses(self, joints: Mapping[str, float]) -> dict[str, Matrix]:
        """(4, 4) of each link in base_link. joints: rad by name."""
        self._move(joints)
        turns, places = self._data.xmat[1:], self._data.xpos[1:]
        return {name: _pose(turn, place) for name, turn, place in zip(self.links, turns, places, strict=True)}

    def visual_poses(self, link: str, joints: Mapping[str, float]) -> list[tuple[Matrix, NDArray[np.float64]]]:
        """Pose in base_link and size, by MuJoCo's convention, of each visual of a link."""
        self._move(joints)
        mine = [i for i in range(self.model.ngeom) if self.model.body(self.model.geom(i).bodyid[0]).name == link]
        return [(_pose(self._data.geom_xmat[i], self._data.geom_xpos[i]), self.model.geom_size[i]) for i in mine]

    def _move(self, joints: Mapping[str, float]) -> None:
        for name, angle_rad in joints.items():
            self._data.joint(name).qpos[0] = angle_rad
        mujoco.mj_kinematics(self.model, self._data)


def _pose(turn: NDArray[np.float64], place: NDArray[np.float64]) -> Matrix:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn.reshape(3, 3), place
    return pose
