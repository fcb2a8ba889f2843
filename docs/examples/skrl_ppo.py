"""Train the bundled quadruped with PPO of skrl, on the vector environment of Gymnasium.

pip install '.[gymnasium]' skrl  # in a clone of terrainkit
python docs/examples/skrl_ppo.py --samples 1000000  # skrl writes its log to runs/
"""

import argparse

import torch
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.resources.preprocessors.torch import RunningStandardScaler
from skrl.resources.schedulers.torch import KLAdaptiveLR
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed
from skrl.utils.model_instantiators.torch import deterministic_model, gaussian_model

from terrainkit_robots.integrations.gymnasium import TaskVectorEnv

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--robot", default="quadruped", help="task, or folder of a robot")
parser.add_argument("--terrain", default="plane", help="plane, or a map (.npz)")
parser.add_argument("--num-envs", type=int, default=128)
parser.add_argument("--samples", type=int, default=40_000)
arguments = parser.parse_args()

torch.set_num_threads(1)  # the networks are small
set_seed(1)
tasks = TaskVectorEnv(arguments.robot, num_envs=arguments.num_envs, terrain=arguments.terrain)
env = wrap_env(RecordEpisodeStatistics(tasks, buffer_length=100_000))
spaces = {"observation_space": env.observation_space, "action_space": env.action_space}
hidden = {"name": "net", "input": "OBSERVATIONS", "layers": [128] * 3, "activations": "elu"}
network = {"network": [hidden], "device": env.device, **spaces}
models = {
    "policy": gaussian_model(output="ACTIONS", initial_log_std=-0.36, **network),
    "value": deterministic_model(output="ONE", **network),
}
cfg = PPO_CFG(
    rollouts=24,
    learning_epochs=5,
    mini_batches=4,
    learning_rate=1e-3,
    learning_rate_scheduler=KLAdaptiveLR,
    learning_rate_scheduler_kwargs={"kl_threshold": 0.02},
    value_clip=0.0,
    value_loss_scale=1.0,
    time_limit_bootstrap=True,
    observation_preprocessor=RunningStandardScaler,
    observation_preprocessor_kwargs={"size": env.observation_space, "device": env.device},
)
memory = RandomMemory(memory_size=24, num_envs=env.num_envs, device=env.device)
agent = PPO(models=models, memory=memory, cfg=cfg, device=env.device, **spaces)
timesteps = arguments.samples // arguments.num_envs
trainer = SequentialTrainer(env=env, agents=agent, cfg={"timesteps": timesteps, "headless": True})
trainer.train()
rewards = list(env.return_queue)
first, last = (sum(values) / max(len(values), 1) for values in (rewards[:100], rewards[-100:]))
print(f"reward of the first 100 of {len(rewards)} episodes: {first:.2f}; of the last: {last:.2f}")
