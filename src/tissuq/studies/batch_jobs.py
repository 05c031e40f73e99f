"""Workers that are batch jobs of a cluster's queue: ``slurm:cores=1,memory=4GB,walltime=02:00:00``."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tissuq.errors import InputError

QUEUES = {"slurm": "SLURMCluster", "pbs": "PBSCluster", "lsf": "LSFCluster", "sge": "SGECluster"}
"""The class of dask-jobqueue for every queue."""
COUNTS = ("cores", "processes")
"""Options that are numbers."""
DIRECTIVE = "directive"
"""An option that may be given several times: a line for the queue, such as ``--constraint=skylake``."""


def is_queue(scheduler: str) -> bool:
    """Return whether a scheduler is named by a queue, and not by its address.

    Examples
    --------
    >>> from tissuq.studies.batch_jobs import is_queue
    >>> is_queue("slurm:cores=1,memory=4GB"), is_queue("tcp://10.0.0.1:8786")
    (True, False)
    """
    return scheduler.partition(":")[0] in QUEUES


@contextmanager
def workers_in_queue(scheduler: str, jobs: int) -> Iterator[Any]:
    """Give a Dask cluster whose workers are as many batch jobs, which end with it.

    Raises
    ------
    InputError
        When the queue is not there, or its options are not understood.
    """
    try:
        import dask_jobqueue
    except ImportError as error:
        raise InputError(
            f"--scheduler {scheduler} needs dask-jobqueue: install tissuq with its extra 'slurm'."
        ) from error
    queue, _, text = scheduler.partition(":")
    kind = getattr(dask_jobqueue, QUEUES[queue])
    program = kind.job_cls.submit_command.split()[0]
    if shutil.which(program) is None:
        raise InputError(f"there is no program '{program}' to submit jobs with (--scheduler {queue}).")
    try:
        cluster = kind(**_options(text), scheduler_options={"dashboard_address": None})
    except (TypeError, ValueError) as error:
        raise InputError(
            f"--scheduler {scheduler} is not understood ({error}): write {queue}:cores=1,memory=4GB,walltime=02:00:00, "
            "and queue=NAME, account=NAME or directive=TEXT where they are needed."
        ) from error
    with cluster:
        try:
            cluster.sync(_submit, cluster, jobs)
        except RuntimeError as error:
            said = " ".join(str(error).partition("stderr:")[2].split()) or str(error)
            raise InputError(f"--scheduler {scheduler}: '{program}' refused a job: {said}") from error
        yield cluster


async def _submit(cluster: Any, jobs: int) -> None:
    """Submit jobs and wait for the answer, which ``cluster.scale`` does not."""
    for _ in range(jobs):
        cluster.worker_spec.update(cluster.new_worker_spec())
    try:
        await cluster._correct_state()
    finally:
        for job in cluster.workers.values():
            if job.status.name == "created":  # it was refused, without which the cluster would not close
                job.status = type(job.status).failed


def _options(text: str) -> dict[str, Any]:
    """Return the options of a class of dask-jobqueue from a text like ``cores=1,memory=4GB``."""
    options: dict[str, Any] = {"cores": 1}
    for pair in filter(None, text.split(",")):
        name, equals, value = (word.strip() for word in pair.partition("="))
        if not equals:
            raise ValueError(f"'{pair}' is not NAME=VALUE")
        if name == DIRECTIVE:
            options.setdefault("job_extra_directives", []).append(value)
        else:
            options[name] = int(value) if name in COUNTS else value
    return options
