"""From sensory-motor pairs to a policy: both stages, with their provenance."""

from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np

from onboard.policy.files import Policy, make_policy
from onboard.policy.model import PAPER_A_ROT_LIMIT
from perchhw.learning.action_policy import ActionFit, ActionSettings, fit_action
from perchhw.learning.training_set import TrainingSet
from perchhw.learning.trigger_policy import GAMMA, NU, Scaler, TriggerFit, fit_scaler, fit_trigger


@dataclass(frozen=True)
class TrainingSettings:
    """How a policy is made from its pairs.

    Attributes:
        gamma: kernel parameter of the trigger, in standardised cues.
        nu: share of the pairs that may lie outside the region.
        action: of the action network.
        a_rot_strongest: what the vehicle can give, N m, negative; the default is the paper's vehicle.
    """

    gamma: float = GAMMA
    nu: float = NU
    action: ActionSettings = field(default_factory=ActionSettings)
    a_rot_strongest: float = -PAPER_A_ROT_LIMIT


@dataclass(frozen=True)
class TrainingResult:
    """A trained policy and how well each stage fits its pairs.

    Attributes:
        policy: ready to save and upload.
        scaler: standardisation of the cues.
        trigger: the fitted region.
        action: the fitted network, with its errors on training and held-out pairs.
    """

    policy: Policy
    scaler: Scaler
    trigger: TriggerFit
    action: ActionFit


def train_policy(
    pairs: TrainingSet, settings: TrainingSettings | None = None, *, name: str = "trained", seed: int
) -> TrainingResult:
    """Train scaler, trigger policy and action policy on pairs.

    The policy may command moments only within those of its pairs, and none beyond the settings'
    `a_rot_strongest`: outside them the network extrapolates.

    Args:
        pairs: from :func:`perchhw.learning.training_set.load_training_set`.
        settings: of both stages; the defaults without it.
        name: of the policy.
        seed: of everything random.

    Raises:
        TrainingError: the pairs do not vary or are too few.
        PolicyError: what was fitted cannot be a policy (for example too many support vectors).
    """
    settings = settings or TrainingSettings()
    scaler = fit_scaler(pairs.states)
    scaled = scaler.transform(pairs.states)
    trigger = fit_trigger(scaled, gamma=settings.gamma, nu=settings.nu)
    action = fit_action(scaled, pairs.a_rot, settings.action, seed=seed)
    policy = make_policy(
        name=name,
        scaler_mean=np.asarray(scaler.mean),
        scaler_std=np.asarray(scaler.std),
        support_vectors=trigger.support_vectors,
        dual_coefficients=trigger.dual_coefficients,
        gamma=settings.gamma,
        intercept=trigger.intercept,
        layers=action.layers,
        a_rot_limits=(max(settings.a_rot_strongest, float(pairs.a_rot.min())), float(pairs.a_rot.max())),
        provenance=_provenance(pairs, settings, trigger, action, seed),
    )
    return TrainingResult(policy=policy, scaler=scaler, trigger=trigger, action=action)


def _provenance(
    pairs: TrainingSet, settings: TrainingSettings, trigger: TriggerFit, action: ActionFit, seed: int
) -> dict[str, Any]:
    """What the policy was made from, with what, and how well it fits."""
    return {
        "method": "one-class SVM and ELU network on sensory-motor pairs",
        "pairs": dict(pairs.source),
        "gamma": settings.gamma,
        "nu": settings.nu,
        "hidden": list(settings.action.hidden),
        "epochs": settings.action.epochs,
        "learning_rate": settings.action.learning_rate,
        "held_out_share": settings.action.held_out_share,
        "seed": seed,
        "inside_share": trigger.inside_share,
        "train_rms_nm": action.train_rms,
        "held_out_rms_nm": action.held_out_rms,
        "versions": {package: version(package) for package in ("perchhw", "numpy", "scikit-learn", "torch")},
    }
