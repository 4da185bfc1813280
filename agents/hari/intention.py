"""Training of the intention policy: advantage actor-critic on shaped costs (4.3.4, E.1, E.2).

for update in ...:
    play a batch of training tasks with draws from psi
    costs -> shaped costs (4.20) -> what was still to come at each step, C_t
    critic: descend on (V - C)^2 / 2            (E.2)
    actor:  ascend on (V - C) log psi           (E.1), once the critic has had its own updates
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from agents.common.actor_critic import Decisions, actor_loss, costs_to_go, critic_loss, descend
from agents.common.checkpoint_file import read_checkpoint, refuse_changes, write_checkpoint
from agents.common.session import Note, Progress, Session, seed_of, tasks_of_update
from agents.hari.agent import HariAgent, save_agent
from agents.hari.config import as_dict
from agents.hari.networks import INTENTIONS, RecurrentHead
from agents.hari.policy import Choice, policy_of
from assets.cache import write_json
from embodied.envs.base import HelpEnv
from embodied.envs.hari import shaped_costs
from embodied.evaluation import metrics
from embodied.evaluation.rollout import play
from embodied.interface import Ask, Episode, Move, Place, Task
from embodied.locks import locked

FORMAT = "embodied-hari-intention-1"
MAY_CHANGE = ("iterations", "checkpoint_minutes", "validate_every", "validation_tasks")
EVERY = 20
"""Updates per progress line."""


@dataclass(frozen=True, eq=False)
class Ground:
    """Where the intention policy learns and is validated."""

    places: Mapping[str, Place]
    tasks: Sequence[Task]
    make_env: Callable[[], HelpEnv]


def train(
    agent: HariAgent,
    critic: RecurrentHead,
    training: Ground,
    validation: Ground,
    folder: Path,
    *,
    minutes: float | None = None,
    note: Note = print,
    on_validation: Callable[[int, Sequence[Episode]], None] | None = None,
) -> Progress:
    """Train `agent.actor` and `critic` in place, from `folder`'s checkpoint if there is one.

    Writes checkpoint.pt, best.safetensors (least validation cost), settings.json, validation.jsonl.

    Args:
      minutes: stop after this long in this session, as if interrupted.
      on_validation: is given the update and the episodes of each validation (to record some).

    Raises:
      DivergedError: a loss or gradient is not finite; the last checkpoint is intact.
      LockedError: another process trains in `folder`.
      CheckpointError: the folder's run has other settings or another execution policy, or is damaged.
      KeyboardInterrupt: after Ctrl-C, once the update at hand is done and saved.
    """
    config, folder = agent.config, Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    agent.executor.network.eval()
    run = IntentionRun(agent, critic)
    progress = run.restore(folder / "checkpoint.pt")
    write_json(folder / "settings.json", as_dict(config), indent=1)
    seen: list[dict[str, float]] = []
    with (
        locked(folder),
        Session(
            progress,
            config.updates,
            lambda p: run.save(folder / "checkpoint.pt", p),
            minutes=minutes,
            checkpoint_minutes=config.checkpoint_minutes,
            note=note,
        ) as session,
    ):
        for update in session:
            seen.append(learn_once(run, training, update))
            done, last = update + 1, update + 1 == config.updates
            if done % EVERY == 0 or last:
                note(_line(done, session.progress.seconds, config.updates, seen))
                seen = []
            if done % config.validate_every == 0 or last:
                episodes = _validation_of(agent, validation)
                session.progress = _kept(agent, episodes, validation, session.progress, done, folder, note)
                if on_validation:
                    on_validation(done, episodes)
    return session.progress


class IntentionRun:
    """Owns what changes in a run: the two heads and their optimizers."""

    def __init__(self, agent: HariAgent, critic: RecurrentHead) -> None:
        self.agent, self.critic = agent, critic
        self.policy = policy_of(agent)
        rate = agent.config.learning_rate
        self.actor_optimizer = torch.optim.Adam(agent.actor.parameters(), rate)
        self.critic_optimizer = torch.optim.Adam(critic.parameters(), rate)

    @property
    def _settings(self) -> dict[str, object]:
        frozen = sum(float(p.detach().double().sum()) for p in self.agent.executor.network.parameters())
        return as_dict(self.agent.config) | {"execution policy": round(frozen, 6)}

    def save(self, path: Path, progress: Progress) -> None:
        parts: dict[str, torch.nn.Module | torch.optim.Optimizer] = {
            "actor": self.agent.actor,
            "critic": self.critic,
            "actor optimizer": self.actor_optimizer,
            "critic optimizer": self.critic_optimizer,
        }
        states = {name: part.state_dict() for name, part in parts.items()}
        write_checkpoint(path, FORMAT, {"settings": self._settings, "progress": vars(progress), **states})

    def restore(self, path: Path) -> Progress:
        """Where the run of `path` is; the beginning where there is none."""
        if not path.exists():
            return Progress(best=-math.inf)
        parts = ("actor", "critic", "actor optimizer", "critic optimizer")
        body = read_checkpoint(path, FORMAT, ("settings", "progress", *parts))
        refuse_changes(path, body["settings"], self._settings, MAY_CHANGE)
        self.agent.actor.load_state_dict(body["actor"])
        self.critic.load_state_dict(body["critic"])
        self.actor_optimizer.load_state_dict(body["actor optimizer"])
        self.critic_optimizer.load_state_dict(body["critic optimizer"])
        return Progress(**body["progress"])


def learn_once(run: IntentionRun, ground: Ground, update: int) -> dict[str, float]:
    """One update: of the critic alone among the first `critic_iterations`, else of both; returns numbers to report."""
    config = run.agent.config
    tasks = tasks_of_update(ground.tasks, update, config.batch, config.seed)
    tasks = [dataclasses.replace(t, id=f"{t.id}#{k}") for k, t in enumerate(tasks)]
    choices: list[Choice] = []
    run.policy.choices = choices
    episodes = play(ground.make_env, run.policy, tasks, seed=seed_of(config.seed, update), batch=len(tasks))
    costs, mask = padded([shaped_costs(e, ground.places[e.task.world].graph.hops) for e in episodes])
    log_p, entropy = chosen(choices, len(tasks))
    decisions = Decisions(log_p, -values(run.critic, choices, len(tasks)), -costs_to_go(costs, mask), mask)
    descend(critic_loss(decisions), run.critic_optimizer, config.clip, f"update {update}, critic")
    if update >= config.critic_iterations:
        bonus = config.entropy * (entropy * mask).sum() / len(tasks)
        descend(actor_loss(decisions) - bonus, run.actor_optimizer, config.clip, f"update {update}, actor")
    return numbers_of(episodes, ground.places) | {
        "cost": float((costs * mask).sum() / len(tasks)),
        "critic": float(critic_loss(decisions).detach()),
        "entropy": float((entropy.detach() * mask).sum() / mask.sum()),
    }


def padded(rows: Sequence[Sequence[float]]) -> tuple[Tensor, Tensor]:
    """(B, T) float32 of rows of unequal length, zero behind their ends, and (B, T) bool: where there is something."""
    out = torch.zeros(len(rows), max(map(len, rows)))
    mask = torch.zeros(out.shape, dtype=torch.bool)
    for i, r in enumerate(rows):
        out[i, : len(r)], mask[i, : len(r)] = torch.tensor(r), True
    return out, mask


def chosen(choices: Sequence[Choice], batch: int) -> tuple[Tensor, Tensor]:
    """(B, T) log psi of the intentions that were chosen, and (B, T) entropies; zero behind the ends."""
    log_p, entropy = [], []
    for c in choices:
        log = c.logits.log_softmax(-1)
        log_p.append(_spread(log.gather(1, c.intentions[:, None])[:, 0], c.rows, batch))
        finite = log.masked_fill(torch.isinf(log), 0.0)
        entropy.append(_spread(-(finite * log.exp()).sum(-1), c.rows, batch))
    return torch.stack(log_p, 1), torch.stack(entropy, 1)


def values(critic: RecurrentHead, choices: Sequence[Choice], batch: int) -> Tensor:
    """(B, T) V of the costs to come at each step, by the critic's own memory; zero behind the ends."""
    memory, out = critic.begin(batch), []
    for c in choices:
        before = (memory[0][c.rows], memory[1][c.rows])
        value, after = critic(c.belief, c.shown, c.last, c.depth, before)
        index = torch.tensor(c.rows)
        memory = (memory[0].index_put((index,), after[0]), memory[1].index_put((index,), after[1]))
        out.append(_spread(value[:, 0], c.rows, batch))
    return torch.stack(out, 1)


def _spread(numbers: Tensor, rows: list[int], batch: int) -> Tensor:
    """(b,) numbers of some rows as (B,), zero elsewhere."""
    return numbers.new_zeros(batch).index_put((torch.tensor(rows),), numbers)


def counts_of(episodes: Sequence[Episode]) -> dict[str, float]:
    """Mean number of each intention per episode; DONE on sub-goals counts as 'done'."""
    totals = dict.fromkeys(INTENTIONS, 0)
    for s in (s for e in episodes for s in e.steps):
        if isinstance(s.action, Ask):
            totals[s.action.intention.value] += 1
        else:
            totals["do" if isinstance(s.action, Move) else "done"] += 1
    return {name: n / len(episodes) for name, n in totals.items()}


def numbers_of(episodes: Sequence[Episode], places: Mapping[str, Place]) -> dict[str, float]:
    """Success and the mean number of each intention."""
    success = sum(metrics.success(e, places[e.task.world].graph) for e in episodes) / len(episodes)
    return {"success": success, **counts_of(episodes)}


def _validation_of(agent: HariAgent, ground: Ground) -> Sequence[Episode]:
    config, tasks = agent.config, ground.tasks[: agent.config.validation_tasks]
    with torch.inference_mode():
        return play(ground.make_env, policy_of(agent), tasks, seed=config.seed, batch=config.batch)


def _kept(
    agent: HariAgent,
    episodes: Sequence[Episode],
    ground: Ground,
    progress: Progress,
    update: int,
    folder: Path,
    note: Note,
) -> Progress:
    """Judge by what is optimised: the mean cost, task errors included; keep the cheapest agent."""
    cost = math.fsum(s.cost for e in episodes for s in e.steps) / len(episodes)
    numbers = {"cost": cost, **numbers_of(episodes, ground.places)}
    with open(folder / "validation.jsonl", "a") as f:
        f.write(json.dumps({"update": update, "episodes": len(episodes), **numbers}) + "\n")
    kept = -cost >= progress.best
    said = ", ".join(f"{k} {v:.2f}" for k, v in numbers.items())
    note(f"validation on {len(episodes)} tasks after {update} updates: {said}{'; kept' * kept}")
    if kept:
        save_agent(agent, folder / "best.safetensors")
        return dataclasses.replace(progress, best=-cost, best_update=update)
    return progress


def _line(update: int, seconds: float, updates: int, seen: Sequence[Mapping[str, float]]) -> str:
    mean = {k: math.fsum(s[k] for s in seen) / len(seen) for k in seen[0]}
    said = "  ".join(f"{k} {v:.2f}" for k, v in mean.items())
    return f"{update}/{updates}  {said}  {seconds / 60:.1f} min"
