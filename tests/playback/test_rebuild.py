from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Message
from rewritten_logs import rewrite

import duoglide as dg
from duoglide.control.channel.setpoints import Fence
from duoglide.control.host.run.fitness import require_fit
from duoglide.control.host.run.prepare import prepare
from duoglide.motion.path.actions import WaitInput
from duoglide.playback.pace import slowed
from duoglide.playback.rebuild import rebuild
from duoglide.playback.recheck import recheck
from duoglide.playback.replay import prepare as rerun
from duoglide.playback.run_data import read_run
from duoglide.storage import CycleRecord, LogKind, LogWarning, LogWriter, Phase, Topic, read_log

Pace = Sequence[tuple[float, float, Phase]]
WriteRun = Callable[..., Path]


def test_a_run_at_full_speed_gives_its_plan_back(run_log: Path, trajectory: dg.Trajectory) -> None:
    recorded = rebuild(read_log(run_log))
    assert recorded.motion is recorded.plan
    assert recorded.motion.profile == trajectory.profile


@pytest.mark.parametrize(
    "overrides", [{20: 0.9}, {10: 0.9, 60: 1.0}, {0: 0.3, 40: 0.35, 90: 0.25}, {30: 0.0}]
)
def test_a_changed_pace_comes_back_setpoint_for_setpoint(
    overrides: dict[int, float],
    paced: Callable[[dict[int, float]], Pace],
    write_run: WriteRun,
    trajectory: dg.Trajectory,
) -> None:
    recorded = rebuild(read_log(write_run(paced(overrides))))
    assert recorded.motion is not recorded.plan
    prepared = prepare(recorded.motion, Fence.of(trajectory.machine), 1, Phase.PROGRAM)
    [stretch] = prepared.stretches
    data = recorded.data
    sent = data.setpoint[data.on_plan]
    again = np.array(stretch.grid[1 : len(sent) + 1])
    assert np.array_equal(again, sent)


def test_a_changed_pace_keeps_the_stop_limits(
    paced: Callable[[dict[int, float]], Pace], write_run: WriteRun, trajectory: dg.Trajectory
) -> None:
    recorded = rebuild(read_log(write_run(paced({25: 0.9, 70: 1.0}))))
    bound, _ = recorded.motion.certified_for(trajectory.machine)
    assert bound.duration > trajectory.duration
    require_fit(bound, trajectory.machine)
    limits = trajectory.machine.limits
    strict = replace(trajectory.machine, stop_limits=limits)  # the change used its reserve
    with pytest.raises(dg.LimitError, match=r"of stop_limits\.jerk of .*--override 100"):
        recorded.motion.certified_for(strict)


def test_what_was_replayed_with_a_changed_pace_can_be_replayed_again(
    paced: Callable[[dict[int, float]], Pace], write_run: WriteRun
) -> None:
    once = rerun(write_run(paced({25: 0.9, 70: 1.0}))).trajectory
    cycle, end = once.machine.drives.cycle, once.duration
    moving = [(k * cycle, 1.0, Phase.PROGRAM) for k in range(1, int(end / cycle) + 1)]
    pace = [(0.0, 0.0, Phase.HOLD), *moving, (end, 0.0, Phase.HOLD)]
    log = write_run(pace, "again.mcap", once)
    assert rerun(log).trajectory.profile == once.profile
    assert rerun(log, override=0.5).trajectory.duration == pytest.approx(2.0 * end)


def test_a_log_whose_setpoints_are_not_its_plans_is_refused(
    run_log: Path, tmp_path: Path, trajectory: dg.Trajectory
) -> None:
    log = read_log(run_log)
    tampered = tmp_path / "tampered.mcap"
    with LogWriter(tampered, LogKind.RUN) as writer:
        for name, document in log.documents.items():
            writer.attach(name, document)
        for t, record in log.records(Topic.CYCLE):
            fields = {name: getattr(record, name) for name in CycleRecord.__slots__}
            if record.cycle == 1030:
                fields["setpoint"] = (record.setpoint[0] + 1, *record.setpoint[1:])
            writer.write(Topic.CYCLE, t, CycleRecord(**fields))
    with pytest.raises(dg.LogError, match="setpoint of cycle 1030 is not that of the plan"):
        rebuild(read_log(tampered))


def test_cycles_that_are_not_in_order_are_no_run(
    write_run: WriteRun, at_full_speed: Pace, tmp_path: Path
) -> None:
    def twice(message: Message, topic: str) -> Message:
        return replace(message, data=message.data.replace(b'"cycle":1030,', b'"cycle":1029,'))

    file = rewrite(write_run(at_full_speed), tmp_path / "merged.mcap", {}, change=twice)
    with pytest.raises(dg.LogError, match="cycle 1029 follows cycle 1029; it is not one run"):
        read_run(read_log(file))


def test_a_run_that_has_lost_cycles_of_its_program_is_not_replayed(
    run_log: Path, tmp_path: Path
) -> None:
    def lost(message: Message, topic: str) -> bool:
        return not 30 <= message.sequence < 40

    def first_event(message: Message, topic: str) -> bool:
        return message.sequence > 1

    file = rewrite(run_log, tmp_path / "filtered.mcap", {}, keep=lost)
    with pytest.warns(LogWarning, match="10 of .* messages have been filtered out or lost"):
        log = read_log(file)
    with pytest.raises(dg.LogError, match="cycles 1028 to 1037 of the plan among them"):
        rebuild(log)
    rewrite(run_log, file, {}, keep=first_event)
    with pytest.warns(LogWarning, match="1 of .* messages"):
        recorded = rebuild(read_log(file))
        assert recorded.motion is recorded.plan


def test_a_plan_and_a_run_that_never_began_are_refused(
    trajectory: dg.Trajectory, write_run: WriteRun, tmp_path: Path
) -> None:
    trajectory.save(tmp_path / "plan.mcap")
    with pytest.raises(dg.LogError, match=r"is a plan, not a run: `duoglide stream`"):
        rebuild(read_log(tmp_path / "plan.mcap"))
    with pytest.raises(dg.LogError, match="no cycle on its plan"):
        rebuild(read_log(write_run([(0.0, 0.0, Phase.HOLD)] * 5)))


def test_a_log_without_its_plan_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "bare.mcap"
    with LogWriter(file, LogKind.RUN) as writer:
        writer.attach("machine", dg.Machine.default().to_dict())
    with pytest.raises(dg.LogError, match="no trajectory document"):
        rebuild(read_log(file))
    with LogWriter(file, LogKind.RUN) as writer:
        writer.attach("trajectory", {"checked": "nonsense"})
    with pytest.raises(dg.LogError, match="bare"):
        rebuild(read_log(file))


def test_the_motion_is_refused_by_name_where_another_machine_cannot_follow_it(
    trajectory: dg.Trajectory,
) -> None:
    machine = trajectory.machine
    slow = replace(machine, limits=dg.CarriageLimits(velocity=300.0))
    with pytest.raises(dg.LimitError, match=r"of the velocity limit of carriage \d .* --override"):
        recheck(slow, trajectory)
    narrow = replace(machine, clearance=60.0)
    with pytest.raises(dg.PathError, match="clearance"):
        recheck(narrow, trajectory)
    short = replace(machine, geometry=dg.Geometry(strut_length=240.0))
    with pytest.raises(dg.PathError):
        recheck(short, trajectory)


def test_the_override_that_an_error_names_would_do(trajectory: dg.Trajectory) -> None:
    slow = replace(trajectory.machine, limits=dg.CarriageLimits(velocity=350.0, jerk=3e5))
    with pytest.raises(dg.LimitError) as refused:
        recheck(slow, trajectory)
    percent = float(str(refused.value).split("--override ")[1].split()[0])
    share = percent / 100.0
    bound = recheck(slow, slowed(trajectory, share), share)
    assert bound.machine is slow
    assert np.allclose(bound.at(0.1 / share).carriages, trajectory.at(0.1).carriages, atol=1e-9)
    require_fit(bound, slow)


def test_a_held_run_with_waits_is_not_replayed_as_it_was(
    paced: Callable[[dict[int, float]], Pace], write_run: WriteRun, trajectory: dg.Trajectory
) -> None:
    from duoglide.playback import rebuild as module

    recorded = rebuild(read_log(write_run(paced({20: 0.9}))))
    waits = replace(trajectory, actions=((0.1, WaitInput(axis=1, bit=0, value=True, timeout=1.0)),))
    rows = np.arange(1, len(recorded.data) - 4)
    with pytest.raises(dg.LogError, match="waits for inputs"):
        module._repaced(waits, recorded.data, rows, module.path_times(recorded.data, rows))
