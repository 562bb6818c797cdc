"""MuJoCo with four hinged legs at 1 kHz: in flight, pressed against a ceiling, and hanging from it.

Takes turns with our own measurement (see turns.py). The vehicle has the weight and the leg stiffness of the
paper's: a box, four capsules of 75 mm on hinges, 38.1 g in all. The ceiling is 1 m thick and stiff, because a
thin soft one lets a fast drone pass through. Pressed, capsules on one hinge each rub on the ceiling under 1.5
weights. Hanging, each foot is a ball joint (`connect`), each hip has two hinges, and the body swings, as ours
does in the benchmark. Steps run inside MuJoCo, without Python in between.

    python mujoco_legs.py SECONDS
"""

import sys
import time
from collections.abc import Callable

import mujoco
from turns import take_turns

MASS = 0.0381  # kg, whole vehicle
LEG_MASS = 0.9e-3
HIP, LEG = 0.017, (0.0265, 0.0265, 0.065)  # m: hip in x and y; from hip to foot, 75 mm at 30 deg
CEILING = 2.1  # m
SPRING = 'type="hinge" stiffness="0.08" damping="6.788e-5"'
STEPS = 500  # in a call

MODEL = """
<mujoco>
  <option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
  <default><geom contype="1" conaffinity="2" solref="0.004 1"/></default>
  <worldbody>
    <geom type="box" size="5 5 0.5" pos="0 0 {ceiling}" contype="2" conaffinity="1"/>
    <body name="hull" pos="0 0 {z}">
      <freejoint/>
      <geom type="box" size="0.0375 0.0375 0.011" mass="{hull}"/>
      {legs}
    </body>
  </worldbody>
  <equality>{holds}</equality>
</mujoco>"""


def vehicle(gap: float, hold: bool) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The vehicle upside down with its feet `gap` (m) below the ceiling, held by them or not."""
    legs, holds = "", ""
    for k, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        foot = f"{sx * LEG[0]} {sy * LEG[1]} {LEG[2]}"
        legs += (
            f'<body name="leg{k}" pos="{sx * HIP} {sy * HIP} 0.005">'
            f'<joint axis="{-sy} {sx} 0" {SPRING}/>'
            + (f'<joint axis="{sx} {sy} 0" {SPRING}/>' if hold else "")
            + f'<geom type="capsule" size="0.002" fromto="0 0 0 {foot}" mass="{LEG_MASS}"/></body>'
        )
        holds += f'<connect body1="leg{k}" anchor="{foot}" solref="0.004 1"/>' if hold else ""
    z = CEILING - gap - LEG[2] - 0.005 - 0.002
    model = mujoco.MjModel.from_xml_string(
        MODEL.format(ceiling=CEILING + 0.5, z=z, hull=MASS - 4 * LEG_MASS, legs=legs, holds=holds)
    )
    return model, mujoco.MjData(model)


def running(gap: float, hold: bool, force: float) -> Callable[[float], int]:
    """A case that runs for about so many seconds and returns its steps; `force` (N) pushes the hull up."""
    model, data = vehicle(gap, hold)
    start = mujoco.MjData(model)

    def run(seconds: float) -> int:
        calls, started = 0, time.perf_counter()
        while calls == 0 or time.perf_counter() - started < seconds:
            mujoco.mj_copyData(data, model, start)
            data.xfrc_applied[1, 2] = force
            data.qvel[:6] = [0.1, 0.0, 0.0, 0.0, 3.0, 0.5]
            mujoco.mj_step(model, data, nstep=STEPS)
            calls += 1
        return calls * STEPS

    return run


def main() -> None:
    """Build the cases and take turns."""
    seconds = float(sys.argv[1])
    runs = {
        "free_flight": running(gap=1e3, hold=False, force=0.0),
        "pressed": running(gap=1e-3, hold=False, force=1.5 * MASS * 9.81),
        "hanging": running(gap=0.0, hold=True, force=0.0),
    }
    take_turns({name: lambda run=run: run(seconds) for name, run in runs.items()}, ("mujoco",))


if __name__ == "__main__":
    main()
