"""Worker processes: they end with the process that started them, and are replaced when they are killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Lock, Timer

import pytest

from tissuq.errors import InputError
from tissuq.studies.batch_jobs import QUEUES, _options
from tissuq.studies.stream import RESULTS, open_pool, run_tasks
from worker_tasks import Number, doubled

TESTS = Path(__file__).parents[1]
PATIENCE_S = 60.0

pytestmark = pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs Linux")


def wait_until(is_so):
    deadline = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.slow
@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_workers_end_with_the_process_that_started_them(tmp_path, sign):
    main = subprocess.Popen(
        [sys.executable, TESTS / "worker_tasks.py", tmp_path],
        stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    workers: list[int] = []
    try:
        wait_until(lambda: all((file := tmp_path / f"process-{n}").exists() and file.read_text() for n in (0, 1)))
        workers = [int((tmp_path / f"process-{number}").read_text()) for number in (0, 1)]
        if sign == signal.SIGINT:  # a terminal sends it to all of them
            os.killpg(main.pid, sign)
        else:
            main.send_signal(sign)
        _, said = main.communicate(timeout=PATIENCE_S)
        wait_until(lambda: not any(map(is_running, workers)))
    finally:
        for pid in filter(is_running, [main.pid, *workers]):
            os.kill(pid, signal.SIGKILL)
    assert said.count("Traceback") == (sign == signal.SIGINT)  # that of the script itself, and none of a worker


def test_an_interrupt_while_workers_start_ends_them_without_a_word(tmp_path):
    main = subprocess.Popen(
        [sys.executable, TESTS / "worker_tasks.py", tmp_path],
        stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    children = Path(f"/proc/{main.pid}/task/{main.pid}/children")
    try:
        wait_until(lambda: len(children.read_text().split()) >= 3)
        started = [int(pid) for pid in children.read_text().split()]
        os.killpg(main.pid, signal.SIGINT)
        _, said = main.communicate(timeout=PATIENCE_S)
        wait_until(lambda: not any(map(is_running, started)))
    finally:
        if is_running(main.pid):
            os.killpg(main.pid, signal.SIGKILL)
    assert said.count("Traceback") == 1
    assert "run_tasks" in said


def test_a_worker_that_is_killed_is_replaced_and_its_task_done(tmp_path):
    tasks = [Number(number) for number in range(4)]
    with open_pool(2) as pool:
        results = run_tasks(tasks, partial(doubled, folder=tmp_path, deaths=2), tmp_path, pool=pool)
    assert [result["twice"] for result in results] == [0, 2, 4, 6]
    assert len(list(tmp_path.glob("death-*"))) == 2


def test_workers_that_are_killed_again_and_again_end_in_one_message(tmp_path):
    carry_out = partial(doubled, folder=tmp_path, deaths=99)
    said = r"killed 3 times in a row.*__main__.*What is done is kept"
    with pytest.raises(InputError, match=said), open_pool(2) as pool:
        run_tasks([Number(1)], carry_out, tmp_path, pool=pool)


@contextmanager
def dask_scheduler(folder, **environment):
    """Give a scheduler without workers: its process, and its address."""
    pytest.importorskip("distributed")
    file = folder / "scheduler.json"
    process = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard",
         "--scheduler-file", file],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=os.environ | environment,
    )  # fmt: skip
    try:
        wait_until(lambda: file.exists() and file.read_text())
        yield process, json.loads(file.read_text())["address"]
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_a_dask_scheduler_that_is_lost_is_one_message(tmp_path):
    def run_while_it_is_lost(pool, scheduler):
        Timer(0.5, scheduler.kill).start()  # there is no worker that could have done the task by then
        run_tasks([Number(0)], partial(doubled, folder=tmp_path, deaths=0), tmp_path, pool=pool)

    with (
        dask_scheduler(tmp_path, PYTHONPATH=os.pathsep.join(sys.path)) as (scheduler, url),
        pytest.raises(InputError, match="is kept: the same command goes on"),
        open_pool(scheduler=url) as pool,
    ):
        run_while_it_is_lost(pool, scheduler)


@pytest.mark.slow
def test_a_dask_scheduler_without_the_packages_of_the_tasks_is_one_message(tmp_path):
    with (
        dask_scheduler(tmp_path, PYTHONPATH="") as (_, url),
        pytest.raises(InputError, match="install there the same versions"),
        open_pool(scheduler=url) as pool,
    ):
        run_tasks([Number(0)], partial(doubled, folder=tmp_path, deaths=0), tmp_path, pool=pool)


def test_a_task_whose_line_is_damaged_is_carried_out_again(tmp_path):
    carry_out = partial(doubled, folder=tmp_path, deaths=0)
    tasks = [Number(0), Number(2), Number(3)]
    expected = run_tasks(tasks, carry_out, tmp_path)
    first, _, last = (tmp_path / RESULTS).read_bytes().splitlines(keepends=True)
    for damaged in (b'{"key": "2", "twi\n', b"\xff\xfe\n", b"null\n", b"[1]\n", b'{"twice": 4}\n', b"\n"):
        (tmp_path / RESULTS).write_bytes(first + damaged + last)
        told = []
        assert run_tasks(tasks, carry_out, tmp_path, step=lambda *each: told.append(each)) == expected  # noqa: B023
        assert told == [("task 0", False), ("task 3", False), ("task 2", True)]


@pytest.mark.parametrize(("limit", "together"), [(2, 2), (None, 4)])
def test_no_more_tasks_are_at_work_than_the_limit(tmp_path, limit, together):
    barrier, at_work, most = Lock(), [0], [0]

    def carry_out(task):
        with barrier:
            at_work[0] += 1
            most[0] = max(most[0], at_work[0])
        time.sleep(0.2)
        with barrier:
            at_work[0] -= 1
        return {"twice": 2 * task.number}

    with ThreadPoolExecutor(4) as pool:
        results = run_tasks([Number(n) for n in range(8)], carry_out, tmp_path, pool=pool, limit=limit)
    assert [result["twice"] for result in results] == [2 * n for n in range(8)]
    assert most[0] == together


@pytest.fixture
def queue(tmp_path, monkeypatch):
    """A stand-in for SLURM: every job begins at once on this machine; one of the account ``nobody`` is refused.

    As SLURM does, it keeps the script, which dask-jobqueue deletes as soon as it is submitted.
    """
    programs = {
        "sbatch": 'if grep -q "nobody" "$1"; then echo "sbatch: error: Invalid account" >&2; exit 1; fi\n'
        'cp "$1" jobs-$$.txt; sh jobs-$$.txt > jobs-$$.log 2>&1 &\necho "Submitted batch job $!"\n',
        "scancel": 'echo "$@" >> cancelled.txt; kill "$@"\n',
    }
    for name, body in programs.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(TESTS), *filter(None, sys.path)]))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_workers_are_jobs_of_slurm_and_end_with_the_campaign(queue):
    """With the job script of dask-jobqueue, a stand-in for SLURM, and the work done in the jobs."""
    pytest.importorskip("dask_jobqueue")
    with open_pool(2, "slurm:memory=1GB,walltime=00:10:00,directive=--constraint=any") as pool:
        results = run_tasks([Number(n) for n in (0, 2, 3)], partial(doubled, folder=queue, deaths=0), queue, pool=pool)
        processes = {pool.submit(os.getpid).result() for _ in range(2)}  # one job's or both
        assert os.getpid() not in processes
        assert all(map(is_running, processes))
    assert [result["twice"] for result in results] == [0, 4, 6]
    scripts = [file.read_text() for file in queue.glob("jobs-*.txt")]
    assert len(scripts) == 2
    for line in ("#SBATCH -t 00:10:00", "#SBATCH --mem=954M", "#SBATCH --constraint=any", sys.executable):
        assert all(line in script for script in scripts)
    assert len((queue / "cancelled.txt").read_text().split()) == 2
    wait_until(lambda: not any(map(is_running, processes)))


@pytest.mark.parametrize(
    ("scheduler", "words"),
    [
        ("slurm:walltime=1", r"(?s)is not understood.*write slurm:cores=1,memory=4GB"),
        ("slurm:memory", "'memory' is not NAME=VALUE"),
        ("slurm:memory=1GB,colour=red", "is not understood"),
        ("slurm:memory=1GB,account=nobody", "'sbatch' refused a job: sbatch: error: Invalid account"),
        ("pbs:memory=1GB", "no program 'qsub' to submit jobs with"),
    ],
)
def test_what_a_queue_does_not_take_is_one_message(queue, scheduler, words):
    pytest.importorskip("dask_jobqueue")
    with pytest.raises(InputError, match=words), open_pool(1, scheduler):
        raise AssertionError("it was taken")


@pytest.mark.parametrize("queue_name", QUEUES)
def test_every_queue_has_a_job_with_its_time_and_memory(queue_name):
    """As dask-jobqueue writes it; only SLURM's is run here."""
    dask_jobqueue = pytest.importorskip("dask_jobqueue")
    options = _options("cores=2,memory=4GB,walltime=02:00,directive=-x,directive=-y")
    assert options["job_extra_directives"] == ["-x", "-y"]
    with getattr(dask_jobqueue, QUEUES[queue_name])(**options, scheduler_options={"dashboard_address": None}) as jobs:
        script = jobs.job_script()
    assert "02:00" in script
    assert "--memory-limit" in script or "--nthreads 2" in script
