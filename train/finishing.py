"""What every training ends with: an evaluation over fresh episodes, and a film."""

from __future__ import annotations

import json

from config import TrainingConfig
from policies import make_policy
from rollouts import make_batch, report, run_episodes
from run_directory import RunDirectory
from video import record_video


def finish(run: RunDirectory, config: TrainingConfig, *, video: bool) -> None:
    """Evaluate the final policy over 100 fresh episodes, and film it."""
    from training import independent_seeds

    seed = independent_seeds(config.seed)["final"]
    env = make_batch(config.env, 100, config.env_kwargs)
    policy = make_policy(str(run.chosen_model), env)
    summary = run_episodes(env, policy, seed=seed).summary()
    env.close()
    summary |= {"env": config.env, "policy": run.chosen_model.name, "seed": seed}
    run.evaluation.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    print(report(summary, f"{run.path.name}, {run.chosen_model.name}"))
    if video:
        record_video(run.video, config.env, str(run.chosen_model), config.env_kwargs, seed=seed)
    files = (run.chosen_model, run.curve_picture, *([run.video] if video else []))
    print("\n".join(str(file) for file in files))
