"""The core on an emulated Cortex-M4F: the host's results, its instructions, its memory.

Needs ``qemu-system-arm``, ``gcc-arm-none-eabi`` and ``libnewlib-arm-none-eabi`` (Debian); skips without.
"""

import json
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from onboard.firmware.compiler import FLAGS, SOURCES
from onboard.firmware.constants import onboard_constants
from onboard.firmware.library import CoreLibrary
from onboard.gravity import GRAVITY
from onboard.policy.action import action_moments
from onboard.policy.bundle import MAX_BUNDLE_BYTES, encode_bundle
from onboard.policy.trigger import trigger_values
from onboard.rotation import integrate
from tests.firmware.float32 import rounded
from tests.firmware.histories import VEHICLE
from tests.firmware.test_flight_model import BOUND, in_c
from tests.firmware.test_law_parity import random_states, rows, wrenches_in_c, wrenches_in_python
from tests.firmware.test_policy_parity import SHIPPED, cues_near

HERE = Path(__file__).with_name("cortex_m4")
COMPILER, EMULATOR = "arm-none-eabi-gcc", "qemu-system-arm"
MACHINE = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
ARM_FLAGS = (*(flag for flag in FLAGS if flag != "-O2"), "-Os", "-ffunction-sections", "-fdata-sections")
"""As Bitcraze's firmware: optimised for size."""

STATES = 2000
COUNTS = (
    *("parse", "trigger", "action", "control", "mix", "step", "step_with_policy"),
    *("in_approach", "model", "step_of_a_rehearsal_on_the_model", "begin_record"),
)
CLOCK_HZ = 168e6
CYCLES_AN_INSTRUCTION = 1.5
"""Taken for the mean: most of this code takes 1, a load 2, a branch that is taken 3, a division 14."""

STEP_STACK = 1100
"""Bytes: the firmware's control task has 1800, of which its own frames, an interrupted context with its
floats, the app's hook and a sine take 570."""

OUTPUTS = np.dtype(
    [
        ("status", "<u4"),
        ("core_bytes", "<u4"),
        ("counts", "<u4", len(COUNTS)),
        ("values", "<f4", STATES),
        ("moments", "<f4", STATES),
        ("wrenches", "<f4", (STATES, 4)),
        ("thrusts", "<f4", (STATES, 4)),
        ("turned", "<f4", (STATES, 4)),
        ("flown", "<f4", (STATES, 21)),
    ]
)

pytestmark = pytest.mark.skipif(
    shutil.which(COMPILER) is None or shutil.which(EMULATOR) is None,
    reason=f"needs {COMPILER} with newlib, and {EMULATOR}",
)


@dataclass(frozen=True)
class Run:
    """What came out of the emulated processor, and where its object files are."""

    outputs: np.void
    objects: Path


def flags() -> list[str]:
    return [*ARM_FLAGS, *MACHINE, "-fcallgraph-info=su", f"-I{SOURCES / 'core'}", f"-I{HERE}"]


@pytest.fixture(scope="module")
def emulated(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("m4")
    for source in [*(SOURCES / "core").glob("*.c"), *HERE.glob("*.c")]:
        made = folder / f"{source.stem}.o"
        subprocess.run([COMPILER, *flags(), "-c", str(source), "-o", str(made)], cwd=folder, check=True)
    objects = sorted(str(path) for path in folder.glob("*.o"))
    link = [COMPILER, *MACHINE, "-nostartfiles", "-Wl,--gc-sections", "-T", str(HERE / "linker.ld")]
    subprocess.run([*link, *objects, "-lm", "-lc", "-lgcc", "-o", "core.elf"], cwd=folder, check=True)
    write_inputs(folder / "inputs.bin")
    emulate = [EMULATOR, "-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none"]
    emulate += ["-icount", "shift=0", "-semihosting-config", "enable=on,target=native", "-kernel", "core.elf"]
    subprocess.run(emulate, cwd=folder, check=True, timeout=240)
    outputs = np.fromfile(folder / "outputs.bin", dtype=OUTPUTS)[0]
    return Run(outputs, folder)


def write_inputs(path: Path) -> None:
    bundle = encode_bundle(SHIPPED)
    constants = np.array([constant.value for constant in onboard_constants(VEHICLE)], "<f4")
    parts = [constants.tobytes(), np.uint32(len(bundle)).tobytes(), bundle.ljust(MAX_BUNDLE_BYTES, b"\0")]
    parts += [part.tobytes() for part in (cues_near(SHIPPED, STATES, seed=1), *random_states(1, STATES))]
    path.write_bytes(b"".join(parts))


def test_the_policy_is_that_of_the_reference(emulated: Run) -> None:
    states, compiled = cues_near(SHIPPED, STATES, seed=1), SHIPPED.compiled()
    values = trigger_values(compiled, states)
    assert emulated.outputs["status"] == 1
    assert np.abs(emulated.outputs["values"] - values).max() <= 1e-6
    assert np.abs(emulated.outputs["moments"] - action_moments(compiled, states)).max() <= 1e-8
    decided = np.abs(values) >= 1e-6
    assert np.array_equal((emulated.outputs["values"] >= 0.0)[decided], (values >= 0.0)[decided])


def test_law_and_attitude_are_those_of_the_reference(emulated: Run) -> None:
    states, arm = random_states(1, STATES), VEHICLE.body.arm_x.value
    wanted, found = wrenches_in_python(VEHICLE, states), emulated.outputs["wrenches"]
    assert np.abs(found[:, 0] - wanted[:, 0]).max() <= 1e-6
    assert np.abs(found[:, 1:] - wanted[:, 1:]).max() <= 1e-6 * arm
    turned = [integrate(tuple(e[6:10]), tuple(e[10:]), rounded(0.002)) for e in rows(states[0])]
    assert np.abs(emulated.outputs["turned"] - np.array(turned)).max() <= 1e-6


def test_the_model_is_that_of_the_host(emulated: Run, core: CoreLibrary) -> None:
    """But for sine, cosine and exponential of newlib, one step of their last place."""
    models = np.zeros((STATES, 21), np.float32)
    models[:, :13] = random_states(1, STATES)[0]
    models[:, 13:17] = 0.25 * np.float32(VEHICLE.body.mass.value) * np.float32(GRAVITY)
    models[:, 17:] = emulated.outputs["thrusts"]
    flown = in_c(core, VEHICLE, models, 0.001)
    share = np.abs(emulated.outputs["flown"][:, :17] - flown) / np.maximum(1.0, np.abs(flown))
    assert share.max() <= BOUND


def test_law_and_mixer_are_bit_for_bit_those_of_the_host(emulated: Run, core: CoreLibrary) -> None:
    """Without sines they have nothing but additions, products, divisions and roots, which IEEE fixes."""
    states = random_states(1, STATES)
    straight = states[3][:, 0] == 0.0
    wrenches = wrenches_in_c(core, VEHICLE, states)
    assert np.array_equal(emulated.outputs["wrenches"][straight], wrenches[straight])
    assert straight.sum() > STATES // 3


def test_no_double_precision_and_no_fused_multiply_add(emulated: Run) -> None:
    ours = sorted(str(emulated.objects / f"{path.stem}.o") for path in (SOURCES / "core").glob("*.c"))
    tools = COMPILER.removesuffix("gcc")
    symbols = subprocess.run([f"{tools}nm", *ours], capture_output=True, text=True, check=True).stdout
    code = subprocess.run([f"{tools}objdump", "-d", *ours], capture_output=True, text=True, check=True).stdout
    assert "__aeabi_d" not in symbols
    assert "__aeabi_f2d" not in symbols
    assert not re.search(r"\bvfn?m[as]\.", code)
    assert "vmul.f32" in code


class Frames:
    """What the core's functions take of the stack, and whom they call, as the compiler tells it."""

    def __init__(self, objects: Path) -> None:
        self.bytes: dict[str, int] = {}
        self._called: dict[str, set[str]] = {}
        for path in (SOURCES / "core").glob("*.c"):
            told = (objects / f"{path.stem}.ci").read_text()
            nodes = re.findall(r'title: "([^"]+)" label: "[^"]*?(\d+) bytes \((\w+)', told)
            assert all(kind == "static" for _, _, kind in nodes), (
                "a frame whose size is known only as it runs"
            )
            self.bytes |= {name: int(size) for name, size, _ in nodes}
            for caller, called in re.findall(r'sourcename: "([^"]+)" targetname: "([^"]+)"', told):
                self._called.setdefault(caller, set()).add(called)

    def deepest(self, name: str, above: tuple[str, ...] = ()) -> int:
        """Bytes of the deepest chain of calls from `name` on, without those of the C library."""
        assert name not in above, f"{name} calls itself"
        called = self._called.get(name, set())
        return self.bytes.get(name, 0) + max((self.deepest(one, (*above, name)) for one in called), default=0)


def test_time_and_memory_are_within_their_budgets(emulated: Run, capsys: pytest.CaptureFixture[str]) -> None:
    """24 KB of RAM and of flash; the policy 0.2 ms, the rest of a step 60 us, of a processor at 168 MHz."""
    counts = dict(zip(COUNTS, emulated.outputs["counts"].tolist(), strict=True))
    assert counts.pop("in_approach") == 1, "an approach was counted, both times"
    us = {name: n * CYCLES_AN_INSTRUCTION / CLOCK_HZ * 1e6 for name, n in counts.items()}
    vectors = len(SHIPPED.dual_coefficients)
    of_130 = us["trigger"] * 130 / vectors + us["action"]
    frames = Frames(emulated.objects)
    stack, deepest = max(frames.bytes.values()), frames.deepest("perch_step")
    objects = [f"{path.stem}.o" for path in (SOURCES / "core").glob("*.c")]
    size = [f"{COMPILER.removesuffix('gcc')}size", *objects]
    said = subprocess.run(size, cwd=emulated.objects, capture_output=True, text=True, check=True).stdout
    flash = sum(int(line.split()[0]) + int(line.split()[1]) for line in said.splitlines()[1:])
    ram = int(emulated.outputs["core_bytes"])
    document = {
        "instructions": counts,
        "us_at_168_mhz": {name: round(time, 1) for name, time in us.items()},
        "policy_of_130_vectors_us": round(of_130, 1),
        "ram_bytes": ram,
        "flash_bytes": flash,
        "largest_stack_frame_bytes": stack,
        "stack_of_a_step_bytes": deepest,
    }
    with capsys.disabled():
        sys.stdout.write(json.dumps(document) + "\n")
    assert of_130 < 200.0
    assert us["step"] + us["begin_record"] < 60.0, "the step that arms an approach, too"
    assert us["step_of_a_rehearsal_on_the_model"] < 60.0
    assert ram <= 24 * 1024
    assert flash <= 24 * 1024
    assert stack <= 512
    assert stack < deepest <= STEP_STACK
