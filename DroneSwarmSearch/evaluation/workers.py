"""Jobs run here, in processes on this machine, or as tasks of a Ray cluster.

Wherever a job runs it does the same; results are taken in where `run` was called. So what
is made of them depends on the jobs alone, not on the workers.
"""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import multiprocessing.connection
import signal
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import cloudpickle

from DroneSwarmSearch._internal import checks

__all__ = ["Job", "WorkerCrashed", "no_exit", "run"]

REPORT_EVERY = 0.2
"""Seconds between what a worker tells of its progress, at least."""

RAY_HINT = "ray needs the package Ray: pip install 'DroneSwarmSearchEnvironment[ray]'"

Report = Callable[[float], None]


class WorkerCrashed(RuntimeError):  # noqa: N818 (it is what happened)
    """A worker ended before its job did."""


@dataclass(eq=False)
class Job:
    """A piece of work that can be done anywhere.

    Attributes:
        label: what it is, for messages: "portion 2 of 4 of planner on classic".
        function: called with the arguments and, as `report`, a function to be told now
            and then which share is done. It and they are pickled if the job is done
            elsewhere. None: there is nothing left to do.
        arguments: see `function`.
        weight: how much work it is, in the unit that progress is told in.
        then: takes in the result, where `run` was called; returns jobs that follow.
    """

    label: str
    function: Callable[..., Any] | None
    arguments: tuple[Any, ...] = ()
    weight: float = 0.0
    then: Callable[[Any], Iterable[Job]] = lambda result: ()


def run(
    jobs: Iterable[Job],
    *,
    workers: int = 1,
    ray: str | None = None,
    progress: Report = lambda done: None,
) -> None:
    """Do jobs in their order, those that follow from one as soon as it is done.

    Args:
        jobs: what is to be done.
        workers: processes; with 1 all is done in this one.
        ray: do it on Ray instead: "local" for this machine, or a cluster's address ("auto":
            the one that this machine belongs to).
        progress: told now and then the weight of all that is done.

    Raises:
        TypeError: an argument is of the wrong type.
        ValueError: `workers` is less than 1.
        ImportError: `ray` is given and Ray is not installed.
        WorkerCrashed: a worker ended before its job did.
        Exception: whatever a job raises. In each of these cases, and upon Ctrl-C, the other
            jobs are stopped; those that are done have been taken in.
    """
    count = checks.integer("workers", workers, 1)
    if ray is not None and not isinstance(ray, str):
        raise TypeError(f"ray must be 'local', an address or None, got {ray!r}")
    told = _Told(progress)
    waiting = deque(_left(jobs, told))
    if ray is not None:
        finished = _on_ray(waiting, ray)
    elif count > 1:
        finished = _in_processes(waiting, count, told)
    else:
        finished = _here(waiting, told)
    with contextlib.closing(finished):
        for job, result in finished:
            told.finished(job)
            waiting.extendleft(reversed(_left(job.then(result), told)))


@contextlib.contextmanager
def no_exit(label: str) -> Iterator[None]:
    """Turn SystemExit into an error: it would end the program as if all were done.

    Args:
        label: what is being done.

    Raises:
        RuntimeError: what is done raised SystemExit.
    """
    try:
        yield
    except SystemExit as stop:
        raise RuntimeError(
            f"{label} must not end the program, got SystemExit({stop.code!r})"
        ) from stop


def _left(jobs: Iterable[Job], told: _Told) -> list[Job]:
    """Those of some jobs with something to do; the others are told to be done."""
    wanted = list(jobs)
    for job in wanted:
        if job.function is None:
            told.finished(job)
    return [job for job in wanted if job.function is not None]


class _Told:
    """Adds up what jobs tell of their progress."""

    def __init__(self, progress: Report) -> None:
        self._progress = progress
        self._done = 0.0
        self._under_way: dict[Job, float] = {}

    def __call__(self, job: Job, share: float) -> None:
        self._under_way[job] = share * job.weight
        self._progress(self._done + sum(self._under_way.values()))

    def finished(self, job: Job) -> None:
        self._under_way.pop(job, None)
        self._done += job.weight
        self._progress(self._done + sum(self._under_way.values()))


# Each of these takes jobs from a queue that may grow whenever it has given out a result.

Finished = Generator[tuple[Job, Any], None, None]


def _here(waiting: deque[Job], told: _Told) -> Finished:
    while waiting:
        job = waiting.popleft()
        assert job.function is not None
        with no_exit(job.label):
            result = job.function(*job.arguments, report=lambda share, job=job: told(job, share))
        yield job, result


# Processes on this machine.


class _Worker:
    """A process that does one job after another."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(target=_work, args=(theirs,), daemon=True)
        self.job: Job | None = None
        self.ready = False
        with _interrupts_held():
            self.process.start()
        theirs.close()

    def begin(self, job: Job) -> None:
        """Give it a job."""
        self.job = job
        try:
            self.connection.send_bytes(_packed(job))
        except BrokenPipeError:
            raise self.crashed() from None

    def crashed(self) -> WorkerCrashed:
        """Why it does not answer any more."""
        assert self.job is not None
        self.process.join()
        hint = ""
        if not self.ready:
            hint = (
                ". It did not even begin: a script that uses workers must keep what it does "
                'under `if __name__ == "__main__":`, since workers import it'
            )
        return _crashed(self.job, f"exit code {self.process.exitcode}", hint)


def _in_processes(waiting: deque[Job], count: int, told: _Told) -> Finished:
    workers: list[_Worker] = []
    try:
        while True:
            idle = [worker for worker in workers if worker.job is None]
            while waiting and (idle or len(workers) < count):
                if not idle:
                    idle.append(_Worker())
                    workers.append(idle[-1])
                idle.pop().begin(waiting.popleft())
            busy = {worker.connection: worker for worker in workers if worker.job is not None}
            if not busy:
                break
            for connection in multiprocessing.connection.wait(list(busy)):
                worker = busy[connection]  # type: ignore[index]
                job = worker.job
                assert job is not None
                try:
                    answer = cloudpickle.loads(worker.connection.recv_bytes())
                except (EOFError, ConnectionResetError):
                    raise worker.crashed() from None
                worker.ready = True
                if answer[0] == "share":
                    told(job, answer[1])
                elif answer[0] != "ready":
                    worker.job = None
                    yield job, _result(answer)
    finally:
        for worker in workers:
            worker.connection.close()
            worker.process.terminate()
        for worker in workers:
            worker.process.join(2.0)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
            worker.process.close()


def _work(connection: Connection) -> None:
    """What a process does: jobs, until nobody is there any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever asked for the work will stop it
    told = 0.0

    def report(share: float) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told >= REPORT_EVERY:
            told = now
            connection.send_bytes(cloudpickle.dumps(("share", share)))

    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        connection.send_bytes(cloudpickle.dumps(("ready",)))
        while True:
            connection.send_bytes(_perform(connection.recv_bytes(), report))


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Keep Ctrl-C back; processes begun meanwhile do not hear it, from their first moment."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# Tasks of a Ray cluster.


def _on_ray(waiting: deque[Job], address: str) -> Finished:
    try:
        ray: Any = importlib.import_module("ray")
    except ImportError as error:
        raise ImportError(RAY_HINT) from error
    begun = not ray.is_initialized()
    if begun:
        ray.init(address=address, log_to_driver=False, logging_level="error")
    perform = ray.remote(num_cpus=1, max_retries=0)(_perform)
    under_way: dict[Any, Job] = {}
    try:
        while waiting or under_way:
            while waiting:
                job = waiting.popleft()
                under_way[perform.remote(_packed(job))] = job
            done, _ = ray.wait(list(under_way), num_returns=1)
            job = under_way.pop(done[0])
            try:
                answer = cloudpickle.loads(ray.get(done[0]))
            except ray.exceptions.RayError as error:
                raise _crashed(job, str(error).splitlines()[0], "") from error
            yield job, _result(answer)
    finally:
        for task in under_way:
            ray.cancel(task, force=True)
        if begun:
            ray.shutdown()


# What goes to a worker and comes back.


class _Remote(Exception):  # noqa: N818 (shown as the cause of another exception)
    """Where in a worker an exception was raised."""

    def __str__(self) -> str:
        return f"\n\n{self.args[0]}"


def _packed(job: Job) -> bytes:
    try:
        packed: bytes = cloudpickle.dumps((job.label, job.function, job.arguments))
    except Exception as error:
        raise TypeError(
            f"{job.label} cannot be sent to a worker ({error}); without workers it can be done"
        ) from error
    return packed


def _perform(packed: bytes, report: Report = lambda share: None) -> bytes:
    """Do a packed job; returns its result or its exception, packed."""
    try:
        label, function, arguments = cloudpickle.loads(packed)
        with no_exit(label):
            result = function(*arguments, report=report)
        answer: bytes = cloudpickle.dumps(("result", result))
    except Exception as error:
        text = traceback.format_exc()
        try:
            answer = cloudpickle.dumps(("error", error, text))
            cloudpickle.loads(answer)
        except Exception:  # some exceptions cannot travel
            answer = cloudpickle.dumps(("error", RuntimeError(repr(error)), text))
    return answer


def _result(answer: tuple[Any, ...]) -> Any:
    """What a worker's answer tells; raises the exception if it is one."""
    if answer[0] == "error":
        raise answer[1] from _Remote(answer[2])
    return answer[1]


def _crashed(job: Job, why: str, hint: str) -> WorkerCrashed:
    return WorkerCrashed(f"a worker process died ({why}) while it was doing {job.label}{hint}")
