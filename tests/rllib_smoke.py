"""Training on a Ray cluster of two nodes survives the death of a node, and of itself.

`make rllib-smoke` runs it, in the virtual environment of RLlib; it takes two to five minutes. Two
node processes are joined by address on this machine, each with one processor, so that each holds
one of two env runners. Everything is started in sessions of its own and ended by them.
"""

import contextlib
import math
import os
import re
import secrets
import signal
import socket
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
TIMEOUT = 300.0  # [s] for anything awaited, on a busy machine
LINE = re.compile(
    r"([\d,]+) steps +([\d,]+) steps/s +return +(\S+) +success +(\S+) +env runners (\d) of 2"
)


@dataclass(frozen=True)
class Progress:
    """One line that the training prints."""

    steps: int
    mean_return: float
    env_runners: int


class Session:
    """A command and all processes that come of it."""

    def __init__(self, command, environment, log):
        self.log = log
        with log.open("wb") as output:
            self.process = subprocess.Popen(
                command,
                cwd=ROOT,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def members(self):
        """Return the ids and names of the session's processes."""
        found = {}
        for folder in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):  # it has ended
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
                if int(fields[3]) == self.process.pid and fields[0] != "Z":
                    name = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                    found[int(folder.name)] = name
        return found

    def env_runners(self):
        """Count the env runners among the session's processes."""
        return sum("SingleAgentEnvRunner" in name for name in self.members().values())

    def kill(self):
        """SIGKILL all, as when a machine loses power."""
        while members := self.members():
            for process in members:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            time.sleep(0.05)
        self.process.wait()

    def progress(self):
        """Read the lines that a training has printed so far."""
        return [
            Progress(int(steps.replace(",", "")), float(mean.replace("-", "nan", 1)), int(runners))
            for steps, _, mean, _, runners in LINE.findall(self.log.read_text(errors="replace"))
        ]

    def wait_for(self, condition, what):
        """Wait until condition() is true; show what was printed instead when it never is."""
        end = time.monotonic() + TIMEOUT
        while not condition():
            if self.process.poll() is not None or time.monotonic() > end:
                raise AssertionError(f"{what}: never seen\n{self.log.read_text()[-5000:]}")
            time.sleep(0.1)
        print(f"{time.monotonic() - BEGUN:6.1f} s  {what}", flush=True)


BEGUN = time.monotonic()


def node(sessions, folder, name, ip, environment, *options):
    """Start a node of one processor; on this machine, an address of its own tells it apart."""
    command = [
        *(Path(sys.executable).with_name("ray"), "start", "--block", "--disable-usage-stats"),
        *("--node-ip-address", ip, "--num-cpus", "1", "--object-store-memory", "100000000"),
        *options,
    ]
    session = Session(command, environment, folder / f"{name}.log")
    sessions.append(session)
    session.wait_for(lambda: "runtime started" in session.log.read_text(), f"node {name} is up")
    return session


def training(sessions, folder, name, environment, *options):
    """Start or resume a training."""
    command = [sys.executable, "-u", ROOT / "train/rllib.py", *options]
    session = Session(command, environment, folder / f"{name}.log")
    sessions.append(session)
    return session


def free_port():
    """Return a port that nobody listens at."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def smoke(folder, sessions):
    """Run the test; the caller ends the sessions."""
    token = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}
    environment = os.environ | token | {"HOME": str(folder), "RAY_USAGE_STATS_ENABLED": "0"}
    port = str(free_port())
    join = ("--address", f"127.0.0.1:{port}")
    lead = ("--head", "--port", port, "--include-dashboard", "false", "--temp-dir", folder / "ray")
    head = node(sessions, folder, "head", "127.0.0.1", environment, *lead)
    worker = node(sessions, folder, "worker", "127.0.0.2", environment, *join)

    run = folder / "runs/PBDPendulum-v0-rllib-0"
    settings = "--env pbd_gym:PBDPendulum-v0 --num-env-runners 2 --num-envs 32"
    steps = "--total-timesteps 1000000 --checkpoint-freq 4000"
    options = (*settings.split(), *steps.split(), "--log-dir", run.parent, *join)
    first = training(sessions, folder, "first", environment, *options)
    first.wait_for(lambda: len(first.progress()) >= 5, "five iterations on two nodes")
    assert first.progress()[-1].env_runners == 2
    assert (head.env_runners(), worker.env_runners()) == (1, 1)
    first.wait_for(lambda: checkpoint_steps(run) > 0, "a checkpoint")

    worker.kill()
    done = len(first.progress())
    first.wait_for(lambda: len(first.progress()) >= done + 10, "ten more, without one node")
    assert first.progress()[-1].env_runners == 1
    assert head.env_runners() == 1

    other = node(sessions, folder, "other", "127.0.0.3", environment, *join)
    first.wait_for(lambda: first.progress()[-1].env_runners == 2, "its env runner on the new node")
    assert other.env_runners() == 1
    done = len(first.progress())
    first.wait_for(lambda: len(first.progress()) >= done + 5, "five more on two nodes")

    first.kill()
    seen, saved = first.progress(), checkpoint_steps(run)
    assert [line.steps for line in seen] == sorted({line.steps for line in seen})
    total = saved + 12_000
    options = ("--resume", run, "--total-timesteps", str(total), *join)
    second = training(sessions, folder, "second", environment, *options)
    second.wait_for(second.progress, f"the killed training going on from step {saved:,}")
    assert second.process.wait(TIMEOUT) == 0
    resumed = second.progress()
    assert 0 < saved < resumed[0].steps < saved + 4000
    assert resumed[-1].steps == checkpoint_steps(run) >= total
    # until then the only episodes to end are those cut short to stagger the worlds
    returns = [line.mean_return for line in seen + resumed if line.steps > 16_000]
    assert returns
    assert all(math.isfinite(mean) for mean in returns)
    print(f"mean returns: {', '.join(f'{mean:.1f}' for mean in returns)}")


def checkpoint_steps(run):
    """Return the steps of the last whole checkpoint."""
    return max((int(path.name.split("-")[1]) for path in run.glob("checkpoint-*")), default=0)


if __name__ == "__main__":
    sessions: list[Session] = []
    # not pytest's folder: the path of a Unix socket has room for 107 letters
    with tempfile.TemporaryDirectory(prefix="rllib-", ignore_cleanup_errors=True) as folder:
        try:
            smoke(Path(folder), sessions)
        finally:
            for session in reversed(sessions):
                session.kill()
    print("ok")
