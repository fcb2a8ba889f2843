"""The training loop: MuJoCo steps, rsl-rl learns, terrainkit supplies the ground and the task.

Read it in this order: `task` (every number), `scene` (the model), `physics` (what steps it),
`state` (what is known after a step), `observations`, `rewards`, `commands`, `terminations`,
`careers` (the terrain curriculum), `env` (all of it as rsl-rl's `VecEnv`), `train`.
"""
