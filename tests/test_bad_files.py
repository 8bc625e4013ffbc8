"""Files that are wrong on purpose are refused where they are read, at once, with a remedy.

Found by a hostile test of 40 000 files; each of these gave a traceback, a hang, gigabytes, or a
flight that nobody asked for.
"""

import io
import json
import time
import zipfile
from dataclasses import replace

import numpy as np
import pytest

import fullam
from fullam.analysis.agreement import AgreementRow, AgreementTable
from fullam.cli import main
from fullam.exceptions import FullamError, InvalidInput, RunFileError, VehicleError
from fullam.model.loading import load_vehicle
from fullam.simulation.record.run import Run
from fullam.simulation.scenarios.scenario import Scenario, load_scenario

URDF = """<robot name="mini">
  <link name="base">
    <inertial><origin xyz="0 0 0" rpy="0 0 0"/><mass value="1"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
  </link>
  <link name="arm">
    <inertial><origin xyz="0 0 -0.1"/><mass value="0.2"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/>
    <origin xyz="0 0 -0.1"/><axis xyz="0 1 0"/>
    <limit effort="1" velocity="1" lower="-1" upper="1"/></joint>
</robot>
"""
ROTORS = "".join(
    f"[[rotor]]\nposition = [{np.cos(a):.4f}, {np.sin(a):.4f}, 0.0]\n"
    f"axis = [0.0, 0.0, 1.0]\nspin = {1 - 2 * (k % 2)}\n"
    for k, a in enumerate(np.arange(4) * np.pi / 2)
)
TOML = f"""name = "mini"
urdf = "mini.urdf"
platform = "base"
arm = ["shoulder"]
tool = "arm"
gravity = 9.81
[rotor_defaults]
k_f = 1e-5
k_tau = 1e-7
max_speed = 1000.0
lag = 0.02
{ROTORS}"""

SOON = 10.0
"""A file is refused within this [s]; reading a good one takes some milliseconds."""


def refused(call) -> FullamError:
    """The error of a call that has to be refused, and soon."""
    start = time.monotonic()
    with pytest.raises(InvalidInput) as caught:
        call()
    assert time.monotonic() - start < SOON
    assert caught.value.remedy
    assert len(str(caught.value)) < 2000
    return caught.value


VEHICLES = {
    "joint axis of length 0": ("urdf", '<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', "axis"),
    "joint axis of 1e200": ("urdf", '<axis xyz="0 1 0"/>', '<axis xyz="0 0 1e200"/>', "axis"),
    "no gravity": ("toml", "gravity = 9.81", "gravity = 0", "gravity"),
    "gravity upwards": ("toml", "gravity = 9.81", "gravity = -9.81", "gravity"),
    "a speed of 1e300": ("toml", "max_speed = 1000.0", "max_speed = 1e300", "max_speed"),
    "a lag of a year": ("toml", "lag = 0.02", "lag = 3e7", "lag"),
    "a centre of mass at 1e100": ("urdf", 'xyz="0 0 -0.1"/><mass', 'xyz="0 0 1e100"/><mass', "ori"),
    "one at 1e150": ("urdf", 'xyz="0 0 0" rpy', 'xyz="0 0 1e150" rpy', "origin xyz"),
    "a joint at 1e100": ("urdf", 'xyz="0 0 -0.1"/><axis', 'xyz="1e100 0 0"/><axis', "shoulder"),
    "an angle of 1e300": ("urdf", 'rpy="0 0 0"', 'rpy="0 0 1e300"', "rpy"),
    "NaN in the URDF": ("urdf", 'ixx="0.01"', 'ixx="nan"', "NaN"),
    "NaN in the TOML": ("toml", "gravity = 9.81", "gravity = nan", "NaN"),
    "a mass of 1e-300": ("urdf", 'mass value="0.2"', 'mass value="1e-300"', "mass of link 'arm'"),
    "a mass of 1e300": ("urdf", 'mass value="0.2"', 'mass value="1e300"', "mass"),
    "a limit of nothing": ("urdf", 'lower="-1"', 'lower="x"', "limit lower"),
    "an integer of 400 digits": ("toml", "lag = 0.02", f"lag = 1{'0' * 400}", "401 digits"),
    "one of 5000": ("toml", "lag = 0.02", f"lag = 1{'0' * 5000}", "digits"),
    "a deep table": ("toml", "gravity = 9.81", f"gravity = {'[' * 2000}{']' * 2000}", "deep"),
    "NUL in a path": ("toml", '"mini.urdf"', '"mini\\u0000.urdf"', "urdf"),
    "NUL in the file": ("toml", 'name = "mini"', 'name = "mi\0ni"', "TOML"),
    "NUL in the URDF": ("urdf", 'name="mini"', 'name="mi\0ni"', "XML"),
    "a date": ("toml", "gravity = 9.81", "gravity = 1979-05-27", "date"),
    "an escape in the name": ("toml", 'name = "mini"', 'name = "\\u001b[31m"', "control"),
    "entities": (
        "urdf",
        "<robot",
        '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><robot',
        "document type",
    ),
    "a deep URDF": ("urdf", "</robot>", f"{'<a>' * 5000}{'</a>' * 5000}</robot>", "nested"),
    "a megabyte of links": ("urdf", "</robot>", f"{'<link/>' * 20_000}</robot>", "link"),
}


@pytest.mark.parametrize("case", VEHICLES)
def test_a_bad_vehicle(tmp_path, case):
    kind, old, new, says = VEHICLES[case]
    texts = {"toml": TOML, "urdf": URDF}
    assert old in texts[kind]
    texts[kind] = texts[kind].replace(old, new)
    for name, text in texts.items():
        (tmp_path / f"mini.{name}").write_text(text, encoding="utf-8")
    error = refused(lambda: load_vehicle(tmp_path / "mini.toml"))
    assert isinstance(error, VehicleError)
    assert "mini.toml" in error.where
    assert says in str(error)


def test_the_vehicle_itself_is_good(tmp_path):
    (tmp_path / "mini.toml").write_text(TOML, encoding="utf-8")
    (tmp_path / "mini.urdf").write_text(URDF, encoding="utf-8")
    assert load_vehicle(tmp_path / "mini.toml").rotors.count == 4


def test_what_is_no_small_file_is_not_read(tmp_path):
    large = tmp_path / "large.toml"
    with large.open("wb") as file:
        file.truncate(1 << 40)  # a terabyte that takes no room
    assert "at most 16 MiB" in str(refused(lambda: load_vehicle(large)))
    assert "at most 16 MiB" in str(refused(lambda: load_scenario(large)))
    assert "cannot be read" in str(refused(lambda: load_vehicle("/dev/zero/x.toml")))
    (tmp_path / "zero.toml").symlink_to("/dev/zero")
    refused(lambda: load_vehicle(tmp_path / "zero.toml"))
    refused(lambda: load_scenario(tmp_path / "zero.toml"))
    refused(lambda: load_vehicle("a\0b.toml"))


SCENARIOS = {
    "a bound of 1e-6": ("weather = {noise_bound = 1e-6}", "noise_bound"),
    "gusts every 0.2 us": ("weather = {gust_interval = 2e-7, gust_duration = 1e-7}", "gust_interv"),
    "a duration of 1e308": ("duration = 1e308", "duration"),
    "a duration of NaN": ("duration = nan", "duration: is NaN"),
    "a date for a duration": ("duration = 1979-05-27", "duration: is the date"),
    "an integer of 400 digits": (f"duration = 1{'0' * 400}", "401 digits"),
    "one of 5000": (f"duration = 1{'0' * 5000}", "digits"),
    "a deep list": (f"initial_arm_deg = {'[' * 2000}{']' * 2000}", "nested"),
    "a NUL": ('description = "a\\u0000b"', "description"),
    "a text for a table": ('arm_motion = "hold"', "table"),
    "a list for a kind": ("reference = {kind = []}", "kind"),
    "a million waypoints": (
        f"reference = {{kind='waypoints', times=[{'0,' * 200_000}], positions=[], euler_deg=[]}}",
        "times",
    ),
    "no position": ("reference = {kind = 'step'}", "position: is missing"),
    "a boolean": ("duration = true", "duration: is True"),
    "too far": ("initial_position = [0, 0, 1e300]", "initial_position"),
    "a text for names": ("weather = {uncertainty = {parameters = 'k_f'}}", "parameters"),
    "a circle in no time": ("reference={kind='circle', center=[0,0,1], period=1e-300}", "period"),
}


@pytest.mark.parametrize("case", SCENARIOS)
def test_a_bad_scenario(tmp_path, case):
    text, says = SCENARIOS[case]
    path = tmp_path / "x.toml"
    path.write_text(f"name = 'x'\n{text}\n", encoding="utf-8")
    error = refused(lambda: load_scenario(path))
    assert "x.toml" in error.where
    assert says in str(error)


@pytest.fixture(scope="module")
def run():
    return fullam.simulate(Scenario("brief", duration=0.2), calm=True)


def pack(path, arrays, compression=zipfile.ZIP_DEFLATED):
    """A run file with these arrays, and raw entries where the value is bytes."""
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, array in arrays.items():
            data = array
            if not isinstance(array, bytes):
                buffer = io.BytesIO()
                np.lib.format.write_array(buffer, np.asarray(array), allow_pickle=True)
                data = buffer.getvalue()
            archive.writestr(f"{name}.npy", data)
    return path


def contents(run, **metadata):
    """Arrays of the run's file, with some of the metadata changed."""
    text = np.array(json.dumps(run.metadata | metadata))
    return {"metadata": text, **run.columns}


def vehicle_with(run, **changes):
    return {"vehicle": run.metadata["vehicle"] | changes}


def huge(dtype: str, shape: str) -> bytes:
    """An array of which only the header is there."""
    header = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header += b" " * (63 - (10 + len(header)) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header


RUNS = {
    "a column of texts": lambda run: contents(run) | {"u_pid": run.u_pid.astype(str)},
    "complex numbers": lambda run: contents(run) | {"u_pid": run.u_pid.astype(complex)},
    "objects": lambda run: contents(run) | {"u_pid": run.u_pid.astype(object)},
    "single precision": lambda run: contents(run) | {"t": run.t.astype(np.float32)},
    "a number for a column": lambda run: contents(run) | {"t": np.array(1.0)},
    "three dimensions": lambda run: contents(run) | {"pose": run.pose[:, None, :]},
    "an arm of another size": lambda run: contents(run) | {"arm": run.arm[:, :2]},
    "rotors of another vehicle": lambda run: (
        contents(run)
        | {"rotor_speeds": run.rotor_speeds[:, :4], "rotor_commands": run.rotor_commands[:, :4]}
    ),
    "quaternions of length 0": lambda run: contents(run) | {"pose": 0.0 * run.pose},
    "quaternions of length 1e200": lambda run: contents(run) | {"pose": 1e200 * run.pose},
    "NaN in a completed flight": lambda run: contents(run) | {"u_dc": np.nan * run.u_dc},
    "time that stands": lambda run: contents(run) | {"t": 0.0 * run.t},
    "no rows, though completed": lambda run: {
        name: a[:0] if name != "metadata" else a for name, a in contents(run).items()
    },
    "metadata of two texts": lambda run: contents(run) | {"metadata": np.array(["{}", "{}"])},
    "metadata of a number": lambda run: contents(run) | {"metadata": np.array(3.0)},
    "a header of terabytes": lambda run: contents(run) | {"pose": huge("<f8", "(21, 10**12)")},
    "a header that lies": lambda run: contents(run) | {"pose": huge("<f8", "(21, 7)")},
    "a column of 5 GB": lambda run: contents(run) | {"pose": huge("<f8", "(1, 700000000)")},
    "no scenario": lambda run: contents(run, scenario=3),
    "another scenario": lambda run: contents(run, scenario={"name": "x", "duration": -1}),
    "no vehicle": lambda run: contents(run, vehicle={}),
    "a vehicle without bodies": lambda run: contents(run, **vehicle_with(run, bodies=[])),
    "a vehicle without a URDF": lambda run: contents(run, **vehicle_with(run, urdf=5)),
    "no outcome": lambda run: contents(run, outcome="crashed"),
    "a seed of text": lambda run: contents(run, seed="one"),
    "a controller of numbers": lambda run: contents(run, controller=[1, 2]),
    "nested metadata": lambda run: (
        contents(run) | {"metadata": np.array('{"a":' * 3000 + "1" + "}" * 3000)}
    ),
}


@pytest.mark.parametrize("case", RUNS)
def test_a_bad_run_file(tmp_path, run, case):
    path = pack(tmp_path / "run.npz", RUNS[case](run))
    error = refused(lambda: Run.load(path))
    assert isinstance(error, RunFileError)
    assert "run.npz" in error.where


def test_the_run_file_itself_is_good_and_what_does_not_belong_is_not_read(tmp_path, run):
    extra = {"unknown": huge("<f8", "(10**12,)")}
    back = Run.load(pack(tmp_path / "run.npz", contents(run) | extra))
    for name, column in run.columns.items():
        np.testing.assert_array_equal(back.columns[name], column)


def test_a_bomb_is_not_unpacked(tmp_path, run):
    path = tmp_path / "run.npz"
    pack(path, contents(run))
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bomb.npy", b"\0" * (200 << 20))
    start = time.monotonic()
    Run.load(path)
    assert time.monotonic() - start < SOON
    packed = pack(tmp_path / "lzma.npz", contents(run), zipfile.ZIP_LZMA)
    assert "packed" in str(refused(lambda: Run.load(packed)))


def test_a_flight_whose_tables_would_fill_the_memory_is_refused():
    scenario = Scenario("long", duration=9999.0)
    fine = {"plant_period": 1e-5}
    assert "at most" in str(refused(lambda: fullam.simulate(scenario, simulation=fine)))


LINES = [
    ["run", "task-1", "--plant-rate", "1e308"],
    ["run", "task-1", "--control-rate", "1e-300"],
    ["run", "task-1", "--control-rate", "nan"],
    ["run", "task-1", "--seed", "9" * 5000],
    ["run", "task-1", "--seed", "-1"],
    ["run", "task-1", "--set", "position_gains=" + "[" * 3000],
    ["run", "task-1", "--set", "position_gains=" + "9" * 5000],
    ["run", "long.toml", "--plant-rate", "1000000"],
    ["view", "task-1", "--port", "70000"],
    ["view", "task-1", "--offset", "nan"],
    ["view", "task-1", "--speed", "1e300"],
    ["check", "fullam", "--samples", "1000000000000"],
    ["check", "fullam", "--seed", "-5"],
    ["sweep", "task-1", "--out", "a.parquet", "--runs", "1000000000000"],
    ["sweep", "task-1", "--out", "a.parquet", "--runs", "0"],
    ["sweep", "task-1", "--out", "a.parquet", "--jobs", "1000000"],
    ["sweep", "task-1", "--out", "a.parquet", "--scheduler", "nonsense"],
    ["sweep", "task-1", "--out", "a.parquet", "--tls-ca", "a"],
    ["tune", "dc-pid", "--budget", "1e9"],
    ["design", "fullam", "--evaluations", "1e300"],
    ["design", "fullam", "--reserve", "nan"],
    ["design", "fullam", "--seed", "-1"],
    ["design", "fullam", "--pareto", "1,inf"],
    ["datasheet", "fullam", "--flights", "1000000000000"],
    ["datasheet", "fullam", "--seed", "9" * 5000],
    ["run", "task-1", "--governor", "maybe"],
    ["run", "task-1", "--shape", "max_acceleration=1e300"],
    ["equations", "9" * 5000],
    ["run", "a\0b.toml"],
    ["run", "x" * 100_000 + ".toml"],
    ["run", "task-1", "--vehicle", "\udcff.toml"],
]


@pytest.mark.parametrize("line", LINES, ids=lambda line: " ".join(line)[:50].replace("\0", "0"))
def test_a_bad_command_line(line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "long.toml").write_text("name = 'long'\nduration = 9999\n", encoding="utf-8")
    start = time.monotonic()
    assert main(line) == 2
    assert time.monotonic() - start < 2 * SOON
    out, err = capsys.readouterr()
    assert not out
    assert "Traceback" not in err
    assert len(err.splitlines()[-1]) < 1000


NAMES = ["<!--<script>", "</script><b>", "$x_{$", "\\frac", "a&b", '"; alert(1); "', "\u2028"]


@pytest.mark.parametrize("name", NAMES[:6])
def test_a_name_that_is_neither_tex_nor_html(run, name, tmp_path):
    from fullam.viz.figures import compare, overview, save_figure
    from fullam.viz.viewer.page import film_page
    from fullam.viz.viewer.replay import film

    scenario = replace(run.scenario, name=name).to_dict()
    named = Run(run.columns, run.metadata | {"scenario": scenario})
    save_figure(overview(named), tmp_path / "a.png", dpi=30)
    save_figure(compare([named], [name]), tmp_path / "b.png", dpi=30)
    scripts = film_page(film(named)).split("<script>")
    assert json.dumps(name)[1:-1].replace("<", "\\u003c") in scripts[-1]
    assert "<!--" not in scripts[-1]
    assert scripts[-1].count("</script") == 1


def test_a_name_does_not_steer_the_terminal(tmp_path, capsys):
    with pytest.raises(InvalidInput, match="control"):
        Scenario("\x1b[31mred")
    (tmp_path / "\x1b[31m.toml").write_text("name = 3", encoding="utf-8")
    assert main(["run", str(tmp_path / "\x1b[31m.toml")]) == 2
    assert main(["run", "\x1b]0;title\x07\u202e"]) == 2
    assert main(["run", "task-1", "--seed", "\x1b[2J"]) == 2
    out, err = capsys.readouterr()
    assert not any(c in out + err for c in "\x1b\x07\u202e")
    assert "\\x1b[31m" in err


def test_what_is_no_number_is_no_agreement():
    nan, row = float("nan"), AgreementRow("u_dc", 0.0, 0.0, 0.0)
    for bad in (replace(row, recursion_pinocchio=nan), replace(row, recursion_matrix=nan)):
        for rows in ((row, bad), (bad, row)):
            assert AgreementTable("v", 1, 0, 81, 1.0, rows).largest == float("inf")
    assert AgreementTable("v", 1, 0, 81, 1.0, (row,)).largest == 0.0
