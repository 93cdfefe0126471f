"""A fit whose starts run in jobs of a queue: queue_fit.py PROJECT OUT.

The queue is SLURM's; LSFCluster and PBSCluster of dask_jobqueue take the same words. Needs
bubblefit[cluster], on this machine and on those of the queue.
"""

import sys
from typing import Any

import bubblefit as bf
from dask_jobqueue import SLURMCluster

#: At once; the queue may give fewer. One thread a worker: a start is one process.
JOBS = 100
JOB: dict[str, Any] = {"cores": 1, "processes": 1, "memory": "2GB", "walltime": "12:00:00"}
#: More lines of the job: here that the queue holds it back until it has a licence to give.
MORE = ["-L marc:1"]


def main(project: str, out: str) -> None:
    with SLURMCluster(**JOB, job_extra_directives=MORE) as cluster:
        cluster.adapt(maximum=JOBS)
        fit = bf.fit(bf.read_project(project), scheduler=cluster.scheduler_address, out=out)
        fit.report(out)
    print(fit.moduli())


if __name__ == "__main__":
    main(*sys.argv[1:])
