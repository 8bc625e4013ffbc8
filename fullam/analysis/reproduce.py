"""Re-flies the paper: the campaigns, the verdicts, the proof and the recorded runs, as data.

`fullam.viz.report` turns the result into a page. Rows are kept in `data/` of the report's folder
under a name that carries a digest of the conditions, so a report that was stopped goes on where it
was, and one with more runs flies only what is new. What was flown under conditions that no longer
hold goes to `data/superseded/`.
"""

from __future__ import annotations

import functools
import shlex
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from fullam.analysis import provenance, recorded
from fullam.analysis.campaign import Campaign, sweep
from fullam.analysis.campaign_table import CampaignTable
from fullam.analysis.claims import (
    CLAIMS,
    QUADROTOR,
    RIVAL,
    SCENARIOS,
    TARGETS,
    Bound,
    Claim,
    Paired,
    Proof,
)
from fullam.analysis.cluster import Scheduler
from fullam.analysis.contender import Contender, with_files
from fullam.analysis.evidence import (
    Finding,
    TiltProof,
    judge,
    prove_no_tilted_hover,
)
from fullam.analysis.journal import open_journal
from fullam.analysis.judged import FASTEST
from fullam.analysis.recorded import Figures, Reading, Task
from fullam.analysis.tuned_gains import contender_name, tuned_names
from fullam.control.settings_file import SettingsFile
from fullam.model.loading import load_vehicle
from fullam.ownership import owner_of
from fullam.simulation.scenarios.catalogue import CONFIGURATIONS, TILT_EULER_DEG
from fullam.simulation.scenarios.scenario import load_scenario
from fullam.simulation.weather import PAPER, Weather

QUICK_RUNS = 8
"""Seeds of a quick look: enough to see that everything works, not to believe every verdict."""

RECORDED_SEEDS = 10
"""Seeds of our side of the comparison with the recorded runs; each of those is one flight."""

Progress = Callable[[str, int, int], None]
"""Called with (what is being done, how much of it is done, how much there is)."""


@dataclass(frozen=True)
class Condition:
    """Weather under which the claims are judged.

    Attributes:
        key: Short name.
        title: Name in the report.
        short: What a sentence calls it.
        weather: The weather.
        option: What selects it in `fullam sweep`.
    """

    key: str
    title: str
    short: str
    weather: Weather
    option: str = ""


CONDITIONS = (
    Condition("paper", "noise, ±10 %, gusts", "with gusts", PAPER),
    Condition(
        "still",
        "noise, ±10 %, no gusts",
        "without gusts",
        replace(PAPER, force_disturbance=0.0, moment_disturbance=0.0),
        " --no-gusts",
    ),
)
"""The gusts are those stated with the group's recorded runs, which show no trace of them; the paper
itself speaks of noise and disturbance of 25 mm and 3 deg. So every claim is judged with and
without."""


TITLES = ("dc-PID", "Backstepping", "dc-PID+ with Kalman filter")
"""Names of the paper's contenders in the report; others go by what was typed."""


@dataclass(frozen=True)
class Entry:
    """A contender of the report.

    Attributes:
        title: Its name there.
        contender: What flies.
        judged: Whether the claims are judged for it; else it is only compared with.
    """

    title: str
    contender: Contender
    judged: bool


def entries(files: Sequence[SettingsFile] = (), own: Sequence[str] = ()) -> tuple[Entry, ...]:
    """dc-PID as in the paper, its rival, dc-PID+ with the Kalman filter; tuned where committed.

    Args:
        files: Settings in the place of those.
        own: More that are judged by the same claims, as in `Contender.parse`.

    Raises:
        CampaignError: Settings of a controller that does not take part.
    """

    def contender(controller: str, estimator: str | None = None) -> Contender:
        tuned = contender_name(controller, estimator) in tuned_names()
        return Contender(controller, "tuned" if tuned else {}, estimator)

    papers = contender("dc-pid"), contender(RIVAL), contender("dc-pid-plus", "kalman")
    named = (*papers, *map(Contender.parse, own))
    subject, rival, plus, *others = with_files(named, files)
    return (
        Entry(TITLES[0], subject, True),
        Entry(TITLES[1], rival, False),
        Entry(TITLES[2], plus, True),
        *(Entry(name, contender, True) for name, contender in zip(own, others, strict=True)),
    )


@dataclass(frozen=True, eq=False)
class RecordedRow:
    """One task of the recorded runs, beside ours.

    Attributes:
        task: The task.
        published: Their figures.
        ours: Reading of their settings -> median figures of ours over seeds.
    """

    task: Task
    published: Figures
    ours: dict[Reading, Figures]


@dataclass(frozen=True, eq=False)
class Reproduction:
    """Everything the report says.

    Attributes:
        runs: Seeds a scenario.
        quick: Whether it is only a quick look.
        command: The command that repeats it.
        entries: The contenders.
        tables: Condition key -> rows of the fully actuated vehicle.
        quadrotor: Condition key -> rows of the quadrotor.
        findings: (claim key, contender label, condition key) -> finding.
        proofs: Tilted hovers of the quadrotor and of ours.
        recorded: The comparison with the recorded runs.
    """

    runs: int
    quick: bool
    command: str
    entries: tuple[Entry, ...]
    tables: dict[str, CampaignTable]
    quadrotor: dict[str, CampaignTable]
    findings: dict[tuple[str, str, str], Finding]
    proofs: tuple[TiltProof, ...]
    recorded: tuple[RecordedRow, ...]

    @property
    def judged(self) -> tuple[Entry, ...]:
        """The contenders for which claims are judged."""
        return tuple(entry for entry in self.entries if entry.judged)


def reproduce(
    folder: str | Path,
    *,
    runs: int = 100,
    quick: bool = False,
    jobs: int = 1,
    scheduler: Scheduler | str | None = None,
    driver: str = FASTEST,
    contenders: tuple[Entry, ...] | None = None,
    progress: Progress | None = None,
) -> Reproduction:
    """Fly and judge everything; keeps rows in `folder`/data.

    Args:
        folder: The report's folder.
        runs: Seeds a scenario, 0 on.
        quick: A look in two minutes: `QUICK_RUNS` seeds.
        jobs: Threads of this process.
        scheduler: A running dask scheduler, or its address.
        driver: Who flies, one of `DRIVERS` or `FASTEST`.
        contenders: Who takes part; `entries()` if None.
        progress: Told what is being done.

    Raises:
        CampaignError: No runs or jobs, or the workers are lost.
        MissingDependency: The extra "campaign" is not installed.
    """
    runs = QUICK_RUNS if quick else runs
    contenders = entries() if contenders is None else contenders
    tell = progress or (lambda text, done, total: None)
    tables: dict[str, CampaignTable] = {}
    quadrotor: dict[str, CampaignTable] = {}
    for condition in CONDITIONS:
        for kept, name, scenarios in (
            (tables, condition.key, SCENARIOS),
            (quadrotor, f"quadrotor-{condition.key}", (QUADROTOR,)),
        ):
            campaign = Campaign(
                tuple(load_scenario(scenario) for scenario in scenarios),
                tuple(entry.contender for entry in contenders),
                tuple(range(runs)),
                condition.weather,
                driver=driver,
                traces=True,
            )
            kept[condition.key] = sweep(
                campaign,
                _data_file(Path(folder) / "data", name, campaign),
                jobs=jobs,
                scheduler=scheduler,
                progress=functools.partial(tell, f"flying {name}"),
            )
    findings = {}
    for claim in (*CLAIMS, *TARGETS):
        for entry in contenders:
            if entry.judged and not isinstance(claim.test, Proof):
                for condition in CONDITIONS:
                    rows = (quadrotor if claim.key == "quadrotor" else tables)[condition.key]
                    key = (claim.key, entry.contender.label, condition.key)
                    findings[key] = judge(claim, rows, entry.contender.label, rivals(contenders))
    return Reproduction(
        runs,
        quick,
        f"fullam reproduce {'--quick' if quick else f'--runs {runs}'}{_typed(contenders)}",
        contenders,
        tables,
        quadrotor,
        findings,
        tuple(
            prove_no_tilted_hover(load_vehicle(name), TILT_EULER_DEG[k], CONFIGURATIONS[k])
            for name in ("quadrotor_arm", "fullam")
            for k in CONFIGURATIONS
        ),
        _compare_recorded(
            Path(folder) / "data" / "recorded.journal", 2 if quick else RECORDED_SEEDS, tell
        ),
    )


def _typed(contenders: tuple[Entry, ...]) -> str:
    """What stands on a command line for files of settings and laws that are not the paper's."""
    own = [entry.title for entry in contenders if entry.title not in TITLES]
    plugins = [owner_of("controller", name.partition("@")[0]) for name in own]
    files = dict.fromkeys(f" --plugin {plugin.name}" for plugin in plugins if plugin is not None)
    named = f" --controllers {','.join(own)}" if own else ""
    return "".join([named, *files, _options(contenders)])


def rivals(contenders: tuple[Entry, ...]) -> dict[str, str]:
    """Controller -> label of the contender that flies it as a rival."""
    return {e.contender.controller: e.contender.label for e in contenders if not e.judged}


def command(claim: Claim, entry: Entry, condition: Condition, runs: int) -> str:
    """The command that flies what a claim is judged by."""
    test = claim.test
    if isinstance(test, Proof):
        return "fullam check quadrotor_arm"
    if isinstance(test, Paired):
        scenarios = dict.fromkeys((*test.more.scenarios, *test.less.scenarios))
        rival = RIVAL in (test.more.contender, test.less.contender)
    else:
        assert isinstance(test, Bound)
        scenarios, rival = dict.fromkeys(test.scenarios), False
    name = contender_name(entry.contender.controller, entry.contender.estimator)
    names = f"{name},{RIVAL}" if rival else name
    tuned = " --tuned" if name in tuned_names() else ""
    owner = owner_of("controller", entry.contender.controller)
    plugin = f" --plugin {owner.name}" if owner else ""
    return (
        f"fullam sweep {','.join(scenarios)} --controllers {names}{tuned}"
        f"{_options((entry,))} --runs {runs}"
        f"{condition.option} --out {claim.key}.parquet{plugin}"
    )


def _options(contenders: tuple[Entry, ...]) -> str:
    """What gives a command the files of settings that these fly with."""
    files = [e.contender.file.path for e in contenders if e.contender.file is not None]
    return "".join(f" --settings {shlex.quote(path)}" for path in files)


def _data_file(folder: Path, name: str, campaign: Campaign) -> Path:
    """Where the rows of these conditions are kept; those of others are put aside."""
    path = folder / f"{name}-{provenance.fingerprint(campaign.identity())}.parquet"
    for suffix in ("", ".parts"):
        for stale in folder.glob(f"{name}-????????????????.parquet{suffix}"):
            if stale.name != path.name + suffix:
                aside = folder / "superseded"
                aside.mkdir(exist_ok=True)
                if not (aside / stale.name).exists():
                    stale.rename(aside / stale.name)
    return path


def _compare_recorded(path: Path, seeds: int, tell: Progress) -> tuple[RecordedRow, ...]:
    """Our side of the comparison; its flights are kept in a journal as they end."""
    rows: list[RecordedRow] = []
    total = len(recorded.TASKS) * len(recorded.READINGS) * seeds
    vehicle = provenance.cached_vehicle(recorded.TASKS[0].scenario.vehicle)
    conditions = {
        "tasks": [repr(task) for task in recorded.TASKS],
        "readings": [repr(reading) for reading in recorded.READINGS],
        "source": provenance.short_digest(Path(recorded.__file__).read_bytes()),
        "vehicle": provenance.vehicle_digest(vehicle),
        "versions": provenance.versions(),
        "code": provenance.code_digest(),
    }
    with open_journal(path, conditions, start_over=True) as journal:
        done = 0

        def fly(task: Task, reading: Reading, seed: int) -> Figures:
            nonlocal done
            tell("flying under the recorded runs' settings", done, total)
            done += 1
            key = [task.name, repr(reading), seed]
            return _figures(journal.once(key, lambda: asdict(recorded.fly(task, reading, seed))))

        for task in recorded.TASKS:
            ours = {
                reading: recorded.compare(task, reading, range(seeds), fly)[0]
                for reading in recorded.READINGS
            }
            rows.append(RecordedRow(task, recorded.PUBLISHED[task.name], ours))
    tell("flying under the recorded runs' settings", total, total)
    return tuple(rows)


def _figures(data: dict[str, list[float] | None]) -> Figures:
    return Figures(**{k: None if v is None else tuple(v) for k, v in data.items()})  # type: ignore[arg-type]
