"""Train the bundled quadruped with PPO of Stable-Baselines3.

pip install '.[gymnasium]' stable-baselines3  # in a clone of terrainkit
python docs/examples/stable_baselines3_ppo.py --samples 1000000 --save quadruped.zip
"""

import argparse

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from terrainkit_robots.integrations.gymnasium import TaskVectorEnv
from terrainkit_robots.integrations.stable_baselines3 import Sb3VecEnvWrapper

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--robot", default="quadruped", help="task, or folder of a robot")
parser.add_argument("--terrain", default="plane", help="plane, or a map (.npz)")
parser.add_argument("--num-envs", type=int, default=128)
parser.add_argument("--samples", type=int, default=40_000)
parser.add_argument("--save", help="file of the policy (.zip); its observation scales go beside it")
arguments = parser.parse_args()

torch.set_num_threads(1)  # the networks are small
tasks = TaskVectorEnv(arguments.robot, num_envs=arguments.num_envs, terrain=arguments.terrain)
env = VecNormalize(Sb3VecEnvWrapper(tasks), norm_reward=False, clip_obs=100.0)
model = PPO(
    "MlpPolicy",
    env,
    n_steps=24,
    batch_size=6 * arguments.num_envs,  # four minibatches
    n_epochs=5,
    learning_rate=1e-3,
    target_kl=0.03,
    ent_coef=0.005,
    vf_coef=1.0,
    max_grad_norm=1.0,
    policy_kwargs={
        "net_arch": [128, 128, 128],
        "activation_fn": torch.nn.SiLU,
        "log_std_init": -0.36,
    },
    seed=1,
    device="cpu",
    verbose=1,
)
model.learn(arguments.samples, log_interval=10)
if arguments.save:
    model.save(arguments.save)
    env.save(f"{arguments.save}.scales.pkl")
