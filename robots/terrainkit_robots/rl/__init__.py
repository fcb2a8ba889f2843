"""The training loop: MuJoCo steps, rsl-rl learns, terrainkit supplies the ground and the task.

Read it in this order: `env`, which is the loop; then what it calls: `task` (every number), `scene`
(the model), `physics` (what steps it), `sensors` and `state` (what is known after a step),
`observations`, `rewards` and `earnings`, `terminations`, `commands`, `control`, `start`,
`randomization`, `careers` (the terrain curriculum). `training` and `runner` learn with it.
"""
