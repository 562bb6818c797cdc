"""Sensory-motor pairs from attempts at random: where to flip and how hard, as all attempts show it.

Where approaches scatter, the landing rate of one pair is known from few attempts, and the best of several
at a condition is the luckiest. Here every attempt teaches about its neighbours, as in a response surface (Box
and Wilson, J. Royal Stat. Soc. B 13, 1951): a network learns how likely four legs hold, with and without
contact of the body, from what the drone saw at the trigger and the moment of the flip. Two small networks
then climb it: the time to contact at which to flip for a velocity, and the moment from there. Pairs are drawn
about their answer, and train both stages as those of a sweep do.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from onboard.arrays import FloatArray
from perchhw.learning.action_policy import one_thread
from perchhw.learning.errors import LearningInputError
from perchhw.learning.random_attempts import MOMENTS, TAUS
from perchhw.learning.reward import PAPER
from perchhw.learning.training_set import TrainingSet
from perchhw.learning.trigger_policy import TrainingError

if TYPE_CHECKING:
    import torch

ATTEMPTS_LEAST = 2000
"""Attempts that triggered, below which no surface is fitted."""

PAIRS = 1000
"""Drawn for the training of both stages."""

EARLIEST, LATEST = 0.005, -0.03
"""s, range of tau of the pairs about the best one. A look at the cues comes up to 10 ms after an approach has
entered the region, on average half of that; and the region must be too thick to be flown through between two
looks."""

_JITTER = 0.005
"""s, standard deviation of tau at the trigger about the best one, while that is looked for: it comes from the
looks, and the moment has to make up for it."""

_CLEAN, _CONTACT, _OTHER = range(3)
_SURFACE, _CHOICE = (48, 48), (16, 16)
_BATCH = 2048
_HELD_OUT = 0.05
_UNITS = np.array([1.0, 1.0, 0.1, 1e-3])
"""Of velocity forward and up (m/s), tau (s) and moment (N m), so that all vary by about one."""


@dataclass(frozen=True)
class SurfaceSettings:
    """How long the networks are trained.

    Attributes:
        steps: of the surface. climbs: of those that climb it.
    """

    steps: int = 3000
    climbs: int = 2000


@dataclass(frozen=True)
class SurfacePairs:
    """Pairs, and how good they should be.

    Attributes:
        pairs: to train on.
        clean_rate, contact_rate: four legs without and with contact of the body, by the surface at its own
            highest places: too kind, as every maximum of a fit.
        log_loss: of the surface on attempts held back. base_log_loss: of their shares alone.
    """

    pairs: TrainingSet
    clean_rate: float
    contact_rate: float
    log_loss: float
    base_log_loss: float


@dataclass(frozen=True)
class _Surface:
    """Probabilities of the three outcomes, a function of (n, 4) inputs in :data:`_UNITS`."""

    probabilities: "Callable[[torch.Tensor], torch.Tensor]"
    log_loss: float
    base_log_loss: float


@dataclass(frozen=True)
class _Choice:
    """Best tau for (n, 2) velocities, and the moment for these and a tau (n, 1), in :data:`_UNITS`."""

    tau: "Callable[[torch.Tensor], torch.Tensor]"
    moment: "Callable[[torch.Tensor, torch.Tensor], torch.Tensor]"


def check_attempts(attempts: int) -> None:
    """Refuse fewer attempts than a surface needs, before they are flown.

    Raises:
        LearningInputError: they are too few, even if all of them trigger.
    """
    if attempts < ATTEMPTS_LEAST:
        raise LearningInputError(f"--attempts {attempts}: a surface needs at least {ATTEMPTS_LEAST}")


def surface_pairs(outs: Any, *, seed: int, settings: SurfaceSettings | None = None) -> SurfacePairs:
    """Pairs at the best trigger states that the attempts show.

    A landing with contact of the body counts by the paper's factor (:data:`PAPER`, a third).

    Args:
        outs: of :func:`perchhw.learning.random_attempts.fly_at_random`.
        seed: of everything random.
        settings: the defaults without it.

    Raises:
        TrainingError: too few attempts.
    """
    import torch

    if len(outs) < ATTEMPTS_LEAST:
        raise TrainingError(
            f"{len(outs)} attempts that triggered: fly more, {ATTEMPTS_LEAST} are the least (--attempts)"
        )
    settings = settings or SurfaceSettings()
    rng = np.random.default_rng(seed)
    seen_x, seen_z = outs["theta_x"] * outs["d_ceil"], outs["d_ceil"] / outs["tau"]
    inputs = np.column_stack([seen_x, seen_z, outs["tau"], outs["a_rot"]]) / _UNITS
    four, touched = outs["feet"] >= 3, outs["body_contact"] == 1
    outcome = np.where(four, np.where(touched, _CONTACT, _CLEAN), _OTHER)
    with torch.random.fork_rng(devices=[]), one_thread():
        torch.manual_seed(seed)
        surface = _fit(inputs, outcome, settings.steps, rng)
        choice = _climb(surface, torch.tensor(inputs[:, :2], dtype=torch.float32), settings.climbs)
        drawn = rng.choice(len(inputs), PAIRS, replace=False)
        velocity = torch.tensor(inputs[drawn, :2], dtype=torch.float32)
        late = torch.tensor(rng.uniform(LATEST, EARLIEST, (PAIRS, 1)) / _UNITS[2], dtype=torch.float32)
        with torch.no_grad():
            tau = choice.tau(velocity) + late
            moment = choice.moment(velocity, tau)
            rates = surface.probabilities(torch.cat([velocity, tau, moment], dim=1)).numpy().mean(axis=0)
    states, a_rot = _cues(np.concatenate([velocity.numpy(), tau.numpy(), moment.numpy()], axis=1) * _UNITS)
    source: dict[str, str | int | float] = {
        "format": "landing surface",
        "attempts": len(outs),
        "pairs": PAIRS,
    }
    clean, contact = float(rates[_CLEAN]), float(rates[_CONTACT])
    pairs = TrainingSet(states, a_rot, np.full(PAIRS, clean + contact), source)
    return SurfacePairs(pairs, clean, contact, surface.log_loss, surface.base_log_loss)


def _cues(seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cues (n, 3) and moments (n,) of (n, 4) velocities, tau and moment, all SI."""
    v_x, v_z, tau, a_rot = seen.T
    d_ceil = v_z * tau
    return np.column_stack([tau, v_x / d_ceil, d_ceil]), a_rot


def _fit(inputs: FloatArray, outcome: Any, steps: int, rng: np.random.Generator) -> _Surface:
    """The surface by the cross entropy of the outcomes."""
    import torch

    mean, std = (torch.tensor(of(inputs, axis=0), dtype=torch.float32) for of in (np.mean, np.std))
    scaled = (torch.tensor(inputs, dtype=torch.float32) - mean) / std
    known = torch.tensor(outcome)
    net = _network((4, *_SURFACE, 3))
    loss_function = torch.nn.CrossEntropyLoss()
    order = rng.permutation(len(inputs))
    held = max(1, round(_HELD_OUT * len(order)))
    held_out, train = order[:held], order[held:]
    optimiser = torch.optim.AdamW(net.parameters(), lr=5e-3, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for _ in range(steps):
        batch = rng.choice(train, _BATCH)
        optimiser.zero_grad()
        loss_function(net(scaled[batch]), known[batch]).backward()
        optimiser.step()
        schedule.step()
    for parameter in net.parameters():
        parameter.requires_grad_(False)
    shares = np.bincount(outcome[train], minlength=3) / len(train)
    return _Surface(
        probabilities=lambda x: torch.softmax(net((x - mean) / std), dim=1),
        log_loss=float(loss_function(net(scaled[held_out]), known[held_out])),
        base_log_loss=float(-np.log(np.maximum(shares, 1e-9))[outcome[held_out]].mean()),
    )


def _climb(surface: _Surface, velocities: "torch.Tensor", climbs: int) -> _Choice:
    """The networks of tau and moment that land most often over the velocities (n, 2) of the attempts."""
    import torch

    mean, std = velocities.mean(dim=0), velocities.std(dim=0)
    tau_net, moment_net = _network((2, *_CHOICE, 1)), _network((3, *_CHOICE, 1))
    tau_unit, moment_unit = _UNITS[2], _UNITS[3]
    (tau_low, tau_high), (moment_low, moment_high) = TAUS, MOMENTS

    def tau(velocity: "torch.Tensor") -> "torch.Tensor":
        share = torch.sigmoid(tau_net((velocity - mean) / std))
        return (tau_low + (tau_high - tau_low) * share) / tau_unit

    def moment(velocity: "torch.Tensor", at: "torch.Tensor") -> "torch.Tensor":
        centred = 2.0 * (at * tau_unit - tau_low) / (tau_high - tau_low) - 1.0
        share = torch.sigmoid(moment_net(torch.cat([(velocity - mean) / std, centred], dim=1)))
        return (moment_low + (moment_high - moment_low) * share) / moment_unit

    worth = torch.tensor([1.0, PAPER.contact_factor, 0.0])
    optimiser = torch.optim.Adam([*tau_net.parameters(), *moment_net.parameters()], lr=5e-3)
    for _ in range(climbs):
        velocity = velocities[torch.randint(0, len(velocities), (_BATCH,))]
        off = _JITTER / tau_unit * torch.randn(_BATCH, 1)
        at = tau(velocity) + off
        found = torch.cat([velocity, at, moment(velocity, at)], dim=1)
        optimiser.zero_grad()
        (-(surface.probabilities(found) @ worth).mean()).backward()
        optimiser.step()
    return _Choice(tau, moment)


def _network(sizes: tuple[int, ...]) -> "torch.nn.Sequential":
    """Linear layers of these sizes with SiLU between them: smooth, so that there is a slope to climb."""
    import torch

    parts: list[torch.nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        parts += [torch.nn.Linear(inputs, outputs), torch.nn.SiLU()]
    return torch.nn.Sequential(*parts[:-1])
