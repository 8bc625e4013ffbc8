"""Files and packages of one's own: loaded whole or not at all, flown by every verb, kept apart."""

import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import fullam
from fullam import ownership, plugins
from fullam.cli import main
from fullam.control.controllers import CONTROLLERS
from fullam.exceptions import FullamWarning, KernelError, PluginError, SettingsError, UnknownName
from fullam.ownership import LOADED, owner_of
from fullam.plugins import load_plugin
from fullam.simulation.scenarios.scenario import scenario_names
from fullam.simulation.simulate import fly_by_python

LAW = """import numpy as np
import fullam

GAIN = {gain}

@fullam.register("{name}")
class Law(fullam.Controller):
    "A spring and a damper."

    def reset(self, measurement, reference):
        pass

    def wrench(self, t, measurement, reference):
        u = np.zeros(6)
        u[:3] = GAIN * (reference.pose[:3] - measurement.q[:3])
        u[2] += self.vehicle.mass * self.vehicle.gravity
        return u
"""


@pytest.fixture(autouse=True)
def nothing_stays(tmp_path):
    """Plugins and the modules that they are, as they were before."""
    kept = [dict(names) for names in (LOADED, ownership.OWNERS)]
    modules, path = set(sys.modules), list(sys.path)
    registered = [(registry, dict(registry)) for registry in ownership.REGISTRIES]
    yield
    assert sys.path == path
    for name in set(sys.modules) - modules:  # other people's may have come in, too, and stay
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]
    for names, before in zip((LOADED, ownership.OWNERS), kept, strict=True):
        names.clear()
        names.update(before)
    for registry, before in registered:
        registry.clear()
        registry.update(before)


@pytest.fixture
def law(tmp_path, monkeypatch):
    """A function that writes a plugin, and a folder to work in."""
    monkeypatch.chdir(tmp_path)

    def write(text=LAW, file="own_law.py", name="own-law", gain=20.0):
        path = tmp_path / file
        path.write_text(text.format(name=name, gain=gain) if text is LAW else text, "utf-8")
        return path

    return write


HOP = fullam.Scenario("hop", reference=fullam.Step((0.1, 0.0, 1.2)), duration=0.3)


def test_a_plugin_is_one_module_however_often_it_is_loaded(law):
    path = law()
    module = load_plugin("own_law.py")
    assert load_plugin(path) is module is sys.modules["own_law"]
    assert load_plugin(f"./{path.name}") is module
    assert CONTROLLERS["own-law"] is module.Law
    assert owner_of("controller", "own-law").module is module
    assert owner_of("controller", "dc-pid") is None


def test_a_plugin_that_was_imported_before_is_the_same_module(law, monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(tmp_path)
    law()
    module = __import__("own_law")
    assert load_plugin("own_law.py") is module
    assert CONTROLLERS["own-law"] is module.Law


def test_a_file_that_has_changed_is_loaded_anew(law):
    law()
    first = load_plugin("own_law.py")
    law(gain=5.0)
    second = load_plugin("own_law.py")
    assert (first.GAIN, second.GAIN) == (20.0, 5.0)
    assert CONTROLLERS["own-law"] is second.Law
    law(name="other-name")
    load_plugin("own_law.py")
    assert "own-law" not in CONTROLLERS, "the new text does not register it"


def test_a_file_that_no_longer_loads_leaves_what_was_there(law):
    law()
    first = load_plugin("own_law.py")
    law("import fullam\nraise RuntimeError('half written')\n")
    with pytest.raises(PluginError, match=r"line 2: RuntimeError: half written; mend it there"):
        load_plugin("own_law.py")
    assert CONTROLLERS["own-law"] is first.Law
    assert sys.modules["own_law"] is first


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x = 1\nx.y\n", r"bad\.py, line 2: AttributeError: .*mend it there"),
        ("def f(:\n", r"bad\.py, line 1: SyntaxError"),
        ("import sys\nsys.exit('no')\n", r"line 2: SystemExit: no"),
        ("import nowhere_at_all\n", r"line 1: .*nowhere_at_all.*install 'nowhere_at_all'"),
        ("x = 1\n", r"bad\.py: plugin: registers nothing; .*fullam\.register.*fullam new"),
        (LAW.format(name="pid", gain=1.0), r"line 6: register: controller 'pid' is taken: it bel"),
        ("import fullam\n@fullam.register('a')\nclass A: pass\n", r"line 2: .*no Controller"),
        (
            "import fullam\n@fullam.register('a')\nclass A(fullam.Controller): pass\n",
            r"line 2: .*A does not define reset, wrench",
        ),
    ],
)
def test_what_is_wrong_with_a_plugin_is_said_and_nothing_of_it_stays(law, text, says):
    before = dict(CONTROLLERS), set(sys.modules) | {"sys"}
    law(text, "bad.py")
    with pytest.raises(PluginError, match=says):
        load_plugin("bad.py")
    assert (dict(CONTROLLERS), "bad" in sys.modules) == (before[0], False)


def test_a_name_of_another_plugin_is_not_taken_over(law):
    first = law()
    law(file="second.py")
    load_plugin(first)
    with pytest.raises(
        PluginError, match=rf"second\.py, line 6: .*belongs to {first}; register it"
    ):
        load_plugin("second.py")
    assert owner_of("controller", "own-law").source == str(first)


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("missing.py", "missing.py: plugin: does not exist; .*fullam new controller"),
        (".", "is neither a .py file nor a module"),
        ("x" * 5000, "is no module"),
        ("a\0b.py", "does not exist"),
        ("fullam.control", "comes with fullam"),
        ("./", "is no file"),
        ("/dev/zero", "is no file"),
        ("no_such_module", "is no module that can be imported; install it"),
        ("own_law", "give own_law.py"),
        (3, "is 3; give the path"),
        ("", "is ''; give the path"),
    ],
)
def test_what_is_no_plugin_is_refused(law, source, says, monkeypatch):
    law()
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p not in ("", ".")])
    with pytest.raises(PluginError, match=says):
        load_plugin(source)


def test_a_plugin_may_import_what_stands_beside_it_and_be_called_as_another_module(law, tmp_path):
    (tmp_path / "own_helper_of_law.py").write_text("GAIN = 3.0\n", "utf-8")
    text = LAW.format(name="json-law", gain=1.0) + "\nfrom own_helper_of_law import GAIN\n"
    law(text, "json.py")
    module = load_plugin("json.py")
    assert module.GAIN == 3.0
    assert module.__name__.startswith("json_")
    assert sys.modules.get("json") is not module


def test_a_package_is_loaded_by_its_name(tmp_path, monkeypatch):
    package = tmp_path / "own_laws"
    package.mkdir()
    (package / "__init__.py").write_text("from own_laws import springs\n", "utf-8")
    (package / "springs.py").write_text(LAW.format(name="packed", gain=9.0), "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    module = load_plugin("own_laws")
    assert load_plugin("own_laws") is module
    plugin = owner_of("controller", "packed")
    assert (plugin.name, plugin.text, len(plugin.digest)) == ("own_laws", b"", 16)
    (package / "springs.py").write_text("raise RuntimeError('torn')\n", "utf-8")
    for name in ("own_laws", "own_laws.springs"):
        del sys.modules[name]
        LOADED.pop(name, None)
    with pytest.raises(PluginError, match=r"springs\.py, line 1: RuntimeError: torn"):
        load_plugin("own_laws")


INSTALLED = """[fullam.plugins]
mine = installed_laws
broken = installed_and_broken
"""


def test_installed_plugins_are_loaded_when_a_name_is_unknown(tmp_path, monkeypatch):
    dist = tmp_path / "installed_laws-1.0.dist-info"
    dist.mkdir()
    (dist / "entry_points.txt").write_text(INSTALLED, "utf-8")
    (dist / "METADATA").write_text("Metadata-Version: 2.1\nName: installed_laws\nVersion: 1.0\n")
    (tmp_path / "installed_laws.py").write_text(LAW.format(name="installed", gain=9.0), "utf-8")
    (tmp_path / "installed_and_broken.py").write_text("1 / 0\n", "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(plugins, "_DISCOVERED", [])
    assert CONTROLLERS["dc-pid"].name == "dc-pid"
    assert "installed_laws" not in sys.modules, "nothing is unknown yet"
    with pytest.warns(FullamWarning, match=r"'broken' is left out: .*broken\.py, line 1: ZeroDiv"):
        assert CONTROLLERS["installed"].__module__ == "installed_laws"
    assert owner_of("controller", "installed").installed
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # once a process
        with pytest.raises(UnknownName, match=r"unknown controller 'instaled'.*'installed'"):
            CONTROLLERS["instaled"]


def test_installed_plugins_are_listed_and_importing_fullam_does_not_look_for_them(tmp_path):
    dist = tmp_path / "installed_laws-1.0.dist-info"
    dist.mkdir()
    (dist / "entry_points.txt").write_text("[fullam.plugins]\nmine = installed_laws\n", "utf-8")
    (dist / "METADATA").write_text("Metadata-Version: 2.1\nName: installed_laws\nVersion: 1.0\n")
    (tmp_path / "installed_laws.py").write_text(LAW.format(name="installed", gain=9.0), "utf-8")
    code = """if True:
        import sys, fullam
        from fullam.cli import main
        assert "importlib.metadata" not in sys.modules
        assert "installed_laws" not in sys.modules
        assert "installed" in fullam.controller_names()
        main(["list"])
    """
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}:{Path(fullam.__file__).parents[1]}"}
    said = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert "installed        A spring and a damper [installed_laws]" in said.stdout


def test_scenarios_of_a_plugin_are_known_too(law):
    law("import fullam\nfullam.register_scenario(fullam.Scenario('own-hop', duration=0.2))\n")
    load_plugin("own_law.py")
    assert "own-hop" in scenario_names()
    assert owner_of("scenario", "own-hop").name == "own_law.py"


# Records.


def test_a_record_says_which_plugin_flew_and_flies_again(law, tmp_path):
    law()
    load_plugin("own_law.py")
    digest = owner_of("controller", "own-law").digest
    run = fullam.simulate(HOP, "own-law", calm=True)
    assert run.plugins == [{"name": "own_law.py", "digest": digest, "flew": ["controller own-law"]}]
    assert fullam.simulate(HOP, "pid", calm=True).plugins == []
    path = run.save(tmp_path / "run.npz")
    again = fullam.refly(fullam.Run.load(path))
    np.testing.assert_array_equal(again.pose, run.pose)
    assert again.metadata == run.metadata


def test_a_record_without_its_plugin_says_which_file_to_give(law):
    path = law()
    load_plugin(path)
    run = fullam.simulate(HOP, "own-law", calm=True)
    law(gain=2.0)
    load_plugin(path)
    with pytest.warns(FullamWarning, match=r"own_law\.py is another one than the one that flew"):
        fullam.refly(run)
    plugin = LOADED.pop(str(path))
    ownership.withdraw(plugin)
    with pytest.raises(PluginError, match=r"own_law\.py \(digest .*load_plugin\(\"own_law\.py\"\)"):
        fullam.refly(run)


def test_a_record_whose_estimator_is_not_here_says_which_file_to_give(law, tmp_path):
    assert main(["new", "estimator", "own_filter.py"]) == 0
    path = tmp_path / "own_filter.py"
    load_plugin(path)
    flight = fullam.fly("fullam", "pid", calm=True)
    flight.do("estimator", {"name": "own-filter"})
    flight.advance(0.1)
    fullam.simulate(HOP, "pid", simulation={"estimator": "own-filter"}).save("flown.npz")
    flight.record.save("by_hand.npz")
    assert fullam.Run.load("by_hand.npz").plugins == fullam.Run.load("flown.npz").plugins
    ownership.withdraw(LOADED.pop(str(path)))
    for name in ("flown.npz", "by_hand.npz"):
        with pytest.raises(PluginError, match=rf"{name}: estimator own-filter: flew from the plug"):
            fullam.Run.load(name)


# The command line.


def test_every_verb_takes_plugins():
    from fullam.cli import build_parser
    from fullam.cli.verbs import VERBS

    build_parser()
    assert {"run", "compare", "check", "sweep", "tune", "reproduce", "view", "fly"} <= set(VERBS)
    parser = build_parser()
    (verbs,) = [action for action in parser._actions if action.dest == "verb"]
    for name, verb in verbs.choices.items():
        flags = {flag for action in verb._actions for flag in action.option_strings}
        assert "--plugin" in flags, name


def test_a_plugin_that_fails_ends_a_command_with_its_line(law, capsys):
    law("import fullam\n1 / 0\n")
    assert main(["list", "--plugin", "own_law.py"]) == 2
    said = capsys.readouterr().err
    assert "own_law.py, line 2: ZeroDivisionError: division by zero; mend it there." in said
    assert said.count("\n") == 1


def test_new_writes_a_law_that_run_flies(law, capsys, tmp_path):
    assert main(["new", "controller", "spring_law.py"]) == 0
    assert "fullam run position-1 --plugin spring_law.py" in capsys.readouterr().out
    flags = ["--plugin", "spring_law.py", "--controller", "spring-law", "--calm"]
    assert main(["run", "position-1", *flags, "--out", "run.npz"]) == 0
    run = fullam.Run.load(tmp_path / "run.npz")
    found = fullam.measure(run)
    assert found.settled
    # As the scenario asks for of every law: without overshoot of its own, within two seconds.
    assert found.settling_time_s < 2.0
    assert found.overshoot_percent < 1.0
    assert run.plugins[0]["name"] == "spring_law.py"


def test_new_kernels_fly_what_the_class_flies(law):
    """The same law twice: in numpy on Pinocchio, and as kernels on the recursion."""
    for file, more in (("as_class.py", []), ("as_kernels.py", ["--kernel"])):
        assert main(["new", "controller", file, *more]) == 0
        load_plugin(file)
    far = fullam.Scenario(
        "far", reference=fullam.Step((0.3, 0.2, 4.0), (9.0, 0.0, 5.0)), duration=1
    )
    runs = [
        fullam.simulate(far, name, seed=1, shaping={"max_acceleration": None})
        for name in ("as-class", "as-kernels")
    ]
    assert runs[0].saturated.any(), "both are told what they do not get"
    # Rounding of two engines, fed back over a hundred periods.
    np.testing.assert_allclose(runs[0].pose, runs[1].pose, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("line", "instead", "says"),
    [
        (
            "return Command(wrench, a, compensation), Memory(integral, memory.integral)",
            "pass",
            "None",
        ),
        ("return Command(wrench, a, compensation), Memory", "return Memory", "Memory\\(integral="),
        ("Command(wrench, a, compensation)", "Command(wrench, a, a[0])", "\\(Command\\(wrench="),
        (
            "return Memory(memory.before, memory.before)",
            "return memory.before",
            "Spatial\\(linear=",
        ),
    ],
)
def test_a_kernel_that_answers_something_else_is_told_so(law, line, instead, says):
    assert main(["new", "controller", "answers.py", "--kernel"]) == 0
    text = Path("answers.py").read_text(encoding="utf-8")
    assert line in text
    Path("answers.py").write_text(text.replace(line, instead), encoding="utf-8")
    load_plugin("answers.py")
    far = fullam.Scenario("far", reference=fullam.Step((0.0, 0.0, 4.0)), duration=1)
    with pytest.raises(KernelError, match=f"law 'answers': kernel .*: answers {says}"):
        fullam.simulate(far, "answers", shaping={"max_acceleration": None})


OWN_SETTINGS = """from dataclasses import dataclass
import fullam
from fullam.control.dc_pid import DcPid

@fullam.register("lacking")
class Lacking(DcPid):
    @dataclass(frozen=True)
    class Settings:
        gain: float = 3.0
"""


def test_settings_that_lack_what_the_base_reads_are_refused(law):
    load_plugin(law(OWN_SETTINGS))
    with pytest.raises(SettingsError, match=r"class Lacking: Settings: has no '.*', which"):
        fullam.simulate("task-1", "lacking")


def test_shaping_is_the_scenarios_whatever_class_flies(law):
    """Blended and anticipated: the error along a step falls for a class as for a law of ours."""
    assert main(["new", "controller", "a_class.py"]) == 0
    load_plugin("a_class.py")
    step = fullam.Scenario("step", reference=fullam.Step((0.5, 0.0, 1.0)), duration=1.5)
    simulation = {"estimator": "first-order"}  # which trails
    for name in ("a-class", "dc-pid"):
        errors = []
        for shaping in ({}, {"anticipate": False}, {"anticipate": False, "max_acceleration": None}):
            plan = fullam.prepare(step, name, calm=True, shaping=shaping, simulation=simulation)
            error = fly_by_python(plan).pose[:, 0] - plan.reference.pose[:, 0]
            errors.append(np.abs(error).max())
        blended, late, jumping = errors
        assert blended < 0.2 * late, "its known lags are taken off"
        assert late < 0.3 * jumping, "a jump of half a metre is spread"


def test_new_estimator_flies(law):
    assert main(["new", "estimator", "own_filter.py"]) == 0
    load_plugin("own_filter.py")
    simulation = {"estimator": "own-filter", "delay": 0.01, "pose_period": 0.02}
    run = fullam.simulate("position-1", "dc-pid", simulation=simulation)
    assert run.well
    error = np.abs(run.measured_pose[:, :3] - run.pose[:, :3]).max()
    # Poses with noise, late, every other period: of a vehicle that flies at 2 m/s.
    assert error < 0.06
    assert run.plugins[0]["flew"] == ["estimator own-filter"]


@pytest.mark.parametrize("file", ["memory.py", "command.py", "_2.py", "none.py", "law.py"])
def test_new_finds_names_that_python_and_the_text_do_not_use(law, file):
    assert main(["new", "controller", file, "--kernel"]) == 0
    assert load_plugin(file).__file__.endswith(file)


def test_what_new_writes_passes_the_linter(law):
    kinds = {"a_law.py": ["controller"], "b_law.py": ["controller", "--kernel"]}
    for file, (kind, *more) in (kinds | {"c_filter.py": ["estimator"]}).items():
        assert main(["new", kind, file, *more]) == 0
    ruff = [sys.executable, "-m", "ruff", "check", "--isolated", "--line-length=100"]
    said = subprocess.run(
        [*ruff, "--select=E,F,W,UP,B,NPY,RUF,BLE,PTH,C4,SIM,C90", "."],
        capture_output=True,
        text=True,
    )
    assert said.returncode == 0, said.stdout
    assert max(map(len, Path("a_law.py").read_text("utf-8").splitlines())) <= 100


@pytest.mark.parametrize(
    ("typed", "says"),
    [
        (["controller", "own_law.py"], "own_law.py: file: exists; give another name"),
        (["controller", "dc_pid.py"], "would be the controller 'dc-pid', which there is already"),
        (["estimator", "kalman.py"], "would be the estimator 'kalman'"),
        (["estimator", "own.py", "--kernel"], "--kernel: is given; an estimator is a class"),
        (["controller", "own.txt"], "does not end in .py"),
        (["controller", "my-law.py"], "give a name such as my_law.py"),
        (["controller", "no/such/folder.py"], "No such file"),
    ],
)
def test_new_refuses_what_would_not_do(law, capsys, typed, says):
    text = law().read_text("utf-8")
    assert main(["new", *typed]) == 2
    assert says in capsys.readouterr().err
    assert Path("own_law.py").read_text("utf-8") == text
    assert [p.name for p in Path().iterdir()] == ["own_law.py"]
