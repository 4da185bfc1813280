"""Navigation from ratings: a person watches an episode and gives one to five stars, nothing else.

The learner is the translator's (agents.common.actor_critic): an agent that was taught by imitation plays
episodes, each episode gets one rating, and every decision of it is credited with the rating less
what a critic expected. Decisions are words there; here they are moves, stopping, and asking.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from agents.bandit.rating_config import RatingConfig
from agents.bandit.ratings import Rater
from agents.common.actor_critic import Decisions, actor_loss, critic_loss
from agents.common.session import Note, Session, descend, episode_seed, tasks_of_update
from agents.common.tensor_file import checksum_of
from agents.hanna.agent import HannaAgent
from agents.hanna.asking import RULES
from agents.hanna.collect import action_index
from agents.hanna.percept import DO_NOTHING, REQUEST
from agents.hanna.policy import HannaMemory, HannaPolicy, for_training
from agents.vision.lessons import Split
from embodied.evaluation import metrics
from embodied.evaluation.rollout import play
from embodied.identity import identity_of
from embodied.interface import Action, Ask, Episode, Intention, Observation
from embodied.navigation.graph import NavGraph
from embodied.seeds import stream


class StateCritic(nn.Module):
    """V of a navigation state: what the agent's own network remembers, read by two layers of its own.

    Unlike the translator's critic it encodes nothing itself: features of panoramas take most of the
    time, and no gradient flows from here into the agent.
    """

    def __init__(self, size: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(size, size), nn.Tanh(), nn.Linear(size, 1))

    def forward(self, states: Tensor) -> Tensor:
        """(..., h) to (...)."""
        return self.layers(states)[..., 0]


@dataclass(frozen=True, eq=False)
class Decided:
    """One step of the episodes that were running."""

    positions: tuple[int, ...]
    log_probabilities: Tensor
    """(k,) of what was decided, with its gradient."""
    states: Tensor
    """(k, h) of the navigation network, without."""


class Watching:
    """A policy that writes down the probability of everything it decides, and the state it decided in."""

    def __init__(self, policy: HannaPolicy) -> None:
        self.policy = policy
        self.decided: list[Decided] = []

    def act(
        self,
        observations: Sequence[Observation | None],
        memory: HannaMemory | None,
        *,
        rngs: Sequence[np.random.Generator],
    ) -> tuple[list[Action | None], HannaMemory]:
        actions, memory = self.policy.act(observations, memory, rngs=rngs)
        if memory.positions:
            running = [(o, a) for o, a in zip(observations, actions, strict=True) if o is not None and a is not None]
            scores = memory.moments[-1].scores
            self.decided.append(
                Decided(
                    memory.positions,
                    decision_log_probability(scores.navigation, scores.ask, running),
                    memory.networks[0].intra_states[:, -1].detach(),
                )
            )
        return actions, dataclasses.replace(memory, moments=())


def decision_log_probability(moves: Tensor, asks: Tensor, decisions: Sequence[tuple[Observation, Action]]) -> Tensor:
    """log pi of whole decisions, (k,): to ask or not where that could be chosen, and which move if not.

    Args:
      moves: (k, A) logits, stop first.
      asks: (k, 2) logits.
    """
    asked = torch.tensor([isinstance(a, Ask) for _, a in decisions])
    could = torch.tensor([Intention.HELP in o.can_ask for o, _ in decisions])
    index = torch.tensor([0 if isinstance(a, Ask) else action_index(a) for _, a in decisions])
    rows = torch.arange(len(decisions))
    move = moves.log_softmax(-1)[rows, index].masked_fill(asked, 0.0)
    ask = asks.log_softmax(-1)[rows, torch.where(asked, REQUEST, DO_NOTHING)].masked_fill(~could, 0.0)
    return move + ask


def score_of(episode: Episode, graph: NavGraph, kind: str) -> float:
    """The true score of an episode in [0, 1], which only the rater sees."""
    if kind == "success":
        return metrics.success(episode, graph)
    if kind == "SDTW" and not metrics.success(episode, graph):
        return 0.0
    start = episode.task.start.node
    goal = min(episode.task.goal_nodes, key=lambda g: (graph.distance[start, g], g))
    return metrics.ndtw(metrics.without_repeats(episode.nodes), shortest_path(graph, start, goal), graph)


def shortest_path(graph: NavGraph, start: int, goal: int) -> tuple[int, ...]:
    path = [start]
    while path[-1] != goal:
        path.append(int(graph.next_hop[path[-1], goal]))
    return tuple(path)


def rated(decided: Sequence[Decided], critic: StateCritic, ratings: Sequence[float]) -> Decisions:
    """The steps of all episodes side by side, (B, T)."""
    episodes, steps = len(ratings), len(decided)
    log_p, states = torch.zeros(episodes, steps), torch.zeros(episodes, steps, decided[0].states.shape[-1])
    mask = torch.zeros(episodes, steps, dtype=torch.bool)
    columns = []
    for t, moment in enumerate(decided):
        rows = torch.tensor(moment.positions)
        columns.append(log_p[:, t].index_put((rows,), moment.log_probabilities))
        states[rows, t], mask[rows, t] = moment.states, True
    return Decisions(torch.stack(columns, 1), critic(states), torch.tensor(ratings, dtype=torch.float32), mask)


def learn_from_stars(
    agent: HannaAgent,
    split: Split,
    rater: Rater,
    config: RatingConfig,
    folder: Path,
    *,
    begun_with: str,
    note: Note = print,
) -> list[dict[str, float]]:
    """Fine-tune `agent` in place by ratings of episodes in the houses of `split`; resumable.

    Writes what agents.common.session writes and, at the end, best.safetensors into `folder`. Dropout is off,
    so that the policy that is rated is the one that learns.

    Args:
      begun_with: fingerprint of the agent's first weights, so that a run is not continued with others.
    """
    critic = StateCritic(agent.config.hidden_size)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(int(stream(config.seed, "begin", "state critic").integers(2**31)))
        critic.apply(lambda layer: layer.reset_parameters() if isinstance(layer, nn.Linear) else None)
    optimizers = {
        "agent": torch.optim.Adam(agent.network.parameters(), config.learning_rate),
        "critic": torch.optim.Adam(critic.parameters(), config.critic_rate),
    }
    identity = identity_of("agents.bandit.navigation", settings=config, rater=rater, begin=begun_with)
    parts = {"agent": agent.network, "critic": critic, **{f"{k} optimizer": o for k, o in optimizers.items()}}
    agent.network.eval()
    policy = for_training(agent.policy(split.bank), RULES[agent.config.ask_rule][0])
    with Session(
        folder, identity, parts, config.updates, may_change=("updates",), checkpoint_minutes=2.0, every=10, note=note
    ) as session:
        for update in session:
            numbers = _learn_once(agent, policy, critic, optimizers, split, rater, config, update)
            session.add(numbers)
            session.history.append({"update": update + 1, **numbers})
    agent.save(Path(folder) / "best.safetensors", identity)
    return session.history[: config.updates]


def _learn_once(
    agent: HannaAgent,
    policy: HannaPolicy,
    critic: StateCritic,
    optimizers: Mapping[str, torch.optim.Optimizer],
    split: Split,
    rater: Rater,
    config: RatingConfig,
    update: int,
) -> dict[str, float]:
    """Play, be rated, learn; returns means over the episodes."""
    tasks = tasks_of_update(split.tasks, update, config.batch, config.seed)
    tasks = [dataclasses.replace(t, horizon=min(t.horizon, config.steps)) for t in tasks]
    watching = Watching(policy)
    episodes = play(split.make_env, watching, tasks, seed=episode_seed(config.seed, update), batch=len(tasks))
    scores = [score_of(e, split.worlds[e.task.world].graph, config.score) for e in episodes]
    rngs = [stream(config.seed, "stars", update, i) for i in range(len(episodes))]
    ratings = [rater.rate(s, rng=rng) for s, rng in zip(scores, rngs, strict=True)]
    found = rated(watching.decided, critic, ratings)
    where = f"navigation from ratings, update {update}"
    loss = critic_loss(found)
    if update >= config.critic_updates:
        descend(actor_loss(found), optimizers["agent"], f"{where}, agent", config.clip)
    descend(loss, optimizers["critic"], f"{where}, critic", config.clip)
    success = [metrics.success(e, split.worlds[e.task.world].graph) for e in episodes]
    return {
        "score": float(np.mean(scores)),
        "rating": float(np.mean(ratings)),
        "success": float(np.mean(success)),
        "critic error": math.sqrt(2 * float(loss.detach()) * len(episodes) / int(found.mask.sum())),
    }


def fingerprint(agent: HannaAgent) -> str:
    """Of an agent's weights."""
    return checksum_of(agent.network.state_dict(), {})
