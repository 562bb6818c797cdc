"""``perchhw learn surface``: a policy from attempts at random, for a world that scatters."""

from pathlib import Path
from typing import Annotated, Any

import typer

from perchhw.cli.learn_options import GridOptions, OutOption, SetupOptions
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.output import emit
from perchhw.screen.long_work import share_done

_OUT = Path("runs/surface")


@with_option_groups
def surface(
    setup: SetupOptions,
    grid: GridOptions,
    attempts: Annotated[int, typer.Option(min=1, help="In all.")] = 300_000,
    name: Annotated[str, typer.Option(help="Name of the policy.")] = "trained",
    out: OutOption = _OUT,
) -> None:
    """Learn a policy from attempts at random between the first and last speed and angle, without a sweep."""
    from dataclasses import replace

    from onboard.policy.files import policy_crc32, save_policy
    from perchhw.learning.environment import versions
    from perchhw.learning.landing_surface import check_attempts, surface_pairs
    from perchhw.learning.random_attempts import fly_at_random
    from perchhw.learning.setup import trained_on
    from perchhw.learning.sweep_folder import POLICY_FILE, TRAINING_FILE, new_folder, write_document
    from perchhw.learning.train import train_policy
    from perchhw.trained_for import TRAINED_FOR

    learning = setup.learning_setup()
    speeds, angles = grid.ranges()
    check_attempts(attempts)
    new_folder(out)
    bounds = (min(speeds), max(speeds)), (min(angles), max(angles))
    with grid.executor() as executor, share_done("attempts at random") as show:
        outs = fly_at_random(learning, *bounds, attempts, executor=executor, on_batch=show)
    found = surface_pairs(outs, seed=setup.seed)
    policy = train_policy(found.pairs, name=name, seed=setup.seed).policy
    settings = learning.describe()
    ranges = dict(zip(("speeds", "angles_deg"), bounds, strict=True))
    flown = {
        "settings": {**settings, **ranges},
        "versions": versions(),
        "attempts": attempts,
        "log_loss": found.log_loss,
        "base_log_loss": found.base_log_loss,
    }
    provenance: dict[str, Any] = {**policy.provenance, "surface": flown}
    if (trained := trained_on(settings)) is not None:
        provenance[TRAINED_FOR] = trained.document()
    policy = replace(policy, provenance=provenance)
    save_policy(policy, out / POLICY_FILE)
    result = {
        "policy": str(out / POLICY_FILE),
        "crc32": policy_crc32(policy),
        "attempts": attempts,
        "triggered": len(outs),
        "pairs": len(found.pairs.a_rot),
        "support_vectors": len(policy.dual_coefficients),
        "inside_share": policy.provenance["inside_share"],
        "action_rms_nm": policy.provenance["train_rms_nm"],
        "action_held_out_rms_nm": policy.provenance["held_out_rms_nm"],
        "log_loss": found.log_loss,
        "base_log_loss": found.base_log_loss,
        "clean_rate_by_own_surface": found.clean_rate,
        "contact_rate_by_own_surface": found.contact_rate,
    }
    write_document(out / TRAINING_FILE, result)
    emit(
        result,
        f"{result['support_vectors']} support vectors; by its own surface, too kind, {found.clean_rate:.2f} "
        f"four legs without contact and {found.contact_rate:.2f} with it; learn validate flies it\n"
        f"policy {result['policy']}, crc32 0x{result['crc32']:08x}",
    )
