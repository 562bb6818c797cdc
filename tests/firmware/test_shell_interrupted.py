"""Two tasks of one priority, the memory's and the parameters': each may interrupt the other anywhere."""

import zlib

import pytest

from onboard.app_interface import Parameter, PolicyStatus, Rehearsal
from onboard.firmware.compiler import find_compiler
from onboard.vehicle import load_vehicle
from tests.firmware.shell import INTERRUPTIBLE, Shell, build_shell
from tests.firmware.test_shell import VEHICLE, bundle, commit

BUNDLE = bundle()
LAST = len(BUNDLE) - 4
"""Where the last number of the bundle is: another one in its place is within its range, too."""
ANOTHER = b"\0\0\0\0"


@pytest.fixture(scope="module")
def shell(tmp_path_factory: pytest.TempPathFactory) -> Shell:
    if find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot be tested")
    folder = tmp_path_factory.mktemp("interruptible")
    return Shell(build_shell(folder, load_vehicle(VEHICLE), *INTERRUPTIBLE))


def stage(shell: Shell) -> None:
    """All but the commit, and nothing is interrupted."""
    shell.interrupt_parameters(0)
    shell.upload(BUNDLE)
    shell.set(Parameter.POLICY_LENGTH, len(BUNDLE))
    shell.set(Parameter.POLICY_CRC, zlib.crc32(BUNDLE))


def begin_packet(shell: Shell, place: int) -> bool:
    """Whether the packet was interrupted: it has no more places than that."""
    shell.begin_memory_write(LAST, ANOTHER, place)
    return shell.memory_waits


def begin_commit(shell: Shell, place: int) -> bool:
    """Whether the commit was interrupted, likewise."""
    shell.interrupt_parameters(place)
    assert shell.write(Parameter.POLICY_COMMIT, 1)
    return shell.callback_waits


def end_commit(shell: Shell) -> None:
    while shell.callback_waits:
        shell.go_on_with_parameters()


def places_of_a_commit(shell: Shell) -> int:
    """Where it can be interrupted."""
    places = 0
    stage(shell)
    while begin_commit(shell, places + 1):
        end_commit(shell)
        places += 1
    return places


def places_of_a_packet(shell: Shell) -> int:
    """Where it can be interrupted."""
    places = 0
    while begin_packet(shell, places + 1):
        shell.end_memory_write()
        places += 1
    return places


def is_what_it_says(shell: Shell) -> bool:
    """Whether the live policy is the one that the drone names, and the last commit was answered."""
    live = zlib.crc32(shell.live_policy(len(BUNDLE)))
    answered = shell.read(Parameter.POLICY_STATUS) in (PolicyStatus.ACTIVE, PolicyStatus.REFUSED_CRC)
    return answered and live == shell.read(Parameter.POLICY_ACTIVE_CRC) == zlib.crc32(BUNDLE)


def test_a_packet_that_comes_during_a_commit_does_not_reach_the_policy(shell: Shell) -> None:
    assert BUNDLE[LAST:] != ANOTHER
    assert commit(shell, BUNDLE) == PolicyStatus.ACTIVE
    places = places_of_a_commit(shell)
    assert places > 20
    for place in range(1, places + 1):
        stage(shell)
        assert begin_commit(shell, place)
        shell.write_memory(LAST, ANOTHER)
        end_commit(shell)
        assert is_what_it_says(shell), f"interrupted at place {place}"
    assert commit(shell, BUNDLE) == PolicyStatus.ACTIVE


def test_a_packet_in_the_middle_of_which_a_commit_begins_does_not_reach_it_either(shell: Shell) -> None:
    """The packet is interrupted, then the commit, then each goes on to its end."""
    assert commit(shell, BUNDLE) == PolicyStatus.ACTIVE
    packet_places, commit_places = places_of_a_packet(shell), places_of_a_commit(shell)
    assert packet_places >= 6
    for packet_place in range(1, packet_places + 1):
        for commit_place in range(1, commit_places + 1):
            stage(shell)
            assert begin_packet(shell, packet_place)
            begin_commit(shell, commit_place)
            shell.end_memory_write()
            end_commit(shell)
            assert is_what_it_says(shell), f"interrupted at places {packet_place} and {commit_place}"
    assert commit(shell, BUNDLE) == PolicyStatus.ACTIVE


def test_a_word_for_the_bench_motors_is_never_taken_for_silence(shell: Shell) -> None:
    """A word comes, a ms later, wherever the app's task is while it looks for one."""
    stage(shell)
    for place in range(1, 61):
        shell.world.motor_override = 1
        shell.interrupt_app(place)
        for _ in range(20):
            shell.set(Parameter.MOTOR_TOKEN, 1)
            shell.step()
            shell.world.tick_ms += 1
        assert shell.world.motor_override == 1, f"interrupted at place {place}"


def is_on_the_desk(shell: Shell) -> bool:
    """Whether the control loop disarms at once whoever arms."""
    shell.world.armed = True
    shell.step()
    disarmed = not shell.world.armed
    shell.world.armed = False
    return disarmed


def test_a_rehearsal_that_begins_as_another_ends_is_on_for_all_or_for_none(shell: Shell) -> None:
    """The control loop notes the end wherever the next beginning is; parameter, core and shell agree."""
    shell.interrupt_parameters(0)
    shell.world.motor_override = 0
    shell.step(40)
    place, interrupted = 0, True
    while interrupted:
        place += 1
        shell.set(Parameter.REHEARSE, Rehearsal.POSES)
        shell.step()
        assert shell.outputs.rehearses
        assert shell.write(Parameter.REHEARSE, Rehearsal.OFF)
        shell.interrupt_parameters(place)
        assert shell.write(Parameter.REHEARSE, Rehearsal.POSES)
        interrupted = shell.callback_waits
        shell.step(2)
        said = shell.read(Parameter.REHEARSE) == Rehearsal.POSES
        assert said == shell.outputs.rehearses == is_on_the_desk(shell), f"interrupted at place {place}"
        shell.interrupt_parameters(0)
        shell.set(Parameter.REHEARSE, Rehearsal.OFF)
        shell.step()
    assert place > 20
