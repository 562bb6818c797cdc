"""Training of the action policy: the network from trigger state to body moment."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import FloatArray
from onboard.policy.files import ActionLayer
from perchhw.learning.trigger_policy import TrainingError

if TYPE_CHECKING:
    import torch

HIDDEN = (10, 10)
"""Widths of the hidden layers; the paper's. The policy that flew has three of ten (paper errata 7)."""

_OUTPUT_UNIT = 1.0e-3  # N m; the network is trained in N mm, where moments are of order 1 to 10


@dataclass(frozen=True)
class ActionSettings:
    """How the action network is made and trained.

    Attributes:
        hidden: widths of the hidden layers.
        epochs: passes over the pairs.
        learning_rate: Adam's step.
        held_out_share: share of the pairs that the network never sees.
    """

    hidden: tuple[int, ...] = HIDDEN
    epochs: int = 3200
    learning_rate: float = 1.0e-3
    held_out_share: float = 0.1


class ActionFit(NamedTuple):
    """A trained action policy.

    Attributes:
        layers: weights and biases, output in N m.
        train_rms: root mean square error on the pairs that it was trained on, N m.
        held_out_rms: the same on the pairs held back (at least one), N m.
        train_indices: which pairs it was trained on.
        held_out_indices: which pairs were held back.
    """

    layers: tuple[ActionLayer, ...]
    train_rms: float
    held_out_rms: float
    train_indices: NDArray[np.int64]
    held_out_indices: NDArray[np.int64]


def fit_action(
    scaled_states: FloatArray, a_rot: FloatArray, settings: ActionSettings | None = None, *, seed: int
) -> ActionFit:
    """Fit the network by Adam on the mean squared error, all pairs in one batch, on the CPU.

    The same seed gives the same network on the same machine and library versions.

    Args:
        scaled_states: (n, 3), standardised.
        a_rot: (n,) moments about b_y, N m.
        settings: of network and training; the defaults without it.
        seed: of the split and of the initial weights.

    Raises:
        TrainingError: too few pairs to hold some back.
    """
    import torch

    settings = settings or ActionSettings()
    train, held_out = _split(len(scaled_states), settings.held_out_share, seed)
    inputs = torch.tensor(scaled_states, dtype=torch.float32)
    targets = torch.tensor(a_rot / _OUTPUT_UNIT, dtype=torch.float32)[:, None]
    # The global generator decides the initial weights; it is put back afterwards.
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = _network((scaled_states.shape[1], *settings.hidden, 1))
    with one_thread():
        _optimise(network, inputs[train], targets[train], settings)
    with torch.no_grad():
        errors = (network(inputs) - targets).numpy()[:, 0] * _OUTPUT_UNIT
    return ActionFit(
        layers=_layers(network),
        train_rms=float(np.sqrt(np.mean(errors[train] ** 2))),
        held_out_rms=float(np.sqrt(np.mean(errors[held_out] ** 2))),
        train_indices=train,
        held_out_indices=held_out,
    )


def _split(count: int, held_out_share: float, seed: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sorted indices of the pairs to train on and of those to hold back."""
    held_out_count = max(1, round(held_out_share * count))
    if count - held_out_count < 1:
        raise TrainingError(f"{count} pairs are too few to train an action policy and hold some back")
    order = np.random.default_rng(seed).permutation(count)
    return np.sort(order[held_out_count:]), np.sort(order[:held_out_count])


def _optimise(
    network: "torch.nn.Sequential", inputs: "torch.Tensor", targets: "torch.Tensor", settings: ActionSettings
) -> None:
    """Train the network in place."""
    import torch

    optimiser = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    loss_function = torch.nn.MSELoss()
    for _ in range(settings.epochs):
        optimiser.zero_grad()
        loss = loss_function(network(inputs), targets)
        loss.backward()
        optimiser.step()


@contextmanager
def one_thread() -> Iterator[None]:
    """Threads that share so small a network wait for each other, ten times as long on a busy machine."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _network(sizes: Sequence[int]) -> "torch.nn.Sequential":
    """Linear layers of these sizes with ELU between them."""
    import torch

    parts: list[torch.nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        parts += [torch.nn.Linear(inputs, outputs), torch.nn.ELU()]
    return torch.nn.Sequential(*parts[:-1])


def _layers(network: "torch.nn.Sequential") -> tuple[ActionLayer, ...]:
    """The network's numbers with its output in N m instead of N mm."""
    import torch

    linear = [part for part in network if isinstance(part, torch.nn.Linear)]
    layers = []
    for part in linear:
        unit = _OUTPUT_UNIT if part is linear[-1] else 1.0
        weights, bias = ((unit * p.detach().double()).float().numpy() for p in (part.weight, part.bias))
        layers.append(ActionLayer(weights, bias))
    return tuple(layers)
