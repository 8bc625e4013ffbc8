"""Campaigns on worker processes and on real dask schedulers, killed for the purpose."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("pyarrow", reason="the extra 'campaign' is not installed")
distributed = pytest.importorskip("distributed", reason="the extra 'campaign' is not installed")
psutil = pytest.importorskip("psutil", reason="the extra 'campaign' is not installed")

from fullam.analysis import cluster as cluster_module  # noqa: E402
from fullam.analysis.campaign import Campaign, sweep  # noqa: E402
from fullam.analysis.campaign_store import CampaignStore, open_store  # noqa: E402
from fullam.analysis.campaign_table import read_campaign  # noqa: E402
from fullam.analysis.cluster import Scheduler, map_in_order, open_workers  # noqa: E402
from fullam.analysis.worker_processes import WorkerProcesses  # noqa: E402
from fullam.exceptions import CampaignError, FullamWarning  # noqa: E402
from fullam.simulation.scenarios.scenario import load_scenario  # noqa: E402

# dask closes a killed worker's sockets when it gets to it.
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning")

SHORT = replace(load_scenario("position-1"), name="short", duration=0.5)
CAMPAIGN = Campaign((SHORT,), ("pid", "dc-pid"), tuple(range(24)), driver="python")
"""Flown one by one in Python, as laws are that are no kernels: those go to worker processes."""

KERNELS = replace(CAMPAIGN, driver="fused")

SCRIPT = """
import sys, time
from dataclasses import replace
from fullam.analysis.campaign import Campaign, sweep
from fullam.simulation.scenarios.scenario import load_scenario

def tell(done, total):
    print(done, time.monotonic(), flush=True)

short = replace(load_scenario("position-1"), name="short", duration=float(sys.argv[3]))
seeds = tuple(range(int(sys.argv[5])))
campaign = Campaign((short,), ("pid", "dc-pid"), seeds, driver=sys.argv[4])
sweep(campaign, sys.argv[1], jobs=int(sys.argv[2]), progress=tell)
"""

OWN = """
import sys
from fullam.analysis.campaign import Campaign, sweep
from fullam.control.controllers import register
from fullam.control.pid import Pid
from fullam.simulation.scenarios.scenario import Scenario

GAIN = 0.9

@register("own")
class Own(Pid):
    "A law that no worker can import."
    def wrench(self, t, measurement, reference):
        return GAIN * super().wrench(t, measurement, reference)

campaign = Campaign((Scenario("brief", duration=0.2),), ("own",), tuple(range(4)))
sweep(campaign, sys.argv[1], jobs=1)
sweep(campaign, sys.argv[2], jobs=2)
"""


@pytest.fixture(scope="module")
def one_job(tmp_path_factory):
    out = tmp_path_factory.mktemp("one") / "sweep.parquet"
    sweep(CAMPAIGN, out, jobs=1)
    return out


def family(pid: int) -> list:
    """A process and all that it has started."""
    with contextlib.suppress(psutil.NoSuchProcess):
        process = psutil.Process(pid)
        return [process, *process.children(recursive=True)]
    return []


def gone(processes: list, seconds: float) -> bool:
    """Whether all of them end within a time."""
    return not psutil.wait_procs(processes, timeout=seconds)[1]


def test_workers_that_are_killed_cost_no_row(tmp_path, one_job):
    out, killed = tmp_path / "sweep.parquet", []

    def kill_one(done: int, total: int) -> None:
        if 0 < done < total and len(killed) < 3:
            workers = [p for p in family(os.getpid())[1:] if p.pid not in killed]
            if workers:  # the next ones may not have been started yet
                killed.append(workers[0].pid)
                workers[0].kill()

    sweep(CAMPAIGN, out, jobs=2, progress=kill_one)
    assert len(killed) == 3
    assert out.read_bytes() == one_job.read_bytes()
    assert gone(family(os.getpid())[1:], 5.0)


def die(item: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return item


def complain(item: int) -> int:
    raise CampaignError("item", "number", f"is {item}", "give another")


def test_an_item_that_kills_its_workers_is_given_up():
    with open_workers(2) as workers, pytest.raises(CampaignError, match="ended 4 of them"):
        map_in_order(workers, die, [1, 2])


def test_an_error_on_a_worker_is_raised_here_and_the_workers_go_on():
    with open_workers(2) as workers:
        with pytest.raises(CampaignError, match="item: number: is"):
            map_in_order(workers, complain, [1, 2, 3])
        assert map_in_order(workers, abs, [-3, 2, -1]) == [3, 2, 1]


def test_nothing_listens_while_local_workers_fly(tmp_path):
    seen, listening = set(), []

    def look(done: int, total: int) -> None:
        for process in family(os.getpid()):
            with contextlib.suppress(psutil.NoSuchProcess):
                seen.add(process.pid)
                sockets = process.net_connections(kind="inet")
                listening.extend(s for s in sockets if s.status == psutil.CONN_LISTEN)

    sweep(CAMPAIGN, tmp_path / "sweep.parquet", jobs=2, progress=look)
    assert len(seen) >= 3, "both workers were looked at"
    seen.clear()
    sweep(KERNELS, tmp_path / "kernels.parquet", jobs=2, progress=look)
    assert seen == {os.getpid()}, "kernels fly in threads of this process"
    assert listening == []


@pytest.mark.parametrize(
    ("driver", "duration", "runs"), [("python", 1.0, 40), ("fused", 8.0, 8000)]
)
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_kill_loses_the_flights_in_the_air_and_half_a_second(
    tmp_path, jobs, driver, duration, runs
):
    short = replace(SHORT, duration=duration)
    campaign = Campaign((short,), ("pid", "dc-pid"), tuple(range(runs)), driver=driver)
    out, script = tmp_path / "sweep.parquet", tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, str(script), str(out), str(jobs), str(duration), driver, str(runs)],
        stdout=subprocess.PIPE,
        text=True,
    )
    told = []
    for line in process.stdout:
        done, moment = line.split()
        if int(done):
            told.append((int(done), float(moment)))
        if told and float(moment) > told[0][1] + 2.0:
            break
    relatives = family(process.pid)
    process.send_signal(signal.SIGKILL)
    killed = time.monotonic()
    process.stdout.close()
    process.wait()
    assert gone(relatives, 5.0), "workers outlive their parent"
    assert not out.exists()
    kept = len(CampaignStore(out, campaign.identity(), False).keys)
    # A row is told when the store has it and is in a file half a second later; a second more is
    # for a disk and a processor that others use, too (`make hostile` allows a tenth).
    due = max(done for done, moment in told if moment < killed - 1.5)
    assert 2 * runs > kept >= due > 0
    if driver == "fused":  # the rest would take a minute: so few seeds as are kept, and some more
        seeds = {seed for *_, seed in CampaignStore(out, campaign.identity(), False).keys}
        campaign = replace(campaign, seeds=tuple(range(len(seeds) + 5)))
    sweep(campaign, out)
    assert sorted(tmp_path.iterdir()) == [script, out]
    sweep(campaign, tmp_path / "whole.parquet", jobs=2)
    assert out.read_bytes() == (tmp_path / "whole.parquet").read_bytes()


OWN_KERNEL = """
import sys, time
import cloudpickle
from fullam.analysis.campaign import Campaign
from fullam.control import pid
from fullam.control.controllers import register
from fullam.control.signals import Command
from fullam.dynamics.spatial import Spatial
from fullam.numbers.kernel import kernel
from fullam.simulation.scenarios.scenario import Scenario

SHARE = 0.9 + 1e-9 * (time.time_ns() % 10**6)  # compiled by nobody yet

@kernel
def share(x):
    return SHARE * x

@kernel
def mild(numbers, chain, estimate, target, memory):
    command, memory = pid.command(numbers, chain, estimate, target, memory)
    x, y, z = command.wrench.linear
    wrench = Spatial((share(x), y, z), command.wrench.angular)
    return Command(wrench, command.u_pid, command.u_dc), memory

@register("mild")
class Mild(pid.Pid):
    kernels = pid.Pid.kernels._replace(command=mild)

campaign = Campaign((Scenario("brief", duration=0.2),), ("mild",), (0, 1))
assert campaign.drivers == {"mild": "fused"}
sys.stdout.buffer.write(cloudpickle.dumps((campaign, campaign.conditions())))
"""

WORKER = """
import pickle, sys
from fullam.analysis.campaign import fly_slice
campaign, conditions = pickle.load(sys.stdin.buffer)
(cells,) = fly_slice(campaign, conditions, campaign.keys)
print(*cells.flights.outcomes)
"""


def test_kernels_of_a_script_are_kernels_on_a_worker():
    sent = subprocess.run([sys.executable, "-"], input=OWN_KERNEL.encode(), capture_output=True)
    assert sent.returncode == 0, sent.stderr.decode()
    code = [sys.executable, "-c", WORKER]
    flown = subprocess.run(code, input=sent.stdout, capture_output=True)
    assert flown.stdout.split() == [b"completed"] * 2, flown.stderr.decode()


KERNELS_ALONE = """
import sys
from fullam.analysis.campaign import Campaign, sweep
sweep(Campaign(("task-1",), ("pid",), (0, 1, 2)), sys.argv[1], jobs=2)
heavy = {"distributed", "dask"}
print(sorted(heavy & set(sys.modules)))
"""


def test_kernels_need_no_cluster(tmp_path):
    out = str(tmp_path / "sweep.parquet")
    code = [sys.executable, "-c", KERNELS_ALONE, out]
    said = subprocess.run(code, capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_ctrl_c_ends_threads_at_once(tmp_path):
    out, script = tmp_path / "sweep.parquet", tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, str(script), str(out), "2", "8.0", "fused", "6000"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    for line in process.stdout:
        if int(line.split()[0]) >= 80:
            break
    process.send_signal(signal.SIGINT)
    sent = time.monotonic()
    rest = process.stdout.read()
    process.wait()
    # A block in the air takes some hundredths of a second, leaving Python a few tenths.
    assert time.monotonic() - sent < 10.0
    kept = len(list((tmp_path / "sweep.parquet.parts").glob("*.parquet")))
    assert kept > 0
    assert not out.exists()
    told = [int(line.split()[0]) for line in rest.splitlines()]
    assert max(told, default=80) < 12000


def test_two_campaigns_do_not_write_to_one_file(tmp_path):
    out = tmp_path / "sweep.parquet"
    with open_store(out, CAMPAIGN.identity(), False):
        code = f"import sys; sys.argv = ['', {str(out)!r}, '1', '0.5', 'python', '24']\n{SCRIPT}"
        second = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert second.returncode == 1
        assert "is being written by another process" in second.stderr
        assert str(os.getpid()) in second.stderr
        with pytest.raises(CampaignError, match="another process"):
            sweep(CAMPAIGN, out)
    assert list(tmp_path.iterdir()) == []


def test_a_controller_of_a_script_flies_on_workers_too(tmp_path):
    outs = [str(tmp_path / name) for name in ("one.parquet", "two.parquet")]
    # From standard input: there is no file that a worker could import the class from.
    subprocess.run([sys.executable, "-", *outs], input=OWN, text=True, check=True)
    assert Path(outs[0]).read_bytes() == Path(outs[1]).read_bytes()


@contextlib.contextmanager
def scheduler(workers: int, security=None):
    with distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address=":0",
        security=security,
        protocol="tls://" if security else "tcp://",
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture
def certificates(tmp_path):
    trustme = pytest.importorskip("trustme", reason="the extra 'test' is not installed")
    authority = trustme.CA()
    issued = authority.issue_cert("127.0.0.1")
    paths = {name: str(tmp_path / f"{name}.pem") for name in ("ca_file", "certificate", "key")}
    authority.cert_pem.write_to_path(paths["ca_file"])
    issued.cert_chain_pems[0].write_to_path(paths["certificate"])
    issued.private_key_pem.write_to_path(paths["key"])
    return paths


def test_a_scheduler_behind_tls_opens_to_its_certificates_alone(tmp_path, certificates, one_job):
    files = {
        f"tls_{role}_{kind}": certificates[name]
        for role in ("scheduler", "worker", "client")
        for kind, name in (("cert", "certificate"), ("key", "key"))
    }
    security = distributed.Security(
        tls_ca_file=certificates["ca_file"], require_encryption=True, **files
    )
    with scheduler(2, security) as address:
        assert address.startswith("tls://")
        out = tmp_path / "sweep.parquet"
        sweep(CAMPAIGN, out, scheduler=Scheduler(address, **certificates))
        kernels = tmp_path / "kernels.parquet"
        sweep(KERNELS, kernels, scheduler=Scheduler(address, **certificates))
        with pytest.raises(CampaignError, match="scheduler"), open_workers(1, address):
            pass
    assert out.read_bytes() == one_job.read_bytes()
    here = tmp_path / "here.parquet"
    sweep(KERNELS, here, jobs=2)
    assert kernels.read_bytes() == here.read_bytes()


def test_a_plain_scheduler_warns_and_a_killed_worker_of_it_costs_no_row(tmp_path, one_job):
    out, killed = tmp_path / "sweep.parquet", []
    with scheduler(2) as address:
        with distributed.Client(address, set_as_default=False) as client:
            pids = list(client.run(os.getpid).values())

        def kill_one(done: int, total: int) -> None:
            if 0 < done < total and not killed:
                os.kill(pids[0], signal.SIGKILL)
                killed.append(pids[0])

        with pytest.warns(FullamWarning, match="neither encrypted nor authenticated"):
            sweep(CAMPAIGN, out, scheduler=address, progress=kill_one)
    assert killed
    assert out.read_bytes() == one_job.read_bytes()


def test_a_scheduler_without_workers_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster_module, "CONNECT_TIMEOUT", 0.5)
    with scheduler(0) as address, pytest.warns(FullamWarning) as said:

        class Enough(Exception):  # what stands for Ctrl-C
            pass

        def stop(*_: object) -> None:
            raise Enough

        monkeypatch.setattr(cluster_module.warnings, "warn", raising_after(1, stop))
        with pytest.raises(Enough):
            sweep(CAMPAIGN, tmp_path / "sweep.parquet", scheduler=address)
    assert "neither encrypted" in str(said[0].message)


def raising_after(count: int, stop):
    """warnings.warn for some calls, then a function that ends the waiting."""
    import warnings

    said, warn = [], warnings.warn

    def speak(text, *rest, **options):
        said.append(text)
        if len(said) <= count:
            return warn(text, *rest, **options)
        assert "has had no workers for 0.5 s" in text
        return stop()

    return speak


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setattr(cluster_module, "CONNECT_TIMEOUT", 1.0)
    with (
        pytest.warns(FullamWarning),
        pytest.raises(CampaignError, match="does not answer"),
        open_workers(1, "tcp://127.0.0.1:9"),
    ):
        pass


@pytest.mark.parametrize("jobs", [0, -3, 1.5, True, "2", 10**6])
def test_a_number_of_jobs_that_is_none_is_refused(jobs):
    with pytest.raises(CampaignError, match="jobs"), open_workers(jobs):
        pass


def test_certificates_that_cannot_be_used_are_named(tmp_path):
    for settings, message in (
        ({"address": ""}, "address"),
        ({"address": "tls://a:1", "ca_file": "ca.pem"}, "certificate, key"),
        ({"address": "tcp://a:1", "ca_file": "a", "certificate": "b", "key": "c"}, "tls://"),
        ({"address": "tls://a:1", "ca_file": "a", "certificate": "b", "key": "c"}, "exist"),
    ):
        with pytest.raises(CampaignError, match=message):
            Scheduler(**settings)


def test_the_flights_do_not_depend_on_the_folder_they_run_in(tmp_path, one_job, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert sweep(CAMPAIGN, one_job).rows.equals(read_campaign(one_job).rows)


def test_many_small_parts_become_one(tmp_path, monkeypatch, one_job):
    monkeypatch.setattr("fullam.analysis.campaign_store.FLUSH", 0.0)
    monkeypatch.setattr("fullam.analysis.campaign_store.MOST_PARTS", 8)
    out, most = tmp_path / "sweep.parquet", []
    parts = tmp_path / "sweep.parquet.parts"
    sweep(CAMPAIGN, out, progress=lambda *_: most.append(len(list(parts.glob("*")))))
    assert max(most) <= 8 + 48 // 8
    assert out.read_bytes() == one_job.read_bytes()


def test_workers_may_die_while_they_are_ended():
    """A dictionary that changes while somebody goes through it raises."""
    workers = WorkerProcesses(8)
    buried = threading.Event()

    class Dying:
        def __init__(self, k: int) -> None:
            self.k, self.process = k, self

        def kill(self) -> None:
            if not buried.is_set():  # the others' threads see their processes end now
                buried.set()
                threading.Thread(target=workers._bury, args=(7, None), daemon=True).start()
                time.sleep(0.05)

    workers._workers = {k: Dying(k) for k in range(8)}
    workers.close()
    assert workers._workers == {}
