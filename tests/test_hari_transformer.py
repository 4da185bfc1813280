"""embodied.agents.hari.networks: the same network as torch's, over packed rows."""

import pytest
import torch
from torch import nn

from embodied.agents.hari.networks import Packing, Transformer, fast_dropout


@pytest.fixture
def rows() -> tuple[torch.Tensor, Packing]:
    torch.manual_seed(0)
    present = torch.tensor([[1, 1, 1, 1, 1], [1, 1, 0, 0, 0], [1, 0, 0, 0, 0]], dtype=torch.bool)
    return torch.randn(3, 5, 8), Packing.of(present)


def torchs(mine: Transformer) -> nn.TransformerEncoder:
    """torch's own with the weights of `mine`."""
    layer = nn.TransformerEncoderLayer(8, 2, 32, 0.0, batch_first=True, norm_first=True)
    theirs = nn.TransformerEncoder(layer, len(mine.layers), nn.LayerNorm(8), enable_nested_tensor=False)
    for a, b in zip(mine.layers, theirs.layers, strict=True):
        b.self_attn.in_proj_weight.data = torch.cat([a.query.weight.data, a.looked_at.weight.data])
        b.self_attn.in_proj_bias.data = torch.cat([a.query.bias.data, a.looked_at.bias.data])
        pairs = (a.before, b.norm1), (a.between, b.norm2), (a.merge, b.self_attn.out_proj)
        for x, y in (*pairs, (a.widen, b.linear1), (a.narrow, b.linear2)):
            y.load_state_dict(x.state_dict())
    theirs.norm.load_state_dict(mine.norm.state_dict())
    return theirs


def test_it_computes_what_torchs_does(rows):
    padded, packing = rows
    mine = Transformer(8, 2, 2, 0.0)
    expected = torchs(mine)(padded, src_key_padding_mask=~packing.present)
    torch.testing.assert_close(mine(packing.pack(padded), packing), packing.pack(expected))
    torch.testing.assert_close(mine(packing.pack(padded), packing, first_rows_only=True), expected[:, 0])


def test_it_learns_from_the_first_rows_what_torchs_would(rows):
    padded, packing = rows
    mine = Transformer(8, 2, 2, 0.0)
    theirs = torchs(mine)
    mine(packing.pack(padded), packing, first_rows_only=True).square().sum().backward()
    theirs(padded, src_key_padding_mask=~packing.present)[:, 0].square().sum().backward()
    torch.testing.assert_close(mine.layers[0].widen.weight.grad, theirs.layers[0].linear1.weight.grad)
    torch.testing.assert_close(mine.layers[1].narrow.weight.grad, theirs.layers[1].linear2.weight.grad)


def test_padding_and_packing_are_each_others_inverse(rows):
    padded, packing = rows
    assert packing.first_rows.tolist() == [0, 5, 7]
    torch.testing.assert_close(packing.pad(packing.pack(padded))[packing.present], padded[packing.present])
    assert not packing.pad(packing.pack(padded))[~packing.present].any()


def test_dropout_silences_its_share_and_keeps_the_mean():
    torch.manual_seed(0)
    dropped = fast_dropout(torch.ones(1001, 100), 0.1)
    assert float((dropped == 0).float().mean()) == pytest.approx(26 / 256, abs=0.003)
    assert float(dropped.mean()) == pytest.approx(1.0, abs=0.005)
    assert float(dropped.max()) == pytest.approx(256 / 230)
