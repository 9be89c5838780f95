"""Run jobs in this process, in processes on this machine, or as tasks on Ray.

Jobs return the same results wherever they run, and `run` handles the results in the calling
process. The figures therefore depend on the jobs alone.

Processes are those of loky, the pool of joblib, with an executor of one process for each
worker. `joblib.Parallel` itself does not report progress within a job, cannot add jobs that
follow from a result, and does not report which job a dead worker was running. A pipe ends the
workers if the calling process is killed, which loky's would survive. On Ray, jobs are plain
tasks: the backend `ray.util.joblib` returns results only when all jobs are done, so an
interrupted evaluation would lose its finished work.
"""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing.resource_tracker
import os
import re
import signal
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent import futures
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from typing import Any

import cloudpickle

from DroneSwarmSearch._internal import checks

__all__ = ["Job", "Report", "WorkerCrashed", "no_exit", "run"]

REPORT_EVERY = 0.2
"""Seconds between the progress reports of a worker."""

JOBLIB_HINT = (
    "workers > 1 needs the package joblib: pip install 'DroneSwarmSearchEnvironment[evaluation]'"
)
RAY_HINT = "ray needs the package Ray: pip install 'DroneSwarmSearchEnvironment[ray]'"

Report = Callable[[float], None]


class WorkerCrashed(RuntimeError):  # noqa: N818 (not the caller's error)
    """A worker process died before it finished its job."""


@dataclass(eq=False)
class Job:
    """A piece of work that can run in any process.

    Attributes:
        label: a description for messages: "episodes 0 to 499 of planner on classic".
        function: called with `arguments` and with `report`, a function that takes the share
            done. Function and arguments are pickled if the job runs elsewhere.
        arguments: see `function`.
        weight: the amount of work, in the unit of the progress.
        then: called with the result in the process that called `run`; returns further jobs.
    """

    label: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    weight: float = 0.0
    then: Callable[[Any], Iterable[Job]] = lambda result: ()


Finished = Generator[tuple[Job, Any], None, None]


def run(
    jobs: Iterable[Job],
    *,
    workers: int = 1,
    ray: str | None = None,
    progress: Report = lambda done: None,
) -> None:
    """Run jobs in their order; jobs that follow from a result come next.

    If a job fails, or upon Ctrl-C, the running jobs are stopped. The results of finished
    jobs have been handled by then.

    Args:
        jobs: the jobs.
        workers: the number of processes; 1 runs everything in this process.
        ray: run on Ray: "local" for this machine, "auto" or the address of a cluster.
        progress: called with the weight of all work done.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: `workers` is less than 1.
        ImportError: joblib or Ray is needed and not installed.
        WorkerCrashed: a worker died.
        Exception: any exception that a job raises.
    """
    count = checks.integer("workers", workers, 1)
    if ray is not None and not isinstance(ray, str):
        raise TypeError(f"ray must be 'local', an address or None, got {ray!r}")
    waiting = deque(jobs)
    if not waiting:
        return
    done: dict[Job, float] = {}

    def report(job: Job, share: float) -> None:
        done[job] = share * job.weight
        progress(sum(done.values()))

    if ray is not None:
        finished = _on_ray(waiting, ray)
    elif count > 1:
        finished = _in_processes(waiting, count, report)
    else:
        finished = _here(waiting, report)
    with contextlib.closing(finished):
        for job, result in finished:
            report(job, 1.0)
            waiting.extendleft(reversed([*job.then(result)]))


@contextlib.contextmanager
def no_exit(label: str) -> Iterator[None]:
    """Turn SystemExit into an error, since it would end the program as if it had succeeded.

    Args:
        label: the work, for the message.

    Raises:
        RuntimeError: the work raised SystemExit.
    """
    try:
        yield
    except SystemExit as stop:
        raise RuntimeError(
            f"{label} must not end the program, got SystemExit({stop.code!r})"
        ) from stop


# Where jobs run. Each function takes jobs from a queue, which may grow after every result.


def _here(waiting: deque[Job], report: Callable[[Job, float], None]) -> Finished:
    """Run the jobs one after another in this process."""
    while waiting:
        job = waiting.popleft()
        with no_exit(job.label):
            result = job.function(*job.arguments, report=partial(report, job))
        yield job, result


def _in_processes(
    waiting: deque[Job], count: int, report: Callable[[Job, float], None]
) -> Finished:
    """Run the jobs in processes, each of which belongs to its own executor.

    If a process dies, only the job of its executor fails, so the error can name it.
    """
    try:
        loky: Any = importlib.import_module("joblib.externals.loky")
    except ImportError as error:
        raise ImportError(JOBLIB_HINT) from error
    multiprocessing.resource_tracker.ensure_running()  # see _without_interrupts
    context = loky.backend.get_context("loky")
    reports, (lifeline, our_end) = context.SimpleQueue(), context.Pipe(duplex=False)
    executors = [
        loky.ProcessPoolExecutor(
            1, context=context, initializer=_start_process, initargs=(reports, lifeline)
        )
        for _ in range(count)
    ]
    idle, running = executors[::-1], dict[Any, tuple[Job, Any]]()
    try:
        while waiting or running:
            while waiting and idle:
                job, executor = waiting.popleft(), idle.pop()
                packed = _packed(job)
                with _without_interrupts():
                    future = executor.submit(_perform_in_process, id(job), packed)
                running[future] = job, executor
            done, _ = futures.wait(running, REPORT_EVERY, futures.FIRST_COMPLETED)
            jobs = {id(job): job for job, _ in running.values()}
            while not reports.empty():
                key, share = reports.get()
                if key in jobs:
                    report(jobs[key], share)
            for future in done:
                job, executor = running.pop(future)
                idle.append(executor)
                try:
                    answer = future.result()
                except BrokenProcessPool as error:
                    codes = ", ".join(re.findall(r"\w+\(-?\d+\)", str(error))) or str(error)
                    raise _crashed(job, codes) from None
                yield job, _result(answer)
    finally:
        for executor in executors:
            executor.shutdown(kill_workers=True)
        our_end.close()


def _on_ray(waiting: deque[Job], address: str) -> Finished:
    """Run the jobs as Ray tasks, which Ray distributes over its processors."""
    try:
        ray: Any = importlib.import_module("ray")
    except ImportError as error:
        raise ImportError(RAY_HINT) from error
    is_ours = not ray.is_initialized()
    if is_ours:
        ray.init(address=address, log_to_driver=False, logging_level="error")
    perform = ray.remote(num_cpus=1, max_retries=0)(_perform)
    running: dict[Any, Job] = {}
    try:
        while waiting or running:
            while waiting:
                job = waiting.popleft()
                running[perform.remote(_packed(job))] = job
            (task,), _ = ray.wait(list(running), num_returns=1)
            job = running.pop(task)
            try:
                answer = ray.get(task)
            except ray.exceptions.RayError as error:
                raise _crashed(job, str(error).splitlines()[0]) from error
            yield job, _result(answer)
    finally:
        for task in running:
            ray.cancel(task, force=True)
        if is_ours:
            ray.shutdown()


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Block Ctrl-C while a process starts; the process inherits this from its first moment.

    Until Python 3.12, starting the resource tracker unblocks signals, so it must run before.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# In a worker.

_reports: Any = None
"""The queue for progress reports, in a worker process."""


def _start_process(reports: Any, lifeline: Any) -> None:
    global _reports
    _reports = reports
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the calling process stops the workers
    threading.Thread(target=_exit_with_caller, args=(lifeline,), daemon=True).start()


def _exit_with_caller(lifeline: Any) -> None:
    """End the worker if the calling process is killed, which closes its end of the pipe."""
    with contextlib.suppress(EOFError, OSError):
        lifeline.recv()
    os._exit(1)


def _perform_in_process(key: int, packed: bytes) -> bytes:
    last = 0.0

    def report(share: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= REPORT_EVERY:
            last = now
            _reports.put((key, share))

    return _perform(packed, report)


def _packed(job: Job) -> bytes:
    try:
        packed: bytes = cloudpickle.dumps((job.label, job.function, job.arguments))
    except Exception as error:
        raise TypeError(
            f"{job.label} cannot be sent to a worker ({error}); use workers=1"
        ) from error
    return packed


def _perform(packed: bytes, report: Report = lambda share: None) -> bytes:
    """Run a pickled job; return its result, or its exception and traceback, pickled."""
    try:
        label, function, arguments = cloudpickle.loads(packed)
        with no_exit(label):
            result = function(*arguments, report=report)
        answer: bytes = cloudpickle.dumps((result, None, ""))
    except Exception as error:
        text = traceback.format_exc()
        try:
            answer = cloudpickle.dumps((None, error, text))
            cloudpickle.loads(answer)
        except Exception:  # not every exception can be pickled
            answer = cloudpickle.dumps((None, RuntimeError(repr(error)), text))
    return answer


class _RemoteTraceback(Exception):  # noqa: N818 (the cause of another exception)
    """The traceback of an exception that was raised in a worker."""

    def __str__(self) -> str:
        return f"\n\n{self.args[0]}"


def _result(answer: bytes) -> Any:
    """The result in a worker's answer; raises its exception."""
    result, error, text = cloudpickle.loads(answer)
    if error is not None:
        raise error from _RemoteTraceback(text)
    return result


def _crashed(job: Job, reason: str) -> WorkerCrashed:
    return WorkerCrashed(f"a worker process died ({reason}) while it was running {job.label}")
