"""The phases before the motors lift the drone: checking, uploading, ready, arming."""

from dataclasses import replace

from perchhw.supervisor.aborts import abort, elapsed, enter, guard, held, order
from perchhw.supervisor.events import Arm, TakeOff, UploadPolicy
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.rules import GROUND_RULES, PREFLIGHT_RULES, policy_known
from perchhw.supervisor.state import Context, FlightState, Phase, Step
from perchhw.supervisor.violation import Violation, all_violations


def checking(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until all preflight rules hold; the attempt that ends here names every one that does not."""
    violations = all_violations(PREFLIGHT_RULES, o, context.limits)
    if violations and elapsed(state, context) > context.timing.checks_deadline:
        return abort(state, "; ".join(map(str, violations)), context)
    state = replace(state, waiting_for=_in_short(violations))
    state, passed = held(state, not violations, context.timing.checks_hold, context)
    if not passed:
        return Step(state)
    if context.mission.test_flight:
        return _ready(state, context)
    return order(enter(state, Phase.UPLOADING, context, "the policy upload"), UploadPolicy())


def _in_short(violations: tuple[Violation, ...]) -> str:
    """What the checks wait for, on one line."""
    if not violations:
        return "the preflight checks"
    more = f" (and {len(violations) - 1} more)" if len(violations) > 1 else ""
    return f"{violations[0]}{more}"


def _ready(state: FlightState, context: Context) -> Step:
    """All checks passed: arm when the time has come, unless this is a rehearsal."""
    if context.mission.dry_run:
        return Step(enter(state, Phase.DONE, context))
    if context.now < context.mission.arm_at:
        return Step(enter(state, Phase.READY, context, "the time to arm"))
    return order(enter(state, Phase.ARMING, context, "the drone to arm"), Arm())


def uploading(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the upload is answered."""
    if elapsed(state, context) > context.timing.upload_deadline:
        return abort(state, f"policy upload took longer than {context.timing.upload_deadline:g} s", context)
    return guard(state, GROUND_RULES, o, context) or Step(state)


def after_upload(state: FlightState, crc: int | None, context: Context) -> Step:
    """Arm when the drone's live policy has the CRC (`crc`, unknown: ``None``) of the one to be flown."""
    if state.phase is not Phase.UPLOADING:
        return Step(state)
    return _other_policy(state, crc, context) or _ready(state, context)


def ready(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the time to arm has come; a simulated lab has one that hangs on no machine's speed."""
    stop = guard(state, GROUND_RULES, o, context)
    if stop is not None:
        return stop
    if elapsed(state, context) > context.timing.ready_deadline:
        return abort(state, f"the time to arm is {context.mission.arm_at:.1f} s, too far away", context)
    return Step(state) if context.now < context.mission.arm_at else _ready(state, context)


def _other_policy(state: FlightState, crc: int | None, context: Context) -> Step | None:
    if crc == context.mission.policy_crc:
        return None
    live = "unknown" if crc is None else f"{crc:08x}"
    return abort(state, f"policy_crc: the drone has {live}, need {context.mission.policy_crc:08x}", context)


def policy_guard(state: FlightState, o: Admitted, context: Context) -> Step | None:
    """The live policy is the one that was uploaded, or the attempt ends. A test flight needs none."""
    if context.mission.test_flight:
        return None
    return guard(state, (policy_known,), o, context) or _other_policy(state, o.active_policy_crc, context)


def arming(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the drone may fly."""
    stop = guard(state, GROUND_RULES, o, context)
    if stop is not None:
        return stop
    armed = o.drone is not None and o.drone.is_armed and o.drone.can_fly
    state, ready = held(state, armed, context.timing.arm_hold, context)
    if ready:
        # Only now: telemetry from before the upload may still be in flight earlier in this phase.
        stop = policy_guard(state, o, context)
        if stop is not None:
            return stop
        flying = replace(
            enter(state, Phase.TAKING_OFF, context, "the first hover"), armed=True, airborne_since=context.now
        )
        return order(flying, TakeOff(context.mission.hover_height, context.timing.take_off))
    if elapsed(state, context) > context.timing.arm_deadline:
        return abort(
            state, f"the drone did not arm within {context.timing.arm_deadline:g} s ({o.drone})", context
        )
    return Step(state)
