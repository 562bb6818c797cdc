"""``perchhw policy``: show, import, export, evaluate, upload and verify landing policies."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.cli.options import DroneUri
from perchhw.cli.output import emit
from perchhw.consoles import console

if TYPE_CHECKING:
    from onboard.link import DroneLink
    from onboard.policy.files import Policy

app = typer.Typer(
    add_completion=False, no_args_is_help=True, help="Landing policies: files, bundles, drones."
)

PolicyArgument = Annotated[str, typer.Argument(help="A *.policy.json file, a bundle, or a shipped policy.")]


def _load(name_or_path: str) -> "Policy":
    from onboard.policy.files import find_policy, load_policy

    return load_policy(find_policy(name_or_path))


@app.command()
def show(policy: PolicyArgument) -> None:
    """Say what a policy is, covers and came from."""
    from onboard.policy.bundle import bundle_crc32, encode_bundle

    loaded = _load(policy)
    bundle = encode_bundle(loaded)
    result = {
        "name": loaded.name,
        "crc32": bundle_crc32(bundle),
        "bundle_bytes": len(bundle),
        "support_vectors": len(loaded.dual_coefficients),
        "gamma": float(loaded.gamma),
        "intercept": float(loaded.intercept),
        "layer_sizes": list(loaded.layer_sizes),
        "scaler": {"mean": loaded.scaler_mean.tolist(), "std": loaded.scaler_std.tolist()},
        "tau_min": float(loaded.tau_min),
        "tau_max": float(loaded.tau_max),
        "a_rot_min": float(loaded.a_rot_min),
        "a_rot_max": float(loaded.a_rot_max),
        "provenance": dict(loaded.provenance),
    }
    emit(result, _show_table(result))


def _show_table(result: dict[str, Any]) -> Callable[[], None]:
    def draw() -> None:
        from rich.table import Table

        mean, std = result["scaler"]["mean"], result["scaler"]["std"]
        table = Table(title=f"policy {result['name']}", show_header=False, title_justify="left")
        table.add_row("crc32 (bundle)", f"0x{result['crc32']:08x}, {result['bundle_bytes']} bytes")
        table.add_row(
            "trigger",
            f"{result['support_vectors']} support vectors, gamma {result['gamma']:g}, "
            f"intercept {result['intercept']:g}",
        )
        table.add_row("fires for tau within", f"{result['tau_min']:.4f} to {result['tau_max']:.4f} s")
        cues = (("tau", "s"), ("theta_x", "rad/s"), ("d_ceil", "m"))
        for (cue, unit), centre, spread in zip(cues, mean, std, strict=True):
            table.add_row(f"scaler {cue}", f"{centre:.4f} ± {spread:.4f} {unit}")
        table.add_row("action network", "-".join(map(str, result["layer_sizes"])))
        table.add_row(
            "a_rot within",
            f"{1e3 * result['a_rot_min']:.2f} to {1e3 * result['a_rot_max']:.2f} N mm about b_y",
        )
        for key, value in result["provenance"].items():
            table.add_row(key, str(value))
        console().print(table, markup=False)

    return draw


@app.command("import")
def import_(
    file: Annotated[Path, typer.Argument(help="Authors' format (flown_policy.json), or a bundle.")],
    out: Annotated[
        Path | None, typer.Option(help="The policy file to write; default: NAME.policy.json, here.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the policy; default: the file's name.")] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Without --out: replace a NAME.policy.json that is there.")
    ] = False,
) -> None:
    """Turn a policy of another form into a policy file."""
    from dataclasses import replace

    from onboard.policy.bundle import is_bundle
    from onboard.policy.files import SUFFIX, import_authors_policy, load_policy, policy_crc32, save_policy

    name = name or (file.stem if out is None else out.name.removesuffix(SUFFIX))
    out = _file_here(f"{name}{SUFFIX}", force) if out is None else out
    policy = replace(load_policy(file), name=name) if is_bundle(file) else import_authors_policy(file, name)
    save_policy(policy, out)
    crc = policy_crc32(policy)
    emit(
        {"policy": str(out), "name": policy.name, "crc32": crc},
        f"wrote {out}: policy {policy.name}, crc32 0x{crc:08x}",
    )


def _file_here(name: str, force: bool) -> Path:
    """The file `name` in the current folder, unless something would be lost by writing it."""
    from onboard.policy.files import PolicyFileError

    if Path(name).name != name:
        raise PolicyFileError(f"{name}: not the name of a file in this folder; say where with --out")
    if Path(name).exists() and not force:
        raise PolicyFileError(f"{name}: is there already; replace it with --force, or give --out or --name")
    return Path(name)


@app.command()
def export(
    policy: PolicyArgument,
    out: Annotated[
        Path, typer.Option(help="The bundle to write, as the drone gets it (docs/policy_bundle.md).")
    ],
) -> None:
    """Write the bundle of a policy."""
    from onboard.policy.bundle import bundle_crc32, encode_bundle
    from onboard.policy.files import PolicyFileError

    bundle = encode_bundle(_load(policy))
    try:
        out.write_bytes(bundle)
    except OSError as error:
        raise PolicyFileError(f"{out}: cannot be written ({error.strerror}); check the folder") from error
    crc = bundle_crc32(bundle)
    emit(
        {"bundle": str(out), "bytes": len(bundle), "crc32": crc},
        f"wrote {out}: {len(bundle)} bytes, crc32 0x{crc:08x}",
    )


@app.command("eval")
def evaluate(
    policy: PolicyArgument,
    states: Annotated[Path, typer.Option(help="CSV with the columns tau [s], theta_x [rad/s], d_ceil [m].")],
) -> None:
    """Evaluate a policy at given cues, by the arithmetic of the drone."""
    from onboard.policy.states import read_states

    loaded = _load(policy)
    cues = read_states(states)

    from onboard.policy.action import action_moments
    from onboard.policy.trigger import trigger_values

    compiled = loaded.compiled()
    values = trigger_values(compiled, cues)
    moments = action_moments(compiled, cues)
    rows = [
        {"trigger_value": float(value), "triggers": bool(value >= 0), "a_rot": float(moment)}
        for value, moment in zip(values, moments, strict=True)
    ]

    def draw() -> None:
        from rich.table import Table

        table = Table("tau [s]", "theta_x [rad/s]", "d_ceil [m]", "trigger value", "triggers", "a_rot [N mm]")
        for cue, row in zip(cues, rows, strict=True):
            words = (
                f"{row['trigger_value']:.4f}",
                "yes" if row["triggers"] else "no",
                f"{1e3 * row['a_rot']:.3f}",
            )
            table.add_row(*(f"{number:g}" for number in cue), *words)
        console().print(table)

    emit({"rows": rows}, draw)


@contextmanager
def _linked(drone: str) -> "Iterator[DroneLink]":
    """A link to a drone that is not flying."""
    from onboard.lab_time import open_timebase
    from onboard.link import DroneLink
    from onboard.link.exclusive import hold
    from onboard.link.power import refuse_flying

    with hold(drone), open_timebase("policy", drone) as time:
        refuse_flying(drone, time)
        with DroneLink.open(drone, clock=time) as link:
            yield link


@app.command()
def upload(policy: PolicyArgument, drone: DroneUri) -> None:
    """Give a policy to a drone; it reports the CRC that it reads back."""
    from onboard.policy.bundle import encode_bundle

    bundle = encode_bundle(_load(policy))
    with _linked(drone) as link:
        crc = link.upload_policy(bundle)
    emit(
        {"drone": drone, "crc32": crc, "bytes": len(bundle)},
        f"{drone} runs the policy with crc32 0x{crc:08x}",
    )


@app.command()
def verify(policy: PolicyArgument, drone: DroneUri) -> None:
    """Check that a drone runs a policy; exit code 1 if it runs another or none."""
    from onboard.policy.files import policy_crc32

    expected = policy_crc32(_load(policy))
    with _linked(drone) as link:
        actual = link.active_policy_crc()
    result = {"drone": drone, "matches": actual == expected, "crc32": actual, "expected_crc32": expected}
    if actual == expected:
        emit(result, f"{drone} runs this policy (crc32 0x{actual:08x})")
        return
    running = f"another policy (crc32 0x{actual:08x})" if actual else "no policy"
    emit(result, f"{drone} runs {running}, expected 0x{expected:08x}; upload it: perchhw policy upload")
    raise typer.Exit(1)
