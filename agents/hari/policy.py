"""HARI's agent at work: it thinks with its execution policy, and chooses among CUR, GOAL, SUB, DO and DONE (4.3.3.2).

DO does what the execution policy most wants to do; where that is to stop, the goal on top of the stack ends as by DONE.
The belief b^s advances at every time step (appendix E), so that what CUR answered is part of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.tensors import side_by_side
from embodied.agents.hari import networks
from embodied.agents.hari.words import collate, percept
from embodied.interface import (
    Action,
    Actions,
    Ask,
    Description,
    Intention,
    Move,
    Observation,
    Observations,
    Rngs,
    Situations,
    Stop,
    Thought,
)
from embodied.teachers.shortest import shortest_action

DO, DONE = networks.INTENTIONS.index("do"), networks.INTENTIONS.index("done")
ASKS = {name: networks.INTENTIONS.index(name) for name in ("cur", "goal", "sub")}


@dataclass(frozen=True, eq=False)
class Reading:
    """A description as it was read."""

    description: Description
    """Kept, so that its identity stays its own."""
    rows: np.ndarray
    """(M, 5) int64."""
    encoded: Tensor
    """(M, h): what the encoder made of them."""


@dataclass(frozen=True, eq=False)
class Reader:
    """An execution policy that learns no more, and what it has read: each description once.

    Each is read by itself, so that what comes out does not depend on who else was listening.
    """

    executor: networks.Executor
    read: dict[tuple[str, int], Reading] = field(default_factory=dict, repr=False)
    """('state' or 'goal', identity of a description) to what was made of it."""

    def __call__(self, what: str, description: Description) -> Reading:
        """A description of the 'state' or the 'goal'; describers give the same tuple for the same thing."""
        reading = self.read.get((what, id(description)))
        if reading is None:
            rows = self.executor.words.rows(description, what)
            encoded = self.executor.network.encode(torch.from_numpy(rows[None])).rows[0]
            reading = self.read[what, id(description)] = Reading(description, rows, encoded)
        return reading


@dataclass
class Belief:
    """The recurrent state of the execution policy for B agents."""

    carried: Tensor
    """(B, h) b^s of the step before."""
    depths: tuple[int, ...]
    """Goals on each agent's stack when that was; 0 where none is left."""


@dataclass(frozen=True, eq=False)
class Considered:
    """Outputs of the execution policy for b agents at one step."""

    rows: list[int]
    """Which of the B agents, those that have not ended."""
    belief: Tensor
    """(b, h) b^s_t."""
    log_moves: Tensor
    """(b, C + 1) log-probabilities, stopping last."""

    def move(self, k: int) -> int:
        """The likeliest move of the k-th agent, stopping aside."""
        return int(self.log_moves[k, :-1].argmax())

    @property
    def would_stop(self) -> np.ndarray:
        """(b,) bool: whether stopping is the likeliest action."""
        return (self.log_moves.argmax(1) == self.log_moves.shape[1] - 1).numpy()


@torch.inference_mode()
def consider(reader: Reader, observations: Observations, memory: Belief | None) -> tuple[Considered, Belief]:
    """Run the execution policy, which learns no more, on every agent that has not ended."""
    network, words = reader.executor.network, reader.executor.words
    depths = tuple(len(o.extras.goal_descriptions) if o is not None else 0 for o in observations)
    memory = memory or Belief(network.begin(len(observations)).clone(), depths)
    if reader.executor.config.reset_on_goal_change:
        memory = _afresh(memory, depths, network.begin(1)[0])
    rows = [i for i, o in enumerate(observations) if o is not None]
    seen = [o for o in observations if o is not None]
    states = [reader("state", o.extras.state_description) for o in seen]
    goals = [reader("goal", o.extras.goal_descriptions[-1]) for o in seen]
    together = zip(states, goals, seen, strict=True)
    inputs = collate([percept(words, s.rows, g.rows, o.candidates, o.turn) for s, g, o in together])
    state, goal = (networks.EncodedDescriptions(*side_by_side([r.encoded for r in some])) for some in (states, goals))
    belief, log_moves = network(memory.carried[rows], inputs, state, goal)
    return Considered(rows, belief, log_moves), memory


def _afresh(memory: Belief, depths: tuple[int, ...], first: Tensor) -> Belief:
    """The beliefs, those of agents whose stack has grown or shrunk begun anew."""
    changed = [i for i, (now, then) in enumerate(zip(depths, memory.depths, strict=True)) if now != then]
    carried = memory.carried.clone()
    carried[changed] = first
    return Belief(carried, depths)


def carry(considered: Considered, memory: Belief) -> Belief:
    """The beliefs after a step; those of agents that have ended stay."""
    carried = memory.carried.clone()
    carried[considered.rows] = considered.belief
    return Belief(carried, memory.depths)


def available(observation: Observation) -> np.ndarray:
    """(5,) bool: the intentions that are possible now."""
    return np.array([name in ("do", "done") or Intention(name) in observation.can_ask for name in networks.INTENTIONS])


def action_of(intention: int, move: int | None, thought: Thought | None = None) -> Action:
    """An intention as an action of the environment; DO goes to the candidate `move`, or stops where that is None."""
    if intention == DONE or (intention == DO and move is None):
        return Stop(thought)
    return Move(move, thought) if move is not None else Ask(Intention(networks.INTENTIONS[intention]), thought)


@dataclass
class HariMemory:
    """The recurrent state of a learned agent in B episodes."""

    belief: Belief
    actor: Tensor
    """(2, B, hidden)."""
    last: Tensor
    """(B,) int64: 0, or 1 + the intention before."""


@dataclass(frozen=True, eq=False)
class Choice:
    """One step of the learner's, for b agents: what training needs of it."""

    rows: list[int]
    logits: Tensor
    """(b, 5), -inf where not possible."""
    intentions: Tensor
    """(b,) int64, what was chosen."""
    belief: Tensor
    shown: Tensor
    last: Tensor
    depth: Tensor
    """(b, ...) inputs of the heads."""


@dataclass(eq=False)
class HariPolicy:
    """The intention policy over its execution policy, as it is judged or as it learns."""

    executor: networks.Executor
    actor: networks.RecurrentHead
    sample: bool = True
    """Intentions are drawn from psi; False takes the likeliest. Open in the text: docs/sources.md, S78."""
    choices: list[Choice] | None = field(default=None, repr=False)
    """The list that takes each step, for training; None: steps are not kept."""

    def __post_init__(self) -> None:
        self._reader = Reader(self.executor)

    def act(self, observations: Observations, memory: HariMemory | None, *, rngs: Rngs) -> tuple[Actions, HariMemory]:
        """See embodied.interface.Policy."""
        considered, belief = consider(self._reader, observations, memory.belief if memory else None)
        return self._choose(observations, considered, {}, belief, memory, rngs)

    def _choose(
        self,
        observations: Observations,
        considered: Considered,
        led: Mapping[int, int | None],
        belief: Belief,
        memory: HariMemory | None,
        rngs: Rngs,
    ) -> tuple[Actions, HariMemory]:
        mind = memory or HariMemory(
            belief, self.actor.begin(len(observations)), torch.zeros(len(observations), dtype=torch.long)
        )
        rows = considered.rows
        seen = [observations[i] for i in rows]
        depth = torch.tensor([len(o.extras.goal_descriptions) for o in seen if o is not None])
        shown = networks.shown_probabilities(considered.log_moves).clone()
        inputs = considered.belief.clone(), shown, mind.last[rows], depth
        possible = torch.from_numpy(np.stack([available(o) for o in seen if o is not None]))
        scores, after = self.actor(*inputs, mind.actor[:, rows])
        logits = scores.masked_fill(~possible, -torch.inf)
        p = logits.detach().double().softmax(-1).numpy()
        drawn = [
            int(rngs[i].choice(len(networks.INTENTIONS), p=p[k])) if self.sample else int(p[k].argmax())
            for k, i in enumerate(rows)
        ]
        actions: Actions = [None] * len(observations)
        stops = considered.would_stop
        for k, i in enumerate(rows):
            thought = Thought(asks=dict(zip(networks.INTENTIONS, p[k].tolist(), strict=True)))
            own = None if stops[k] else considered.move(k)
            move = led.get(k, own) if drawn[k] == DO else None
            actions[i] = action_of(drawn[k], move, thought)
        intentions = torch.tensor(drawn)
        if self.choices is not None:
            self.choices.append(Choice(rows, logits, intentions, *inputs))
        index = torch.tensor(rows)
        last = mind.last.index_put((index,), intentions + 1)
        return actions, HariMemory(carry(considered, belief), mind.actor.index_copy(1, index, after), last)


@dataclass(eq=False)
class PerfectOnSubgoals(HariPolicy):
    """The skyline of Table 4.7: on a sub-goal, DO walks the shortest path to it, one node each, and stops there."""

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: HariMemory | None, *, rngs: Rngs
    ) -> tuple[Actions, HariMemory]:
        """See embodied.interface.PrivilegedPolicy."""
        considered, belief = consider(self._reader, observations, memory.belief if memory else None)
        led: dict[int, int | None] = {}
        for k, i in enumerate(considered.rows):
            s = situations[i]
            if s is not None and len(s.extras.goals) > 1:
                action = shortest_action(s.world.graph, s.pose, s.targets, s.candidate_nodes)
                led[k] = action.candidate if isinstance(action, Move) else None
        return self._choose(observations, considered, led, belief, memory, rngs)


def policy_of(agent: networks.HariAgent, *, sample: bool = True) -> HariPolicy:
    """A trained agent as it is judged."""
    kind = PerfectOnSubgoals if agent.config.perfect else HariPolicy
    return kind(agent.executor, agent.actor, sample)
