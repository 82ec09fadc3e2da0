"""One episode of the rope task with its scripted policy."""

import gymnasium

env = gymnasium.make("pbd_gym:PBDRope-v0")
scripted = env.get_wrapper_attr("task").scripted
observation, info = env.reset(seed=0)
ended = False
while not ended:
    action = scripted(observation[None])[0]  # your policy here
    observation, reward, terminated, truncated, info = env.step(action)
    ended = terminated or truncated
print(f"success: {info['is_success']}, {100 * info['distance']:.1f} cm from the goal")
env.close()
