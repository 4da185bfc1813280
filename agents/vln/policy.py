"""VlnPolicy: the follower's network as a Policy of embodied.interface, batched over episodes; and VlnAgent, trained."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from embodied.agents.common.choosing import Chooser, choose_at, choose_greedily
from embodied.agents.common.losses import IGNORE
from embodied.agents.common.rows import RunningRows, hidden_channels
from embodied.agents.common.sighted import About, SightedAgent
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.common.weights import check_features
from embodied.agents.hanna.inputs import action_index, candidate_rows, orientation
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vln.config import FollowerSettings
from embodied.agents.vln.network import COPIES, FollowerNetwork, FollowerOutputs, FollowerState, FollowerViews
from embodied.assets.records import ROOM_KINDS
from embodied.geometry import wrap
from embodied.interface import (
    VIEW_PITCHES,
    VIEW_YAWS,
    Actions,
    Move,
    Observation,
    Observations,
    Rngs,
    Situation,
    Situations,
    Stop,
    Thought,
)
from embodied.teachers.shortest import shortest_of

Guided = Callable[[Situation, np.random.Generator], bool]
"""True where the teacher acts in the follower's place."""


@dataclass(frozen=True, eq=False)
class VlnMoment:
    """Outputs of the network in one step of the k episodes that still run, and the truth."""

    said: FollowerOutputs
    moves: Tensor
    """(k,) int64, the teacher's action; 0 is stop."""
    left: Tensor
    """(k,) which share of the way is left."""
    rooms: Tensor
    """(k, A) int64, kinds of rooms, IGNORE where there is no action."""


@dataclass(frozen=True, eq=False)
class VlnMemory(RunningRows):
    """The policy's state between steps; rows belong to the episodes that still run."""

    heard: FollowerState


@dataclass(frozen=True, eq=False)
class VlnPolicy:
    """A trained (or training) follower that acts."""

    network: FollowerNetwork
    vocabulary: Vocabulary
    bank: FeatureBank
    choose: Chooser = choose_greedily
    instruction_length: int = 80
    wordless: bool = False
    """True if the instruction is empty to it."""
    environment_dropout: float = 0.0
    """Share of feature channels that an episode does not see at all (Tan et al. 2019). For training."""

    def act(self, observations: Observations, memory: VlnMemory | None, *, rngs: Rngs) -> tuple[Actions, VlnMemory]:
        """One step of every running episode; see embodied.interface.Policy."""
        return self.play(observations, None, memory, rngs=rngs)

    def play(
        self,
        observations: Observations,
        situations: Situations | None,
        memory: VlnMemory | None,
        *,
        rngs: Rngs,
        guided: Guided | None = None,
    ) -> tuple[Actions, VlnMemory]:
        """One step of every running episode.

        Args:
          situations: for training: what was said is kept with its gradients, beside what the teacher says.
          guided: whether the teacher acts.
        """
        positions = tuple(i for i, o in enumerate(observations) if o is not None)
        seen = [o for o in observations if o is not None]
        actions: Actions = [None] * len(observations)
        if not seen:
            assert memory is not None
            return actions, memory.keep(positions)
        with torch.set_grad_enabled(situations is not None and torch.is_grad_enabled()):
            memory = self._begin(positions, seen) if memory is None else memory.keep(positions)
            outputs, heard = self.network(memory.heard, self._look(seen, memory.channels))
            chances = outputs.moves.detach().softmax(-1).cpu().numpy()  # (k, A)
            numbers = [
                self.choose(chance[: 1 + len(o.candidates)], rngs[p])
                for chance, o, p in zip(chances, seen, positions, strict=True)
            ]
            if situations is not None:
                now = [s for p in positions if (s := situations[p]) is not None]
                moment = _moment(outputs, now)
                memory = dataclasses.replace(memory, moments=(*memory.moments, moment))
                if guided is not None:
                    labels = moment.moves.tolist()
                    drawn = zip(numbers, labels, now, positions, strict=True)
                    numbers = [wanted if guided(s, rngs[p]) else own for own, wanted, s, p in drawn]
            taken = outputs.tokens[torch.arange(len(seen)), torch.tensor(numbers)]
        for position, number, chance, o in zip(positions, numbers, chances, seen, strict=True):
            thought = Thought(np.append(chance[1 : 1 + len(o.candidates)], chance[0]))
            actions[position] = Stop(thought) if number == 0 else Move(number - 1, thought)
        return actions, dataclasses.replace(memory, heard=dataclasses.replace(heard, taken=taken))

    def _begin(self, positions: tuple[int, ...], seen: Sequence[Observation]) -> VlnMemory:
        device = self.network.left.weight.device
        texts = ["" if self.wordless else o.instruction for o in seen]
        words = torch.from_numpy(self.vocabulary.batch(texts, self.instruction_length)).to(device)
        channels = hidden_channels(len(seen), self.bank.size, self.environment_dropout, device)
        return VlnMemory(positions=positions, heard=self.network.begin(words), channels=channels)

    def _look(self, seen: Sequence[Observation], channels: Tensor | None) -> FollowerViews:
        views = self.bank.gather([o.sight for o in seen])  # (k, 36, D)
        views = views if channels is None else views * channels[:, None]
        view, angles, mask = candidate_rows(seen)
        yaws = wrap(VIEW_YAWS - np.array([o.turn for o in seen])[:, None] * (np.pi / 6)).astype(np.float32)
        pitches = np.broadcast_to(VIEW_PITCHES.astype(np.float32), yaws.shape)
        towards = views[torch.arange(len(seen))[:, None], torch.from_numpy(view[:, 1:])]
        return FollowerViews(
            torch.cat([views, _directions(views, yaws, pitches)], -1),
            torch.cat([towards, _directions(views, *angles[:, :, 1:])], -1),
            torch.from_numpy(mask).to(views.device),
        )


def _directions(like: Tensor, yaws: np.ndarray, pitches: np.ndarray) -> Tensor:
    return orientation(torch.tensor(yaws, device=like.device), torch.tensor(pitches, device=like.device), COPIES)


def _moment(outputs: FollowerOutputs, situations: Sequence[Situation]) -> VlnMoment:
    device = outputs.moves.device
    moves, left = [], []
    rooms = torch.full(outputs.moves.shape, IGNORE)
    for row, s in enumerate(situations):
        graph, house, goal = s.world.graph, s.world.house, s.targets
        moves.append(action_index(shortest_of(s)))
        whole, rest = (min(float(graph.distance[n, g]) for g in goal) for n in (s.task.start.node, s.pose.node))
        left.append(min(1.0, rest / max(whole, 1e-6)))
        for k, node in enumerate((s.pose.node, *s.candidate_nodes)):
            rooms[row, k] = ROOM_KINDS.index(house.room_by_id[str(graph.room_of_node[node])].kind)
    return VlnMoment(outputs, torch.tensor(moves, device=device), torch.tensor(left, device=device), rooms.to(device))


@dataclass(frozen=True, kw_only=True)
class VlnAbout(About):
    config: FollowerSettings


@dataclass(frozen=True, eq=False)
class VlnAgent(SightedAgent):
    about: VlnAbout
    network: FollowerNetwork
    kind, about_kind = "vln", VlnAbout

    @staticmethod
    def network_of(about: VlnAbout) -> FollowerNetwork:
        return FollowerNetwork(about.config, len(about.words), about.feature_size)

    def policy(self, bank: FeatureBank) -> VlnPolicy:
        check_features(bank.digest, self.about.encoder)
        config = self.about.config
        return VlnPolicy(
            self.network,
            self.vocabulary,
            bank.blind() if config.blind else bank,
            choose=choose_at(self.about.evaluation.evaluation_temperature),
            instruction_length=config.instruction_length,
            wordless=config.wordless,
        )
