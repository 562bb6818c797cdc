"""From sensory-motor pairs to a policy: both stages, with their provenance."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from onboard.policy import Policy, make_policy
from onboard.policy_model import PAPER_A_ROT_LIMIT
from perchhw.learning.action_policy import (
    EPOCHS,
    HELD_OUT_SHARE,
    HIDDEN,
    LEARNING_RATE,
    ActionFit,
    fit_action,
)
from perchhw.learning.training_set import TrainingSet
from perchhw.learning.trigger_policy import GAMMA, NU, Scaler, TriggerFit, fit_scaler, fit_trigger


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
    pairs: TrainingSet,
    *,
    name: str = "trained",
    gamma: float = GAMMA,
    nu: float = NU,
    hidden: Sequence[int] = HIDDEN,
    epochs: int = EPOCHS,
    learning_rate: float = LEARNING_RATE,
    held_out_share: float = HELD_OUT_SHARE,
    a_rot_strongest: float = -PAPER_A_ROT_LIMIT,
    seed: int,
) -> TrainingResult:
    """Train scaler, trigger policy and action policy on pairs.

    The policy may command moments only within those of its pairs, and none beyond `a_rot_strongest`: outside
    them the network extrapolates.

    Args:
        pairs: from :func:`perchhw.learning.training_set.load_training_set`.
        name: of the policy.
        gamma: kernel parameter of the trigger, in standardised cues.
        nu: share of the pairs that may lie outside the region.
        hidden: widths of the action network's hidden layers.
        epochs: of the action network.
        learning_rate: of the action network.
        held_out_share: share of the pairs that the action network never sees.
        a_rot_strongest: what the vehicle can give, N m, negative; the default is the paper's vehicle.
        seed: of everything random.

    Raises:
        TrainingError: the pairs do not vary or are too few.
        PolicyError: what was fitted cannot be a policy (for example too many support vectors).
    """
    scaler = fit_scaler(pairs.states)
    scaled = scaler.transform(pairs.states)
    trigger = fit_trigger(scaled, gamma=gamma, nu=nu)
    action = fit_action(
        scaled,
        pairs.a_rot,
        hidden=hidden,
        epochs=epochs,
        learning_rate=learning_rate,
        held_out_share=held_out_share,
        seed=seed,
    )
    a_rot_limits = (max(a_rot_strongest, float(pairs.a_rot.min())), float(pairs.a_rot.max()))
    provenance = {
        "method": "one-class SVM and ELU network on sensory-motor pairs",
        "pairs": dict(pairs.source),
        "gamma": gamma,
        "nu": nu,
        "hidden": list(hidden),
        "epochs": epochs,
        "learning_rate": learning_rate,
        "held_out_share": held_out_share,
        "seed": seed,
        "inside_share": trigger.inside_share,
        "train_rms_nm": action.train_rms,
        "held_out_rms_nm": action.held_out_rms,
        "versions": {package: version(package) for package in ("perchhw", "numpy", "scikit-learn", "torch")},
    }
    policy = make_policy(
        name=name,
        scaler_mean=np.asarray(scaler.mean),
        scaler_std=np.asarray(scaler.std),
        support_vectors=trigger.support_vectors,
        dual_coefficients=trigger.dual_coefficients,
        gamma=gamma,
        intercept=trigger.intercept,
        layers=action.layers,
        a_rot_limits=a_rot_limits,
        provenance=provenance,
    )
    return TrainingResult(policy=policy, scaler=scaler, trigger=trigger, action=action)
