"""The physics: one model, many simulations, stepped together by `mujoco.batch.Batch`.

Every simulation is a world of its own on the same ground. The arrays here are live: they change
with the next step, so what is kept of them has to be copied.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrainkit.errors import ConfigError
from terrainkit_robots.quiet_mujoco import quiet_mujoco
from terrainkit_robots.rl.scene import Scene

Ids = NDArray[np.int64]


class Physics:
    """n simulations of a scene."""

    def __init__(self, scene: Scene, num_envs: int, num_threads: int = 0) -> None:
        """Make them, all at the model's default state.

        Raises:
            ConfigError: if this MuJoCo has no batches.
        """
        try:
            from mujoco.batch import Batch
        except ImportError:
            import mujoco

            raise ConfigError(
                f"MuJoCo {mujoco.__version__} cannot step many simulations at once; "
                "wanted 3.17 or newer: pip install 'terrainkit[train]'"
            ) from None

        self.scene = scene
        self.batch = Batch(scene.model, num_envs, num_threads)
        self.qpos: NDArray[np.float64] = self.batch.bind("qpos")
        self.qvel: NDArray[np.float64] = self.batch.bind("qvel")
        self.ctrl: NDArray[np.float64] = self.batch.bind("ctrl")
        self.torque: NDArray[np.float64] = self.batch.bind("actuator_force")
        self.sensors: NDArray[np.float64] = self.batch.bind("sensordata")
        self._unstable = _unstable()

    def step(self, count: int) -> NDArray[np.bool_]:
        """Step every simulation `count` times.

        Returns:
            Those that went bad, shape (n,): MuJoCo has reset them to its default state, silently.
        """
        import mujoco

        # MuJoCo sets the counts back with the state, so only those from 0 can be relied on.
        self.batch.warning[:, self._unstable, 1] = 0
        with quiet_mujoco():
            self.batch.step(nstep=count, stage=mujoco.mjtStage.mjSTAGE_VEL)
        bad: NDArray[np.bool_] = (self.batch.warning[:, self._unstable, 1] > 0).any(axis=1)
        return bad

    def reset(self, ids: Ids, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> None:
        """Begin some simulations anew.

        Args:
            ids: Which, sorted, shape (k,).
            qpos: Their positions, shape (k, nq).
            qvel: Their velocities, shape (k, nv).
        """
        import mujoco

        self.batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self.qpos[ids] = qpos
        self.qvel[ids] = qvel
        self.refresh(ids)

    def refresh(self, ids: Ids) -> None:
        """Let sensors tell of the states of `ids` as they were written, but for contacts."""
        import mujoco

        with quiet_mujoco():
            self.batch.forward(ids, stage=mujoco.mjtStage.mjSTAGE_VEL)

    def block(self, name: str, ids: Any = slice(None)) -> NDArray[np.float32]:
        """Return a copy of the sensor data of a kind, shape (n, bodies, 3)."""
        values = self.sensors[ids, self.scene.blocks[name]].astype(np.float32)
        return values.reshape(len(values), -1, 3)


def _unstable() -> list[int]:
    """Return which of MuJoCo's warnings are of a state that is not numbers any more."""
    import mujoco

    kind = mujoco.mjtWarning
    bad = (kind.mjWARN_BADQPOS, kind.mjWARN_BADQVEL, kind.mjWARN_BADQACC, kind.mjWARN_BADCTRL)
    return [int(each) for each in bad]
