"""A SLURM of one node on the loopback: its files in a folder of its own, its daemons children of this process."""

import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from support.held_ports import held_ports
from support.jobs import PATIENCE, environment

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "sinfo", "scancel", "setpriv")
PATH = f"{os.environ['PATH']}:/usr/sbin"  # Debian's place of the daemons
STARTED_S, ENDED_S, CANCELLED_S = 120.0, 900.0, 60.0  # limits: of the start, of jobs, of their end when cancelled
OPEN = {"PENDING", "CONFIGURING", "RUNNING", "COMPLETING", "SUSPENDED"}
MUNGE_FILES = {"key-file": "key", "socket": "socket", "pid-file": "pid", "log-file": "log", "seed-file": "seed"}

# As on stock Debian without systemd or cgroups, and srun without PMI.  The job scripts' own requests fit: four
# processors, though there may be fewer.
CONFIGURATION = """\
ClusterName=feti_homog_test
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MailProg=/bin/true
MpiDefault=none
SchedulerParameters=sched_interval=1,bf_interval=1
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
ReturnToService=2
KillWait=3
MinJobAge=3600
NodeName={host} NodeAddr=127.0.0.1 CPUs=4 RealMemory=16000 State=UNKNOWN
PartitionName=test Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def obstacle() -> str | None:
    """Why no such SLURM can be set up here, if so."""
    missing = [name for name in PROGRAMS if shutil.which(name, path=PATH) is None]
    return f"{', '.join(missing)}: not installed (Debian: slurm-wlm, munge)" if missing else None


class NotStartedError(Exception):
    """SLURM is installed, but does not start here."""


@dataclass(frozen=True)
class Job:
    """A job, or a task of an array: its state and exit code as SLURM reports them."""

    state: str
    code: int


class OneNodeSlurm:
    """Commands and jobs of the SLURM whose files are in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = environment() | {"SLURM_CONF": str(folder / "slurm.conf"), "PATH": PATH}

    def run(self, *words: str | Path, cwd: Path | None = None, code: int = 0, **variables: str) -> str:
        """Run a command with this exit code; returns both streams together."""
        job = subprocess.run(
            list(map(str, words)),
            cwd=cwd,
            env=self.environment | variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=PATIENCE,
        )
        assert job.returncode == code, f"{words}: exit code {job.returncode}\n{job.stdout}"
        return job.stdout

    def jobs(self, number: str) -> list[Job]:
        """Return the job of that number, or the tasks of that array in their order."""
        lines = self.run("scontrol", "show", "job", "--oneliner", number).splitlines()
        found = [dict(re.findall(r"(\w+)=(\S*)", line)) for line in lines if line.strip()]
        found.sort(key=lambda job: [int(index) for index in re.findall(r"\d+", job.get("ArrayTaskId", ""))])
        return [Job(job["JobState"], int(job["ExitCode"].partition(":")[0])) for job in found]

    def ended(self, number: str) -> list[Job]:
        """`jobs` when all of them have ended."""
        wait(lambda: not any(job.state in OPEN for job in self.jobs(number)), ENDED_S, f"job {number} does not end")
        return self.jobs(number)

    def queued(self) -> str:
        return self.run("squeue", "--noheader")

    def processes(self) -> list[int]:
        """All processes of this SLURM: its daemons, and jobs with all that they started."""
        mark, found = f"SLURM_CONF={self.folder}/".encode(), list[int]()
        for path in Path("/proc").glob("[0-9]*/environ"):
            with suppress(OSError):
                if mark in path.read_bytes():
                    found.append(int(path.parent.name))
        return found


def wait(reached: Callable[[], bool], seconds: float, complaint: str) -> None:
    """Raise TimeoutError with the complaint if it takes longer."""
    deadline = time.monotonic() + seconds
    while not reached():
        if time.monotonic() > deadline:
            raise TimeoutError(f"{complaint}, after {seconds:g} s")
        time.sleep(0.1)


@contextmanager
def one_node_slurm() -> Iterator[OneNodeSlurm]:
    """Set up, and taken down with all its jobs, also if something fails.

    Raises NotStartedError with the errors that the daemons report.
    """
    folder = Path(tempfile.mkdtemp(prefix="slurm-", dir="/tmp"))  # short, as names of sockets must be
    slurm = OneNodeSlurm(folder)
    with ExitStack() as stack:
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        stack.callback(_kill, slurm)
        _configure(folder, stack)
        munge = [f"--{option}={folder}/munge.{name}" for option, name in MUNGE_FILES.items()]
        _start(slurm, stack, "munged", "--foreground", "--force", *munge)
        _await_start((folder / "munge.socket").exists, folder)
        _start(slurm, stack, "slurmctld", "-D", "-i")
        _start(slurm, stack, "slurmd", "-D")
        stack.callback(_cancel, slurm)
        _await_start(lambda: _node_state(slurm) == "idle", folder)
        yield slurm


def _configure(folder: Path, stack: ExitStack) -> None:
    folder.chmod(0o755)
    for name in ("state", "spool"):
        (folder / name).mkdir()
    (folder / "munge.key").write_bytes(os.urandom(128))
    (folder / "munge.key").chmod(0o600)
    version = subprocess.run(["slurmd", "-V"], env=os.environ | {"PATH": PATH}, capture_output=True, text=True).stdout
    plugin = "disabled" if re.findall(r"\d+", version)[0] >= "23" else "cgroup/v1"  # neither looks for cgroups
    (folder / "cgroup.conf").write_text(f"CgroupPlugin={plugin}\n")
    host = socket.gethostname().partition(".")[0]
    words = {"host": host, "user": os.geteuid(), "folder": folder, "ports": held_ports(stack, 2)}
    (folder / "slurm.conf").write_text(CONFIGURATION.format(**words))


def _start(slurm: OneNodeSlurm, stack: ExitStack, *command: str) -> None:
    """Start a daemon, which the kernel ends if this process is killed."""
    log = stack.enter_context((slurm.folder / f"{command[0]}.out").open("w"))
    words = ["setpriv", "--pdeathsig", "KILL", "--", *command]
    process = subprocess.Popen(words, env=slurm.environment, stdout=log, stderr=log)
    stack.callback(_end, process)


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    with suppress(subprocess.TimeoutExpired):
        process.wait(CANCELLED_S)


def _node_state(slurm: OneNodeSlurm) -> str:
    words = ["sinfo", "--noheader", "--format=%T"]
    return subprocess.run(words, env=slurm.environment, capture_output=True, text=True, timeout=PATIENCE).stdout.strip()


def _await_start(reached: Callable[[], bool], folder: Path) -> None:
    try:
        wait(reached, STARTED_S, "it does not start")
    except TimeoutError as error:
        logs = [path.read_text() for path in sorted(folder.glob("*.out"))]
        errors = [line for log in logs for line in log.splitlines() if re.search("error|fatal", line, re.IGNORECASE)]
        raise NotStartedError("; ".join([str(error), *errors[-3:]])) from None


def _cancel(slurm: OneNodeSlurm) -> None:
    with suppress(AssertionError, subprocess.TimeoutExpired, TimeoutError):
        slurm.run("scancel", f"--user={os.geteuid()}")
        wait(lambda: not slurm.queued(), CANCELLED_S, "jobs do not end")


def _kill(slurm: OneNodeSlurm) -> None:
    for process in slurm.processes():
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
