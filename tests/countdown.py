"""A vector environment whose worlds end apart, some by termination."""

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space


class Countdown(VectorEnv):
    """World w ends after w + 2 steps, odd worlds by termination; the reward counts its steps."""

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012, as Gymnasium has it

    def __init__(self, num_envs):
        self.num_envs, self.render_mode = num_envs, None
        self.single_observation_space = Box(0, np.inf, (1,), np.float32)
        self.single_action_space = Box(-1, 1, (1,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(self, *, seed=None, options=None):
        self.count = np.zeros(self.num_envs)
        return self.observation(), {}

    def step(self, actions):
        self.count += 1
        worlds = np.arange(self.num_envs)
        reward, ended = self.count.copy(), self.count == worlds + 2
        everywhere = np.ones(self.num_envs, dtype=bool)
        info = {"is_success": reward > 2, "_is_success": everywhere}
        info |= {"normalized_performance": reward / 10, "_normalized_performance": everywhere}
        if ended.any():
            final = np.full(self.num_envs, None, dtype=object)
            for world in np.flatnonzero(ended):
                final[world] = self.observation()[world]
            info = {"final_info": info, "final_obs": final}
            info |= {"_final_info": ended, "_final_obs": ended}
        self.count[ended] = 0
        odd = worlds % 2 == 1
        return self.observation(), reward, ended & odd, ended & ~odd, info

    def observation(self):
        return self.count[:, None].astype(np.float32)
