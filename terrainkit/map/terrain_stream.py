"""TerrainStream: a new patch for each episode of each environment."""

import warnings
from collections import Counter, defaultdict
from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from terrainkit.curriculum.arrays import to_indices, to_numbers
from terrainkit.errors import ConfigError, TerrainkitWarning
from terrainkit.files.memory import check_memory
from terrainkit.files.parallel_map import executor_failure
from terrainkit.map.generation import BYTES_PER_PATCH, MapBuilder
from terrainkit.map.layout import check_can_generate
from terrainkit.map.map_config import MapConfig
from terrainkit.map.patch import Patch, build_patch
from terrainkit.map.terrain_map import TerrainMap
from terrainkit.settings.type_hint import Count, Fraction, convert

if TYPE_CHECKING:
    from concurrent.futures import Executor, Future

_MAX_INDEX = 2**32
"""Number of environments, and of episodes of each: these have one word of a seed sequence."""

# Python's pool waits forever for a process that was killed while it sent a result.
_MAX_WAIT = 60.0
"""Time after which a patch that an executor builds is late, so that the executor has failed [s]."""

_Index = Annotated[int, Meta(ge=0, le=_MAX_INDEX - 1)]

_BYTES_PER_SAMPLE = 8
"""Memory of the height and the friction of a sample [bytes]."""


class TerrainStream:
    """New patches at each reset, each as a map of one patch.

    The patch of an episode depends on the seed, the environment, the number of the episode, the
    terrain and the difficulty alone. What is built ahead, by how many processes and in which order
    does not matter. `map_config` returns the config of which `generate` makes the same map.
    """

    def __init__(
        self,
        config: MapConfig,
        seed: int = 0,
        *,
        executor: "Executor | None" = None,
        max_ahead: int = 256,
    ) -> None:
        """Start the stream; nothing is built yet.

        Args:
            config: Sub-terrains and all values of the maps; its rows, columns, mode, difficulties
                and seed do not matter. With a border, the patch is inside flat ground.
            seed: Seed of the stream.
            executor: Builds patches ahead, as in `generate`; None to build each when it is needed.
            max_ahead: Largest number of patches that are built ahead.

        Raises:
            ConfigError: if a value is invalid, or maps cannot be generated from the config.
            MemoryLimitError: if `max_ahead` patches would not fit in memory.
        """
        check_can_generate(config)
        self._configs = [
            replace(
                config,
                rows=1,
                cols=1,
                mode="selected",
                terrains=(replace(sub_terrain, proportion=1.0),),
                seed=seed,
            )
            for sub_terrain in config.sub_terrains
        ]
        self._max_ahead = convert("max_ahead", max_ahead, Count)
        samples = config.patch_shape[0] * config.patch_shape[1]
        check_memory(
            self._max_ahead * (samples * _BYTES_PER_SAMPLE + BYTES_PER_PATCH),
            f"a stream with max_ahead {self._max_ahead}",
            ("max_ahead", self._max_ahead),
        )
        self._executor = executor
        self._episodes: Counter[int] = Counter()  # number of maps taken, by environment
        # Patches of the next episode of each environment, by terrain and difficulty.
        self._ahead: defaultdict[int, dict[tuple[int, float], Future[Patch]]] = defaultdict(dict)

    def map_config(self, env_id: int, episode: int, terrain: int, difficulty: float) -> MapConfig:
        """Return the config of the map of an episode, for `generate`.

        It has one patch, mode `selected`, and the sub-terrain, the difficulty and the seed
        `SeedSequence([seed, env_id, episode]).generate_state(1, np.uint64)[0] >> 1`.

        Args:
            env_id: Environment.
            episode: Number of the episode of this environment, from 0.
            terrain: Index of the sub-terrain in `config.sub_terrains`.
            difficulty: Difficulty, 0 to 1.

        Raises:
            ConfigError: if a value is invalid.
        """
        entropy = [
            self._configs[0].seed,
            convert("env_id", env_id, _Index),
            convert("episode", episode, _Index),
        ]
        index: int = convert("terrain", terrain, Annotated[int, Meta(ge=0, lt=len(self._configs))])
        config = copy(self._configs[index])
        seed = np.random.SeedSequence(entropy).generate_state(1, np.uint64)[0]
        # `replace` would validate all values again, which takes longer than to build most patches.
        selected = convert("difficulty", difficulty, Fraction)
        object.__setattr__(config, "selected_difficulty", selected)
        object.__setattr__(config, "seed", int(seed) >> 1)
        return config

    def prefetch(self, env_ids: ArrayLike, terrains: ArrayLike, difficulties: ArrayLike) -> None:
        """Let the executor build patches that environments may have in their next episodes.

        An environment may have several, of which `next_maps` takes one or none. Beyond
        `max_ahead`, and without an executor, nothing is built ahead.

        Args:
            env_ids: Environments, shape (n,).
            terrains: Index of each sub-terrain in `config.sub_terrains`, shape (n,).
            difficulties: Difficulties, 0 to 1, shape (n,) or a single value.

        Raises:
            ConfigError: if a value is invalid.
        """
        free = self._max_ahead - sum(map(len, self._ahead.values()))
        for env_id, terrain, difficulty in self._choices(env_ids, terrains, difficulties):
            config = self.map_config(env_id, self._episodes[env_id], terrain, difficulty)
            ahead = self._ahead[env_id]
            if self._executor and free > 0 and (terrain, difficulty) not in ahead:
                try:
                    ahead[terrain, difficulty] = self._executor.submit(_build_patch, config)
                    free -= 1
                except Exception as error:
                    self._leave_executor(error)

    def next_maps(
        self, env_ids: ArrayLike, terrains: ArrayLike, difficulties: ArrayLike
    ) -> list[TerrainMap]:
        """Return the map of the next episode of each environment.

        It waits for a patch that is being built ahead, and builds any other patch itself. There are
        no warnings about single patches; `generate` has them.

        Args:
            env_ids: Environments, shape (n,), each once.
            terrains: Index of each sub-terrain in `config.sub_terrains`, shape (n,).
            difficulties: Difficulties, 0 to 1, shape (n,) or a single value.

        Returns:
            Maps of one patch.

        Warns:
            TerrainkitWarning: if the executor fails, for example because a process ends. From then
                on, all patches are built in this process.

        Raises:
            ConfigError: if a value is invalid, or a terrain does not fit in the patch. The episodes
                do not count then.
        """
        choices = self._choices(env_ids, terrains, difficulties)
        ids = [env_id for env_id, *_ in choices]
        if len(set(ids)) < len(ids):
            raise ConfigError("env_ids: got an environment twice; expected each once")
        maps = [self._next_map(*choice) for choice in choices]
        self._episodes.update(ids)
        return maps

    def state_dict(self) -> dict[int, int]:
        """Return the number of maps that each environment has had, for a checkpoint."""
        return dict(self._episodes)

    def load_state_dict(self, state: Mapping[Any, int]) -> None:
        """Continue from a `state_dict` of a stream with the same config and seed.

        Args:
            state: The number of maps of each environment; keys may be texts, as in JSON.

        Raises:
            ConfigError: if a number is invalid.
        """
        episodes = {
            convert("env_id", int(env_id) if str(env_id).isdecimal() else env_id, _Index): convert(
                "episode", episode, _Index
            )
            for env_id, episode in state.items()
        }
        for env_id in list(self._ahead):
            self._forget(env_id)
        self._episodes = Counter(episodes)

    def _choices(
        self, env_ids: ArrayLike, terrains: ArrayLike, difficulties: ArrayLike
    ) -> list[tuple[int, int, float]]:
        """Return environment, terrain and difficulty of each of n choices."""
        ids = to_indices("env_ids", env_ids, _MAX_INDEX)
        types = to_indices("terrains", terrains, len(self._configs), len(ids))
        values = to_numbers("difficulties", difficulties, len(ids))
        return list(zip(ids.tolist(), types.tolist(), values.tolist(), strict=True))

    def _next_map(self, env_id: int, terrain: int, difficulty: float) -> TerrainMap:
        config = self.map_config(env_id, self._episodes[env_id], terrain, difficulty)
        patch = None
        if future := self._ahead[env_id].pop((terrain, difficulty), None):
            try:
                patch = future.result(_MAX_WAIT)
            except Exception as error:
                self._leave_executor(error)
        self._forget(env_id)
        builder = MapBuilder(config)
        builder.add(0, 0, 0, patch or _build_patch(config))
        return builder.build()

    def _forget(self, env_id: int) -> None:
        """Drop what was built ahead for an environment."""
        for future in self._ahead.pop(env_id, {}).values():
            future.cancel()

    def _leave_executor(self, error: Exception) -> None:
        """Build patches in this process if an executor failed; raise errors of a terrain."""
        failure = executor_failure(error)
        self._executor = None
        self._ahead.clear()
        text = f"{failure}; patches of the stream are built in this process from now on"
        warnings.warn(text, TerrainkitWarning, stacklevel=4)


def _build_patch(config: MapConfig) -> Patch:
    """Build the patch of a map of one patch."""
    return build_patch(config, config.sub_terrains[0], config.selected_difficulty, 0, 0)
