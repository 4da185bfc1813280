"""VlnPolicy: the follower's network as a Policy of embodied.interface, batched over episodes; and VlnAgent, trained.

The network: an LSTM that reads, one that acts and attends to words and views (Anderson et al. 2018, Fried et al. 2018,
Tan et al. 2019). B agents, A actions of the one that has most (0 is stop), L words, D size of a view's features, h the
hidden size.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from embodied import interface
from embodied.agents.common import tensors
from embodied.agents.common.imitation import About, SightedAgent
from embodied.agents.common.vocabulary import Vocabulary
from embodied.agents.common.weights import check_features
from embodied.agents.hanna.attention import DotAttend, action_index, candidate_rows, orientation
from embodied.agents.learners.vln import FollowerSettings
from embodied.agents.vision.features import FeatureBank
from embodied.assets.records import ROOM_KINDS
from embodied.geometry import wrap
from embodied.teachers.shortest import shortest_of

SPREAD = 0.15
"""Deviation, as a share of the instruction, with which attention begins around the words for the way ahead."""
COPIES = 8
"""Of the four orientation features beside those of a view."""


@dataclass(frozen=True, eq=False)
class FollowerViews:
    """The views of B agents in one step."""

    views: Tensor
    """(B, 36, D + 4 COPIES) features and directions, relative to where they look, of all views."""
    actions: Tensor
    """(B, A - 1, D + 4 COPIES) the same of what can be gone to."""
    mask: Tensor
    """(B, A) bool, which actions there are."""


@dataclass(frozen=True, eq=False)
class FollowerState(tensors.Rows):
    """The instructions of B agents, read, and what they remember of the way."""

    words: Tensor
    """(B, L, h)."""
    mask: Tensor
    """(B, L) bool, which of them are words."""
    hidden: Tensor
    cell: Tensor
    """(B, h) of the LSTM that acts."""
    meant: Tensor
    """(B, h) the words attended to, and the hidden state, as one."""
    taken: Tensor
    """(B, h) the last action as it was seen; zero at first."""


@dataclass(frozen=True, eq=False)
class FollowerOutputs:
    """Outputs of the network in one step."""

    moves: Tensor
    """(B, A) logits, -inf where there is no action."""
    left: Tensor
    """(B,) which share of the way is left, as it guesses."""
    rooms: Tensor
    """(B, A, kinds) logits of the kind of room that it stands in (0) and that it can go to."""
    tokens: Tensor
    """(B, A, h) the actions as they were seen."""


class FollowerNetwork(nn.Module):
    """pi(a | o, d), with a guess of the way that is left and of the rooms that are near."""

    def __init__(self, config: FollowerSettings, words: int, features: int) -> None:
        super().__init__()
        h, size = config.hidden_size, features + 4 * COPIES
        self.embed, self.dropout = nn.Embedding(words, h, padding_idx=0), nn.Dropout(config.dropout)
        self.read = nn.LSTM(h, h // 2, batch_first=True, bidirectional=True)
        self.begins = nn.Linear(h, 2 * h)
        self.look, self.stand = DotAttend(h, size, h), DotAttend(h, size, h)
        self.enter = nn.Sequential(nn.Linear(size, h), nn.ReLU(), nn.Linear(h, h), nn.LayerNorm(h, eps=1e-6))
        self.act, self.room = nn.LSTMCell(2 * h, h), nn.Linear(h, len(ROOM_KINDS))
        self.query, self.mean = nn.Linear(h, h, bias=False), nn.Linear(2 * h, h)
        self.drawn = nn.Parameter(torch.ones(()))
        self.want, self.stop, self.left = nn.Linear(h, h), nn.Linear(h, 1), nn.Linear(h, 1)

    def begin(self, numbers: Tensor) -> FollowerState:
        """Read (B, L) int64 words; 0 is padding."""
        mask = numbers != 0
        packed = nn.utils.rnn.pack_padded_sequence(
            self.dropout(self.embed(numbers)), mask.sum(1).cpu(), batch_first=True, enforce_sorted=False
        )
        read, (last, _) = self.read(packed)
        words = self.dropout(nn.utils.rnn.pad_packed_sequence(read, batch_first=True)[0])
        hidden, cell = torch.tanh(self.begins(last.transpose(0, 1).flatten(1))).chunk(2, -1)
        return FollowerState(words, mask, hidden, cell, hidden, torch.zeros_like(hidden))

    def forward(self, heard: FollowerState, seen: FollowerViews) -> tuple[FollowerOutputs, FollowerState]:
        """Outputs of one step, and the next state; `taken` is the caller's to fill in."""
        around = self.enter(self.look(heard.meant, seen.views))
        hidden, cell = self.act(self.dropout(torch.cat([heard.taken, around], -1)), (heard.hidden, heard.cell))
        left = self.left(hidden)[:, 0].sigmoid()
        weights = torch.einsum("blh,bh->bl", heard.words, self.query(hidden)) + self.near(heard.mask, left.detach())
        weights = weights.masked_fill(~heard.mask, -torch.inf)
        attended = torch.einsum("bl,blh->bh", weights.softmax(-1), heard.words)
        meant = torch.tanh(self.mean(self.dropout(torch.cat([attended, hidden], -1))))  # (B, h)
        here = self.stand(meant, seen.views)[:, None]
        tokens = self.enter(torch.cat([here, seen.actions], 1))  # (B, A, h)
        scores = torch.einsum("bah,bh->ba", self.dropout(tokens), self.want(meant)) / tokens.shape[-1] ** 0.5
        moves = torch.cat([scores[:, :1] + self.stop(meant), scores[:, 1:]], 1).masked_fill(~seen.mask, -torch.inf)
        outputs = FollowerOutputs(moves, left, self.room(tokens), tokens)
        return outputs, dataclasses.replace(heard, hidden=hidden, cell=cell, meant=meant)

    def near(self, mask: Tensor, left: Tensor) -> Tensor:
        """(B, L) by how much attention is drawn to the words that are as far from the end as the agent is."""
        count = mask.sum(1, keepdim=True)
        done = (torch.arange(mask.shape[1], device=mask.device) + 0.5) / count
        return -self.drawn * ((done - (1 - left[:, None])) / SPREAD) ** 2 / 2


Guided = Callable[[interface.Situation, np.random.Generator], bool]
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
class VlnMemory(tensors.RunningRows):
    """The policy's state between steps; rows belong to the episodes that still run."""

    heard: FollowerState


@dataclass(frozen=True, eq=False)
class VlnPolicy:
    """A trained (or training) follower that acts."""

    network: FollowerNetwork
    vocabulary: Vocabulary
    bank: FeatureBank
    choose: tensors.Chooser = tensors.choose_greedily
    instruction_length: int = 80
    wordless: bool = False
    """True if the instruction is empty to it."""
    environment_dropout: float = 0.0
    """Share of feature channels that an episode does not see at all (Tan et al. 2019). For training."""

    def act(
        self, observations: interface.Observations, memory: VlnMemory | None, *, rngs: interface.Rngs
    ) -> tuple[interface.Actions, VlnMemory]:
        """One step of every running episode; see embodied.interface.Policy."""
        return self.play(observations, None, memory, rngs=rngs)

    def play(
        self,
        observations: interface.Observations,
        situations: interface.Situations | None,
        memory: VlnMemory | None,
        *,
        rngs: interface.Rngs,
        guided: Guided | None = None,
    ) -> tuple[interface.Actions, VlnMemory]:
        """One step of every running episode.

        Args:
          situations: for training: what was said is kept with its gradients, beside what the teacher says.
          guided: whether the teacher acts.
        """
        positions = tuple(i for i, o in enumerate(observations) if o is not None)
        seen = [o for o in observations if o is not None]
        actions: interface.Actions = [None] * len(observations)
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
            thought = interface.Thought(np.append(chance[1 : 1 + len(o.candidates)], chance[0]))
            actions[position] = interface.Stop(thought) if number == 0 else interface.Move(number - 1, thought)
        return actions, dataclasses.replace(memory, heard=dataclasses.replace(heard, taken=taken))

    def _begin(self, positions: tuple[int, ...], seen: Sequence[interface.Observation]) -> VlnMemory:
        device = self.network.left.weight.device
        texts = ["" if self.wordless else o.instruction for o in seen]
        words = torch.from_numpy(self.vocabulary.batch(texts, self.instruction_length)).to(device)
        channels = tensors.hidden_channels(len(seen), self.bank.size, self.environment_dropout, device)
        return VlnMemory(positions=positions, heard=self.network.begin(words), channels=channels)

    def _look(self, seen: Sequence[interface.Observation], channels: Tensor | None) -> FollowerViews:
        views = self.bank.gather([o.sight for o in seen])  # (k, 36, D)
        views = views if channels is None else views * channels[:, None]
        view, angles, mask = candidate_rows(seen)
        yaws = wrap(interface.VIEW_YAWS - np.array([o.turn for o in seen])[:, None] * (np.pi / 6)).astype(np.float32)
        pitches = np.broadcast_to(interface.VIEW_PITCHES.astype(np.float32), yaws.shape)
        towards = views[torch.arange(len(seen))[:, None], torch.from_numpy(view[:, 1:])]
        return FollowerViews(
            torch.cat([views, _directions(views, yaws, pitches)], -1),
            torch.cat([towards, _directions(views, *angles[:, :, 1:])], -1),
            torch.from_numpy(mask).to(views.device),
        )


def _directions(like: Tensor, yaws: np.ndarray, pitches: np.ndarray) -> Tensor:
    return orientation(torch.tensor(yaws, device=like.device), torch.tensor(pitches, device=like.device), COPIES)


def _moment(outputs: FollowerOutputs, situations: Sequence[interface.Situation]) -> VlnMoment:
    device = outputs.moves.device
    moves, left = [], []
    rooms = torch.full(outputs.moves.shape, tensors.IGNORE)
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
            choose=tensors.choose_at(self.about.evaluation.evaluation_temperature),
            instruction_length=config.instruction_length,
            wordless=config.wordless,
        )
