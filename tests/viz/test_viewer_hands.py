"""A real browser has its hands on a flight, and the record of it flies again bit for bit."""

import threading
import time

import numpy as np
import pytest

import fullam
from fullam.simulation.hands.free import plan_of
from fullam.simulation.record.refly import hand_forces
from fullam.viz.viewer.browser import Browser
from fullam.viz.viewer.live import LiveFlight
from fullam.viz.viewer.server import ViewerServer

pytestmark = pytest.mark.browser

SIZE = (900, 560)

SPOT = """(([x, y, z]) => {
  const p = Camera.three([x, y, z]).project(fullam.viewer.camera);
  const box = fullam.viewer.renderer.domElement.getBoundingClientRect();
  return [box.left + box.width * (0.5 + 0.5 * p.x), box.top + box.height * (0.5 - 0.5 * p.y)];
})"""
"""Where on the page a point of the world is."""


class Studio:
    """A live flight in a thread, and a browser in front of it."""

    def __init__(self, browser, server):
        self.browser, self.server = browser, server
        self.live = LiveFlight(plan_of("fullam", duration=60.0))
        self.live.show(server)
        self.thread = threading.Thread(target=self.live.fly, args=(server,), kwargs={"stay": True})
        self.thread.start()
        browser.open(server.url)
        self.until("fullam.status && fullam.state.time > 0.2")

    @property
    def flight(self):
        return self.live.flight

    def see(self, expression):
        return self.browser.evaluate(expression)

    def until(self, condition):
        self.browser.wait_for(condition, 30.0)

    def mouse(self, kind, spot):
        x, y = spot
        self.browser.command(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1
        )

    def drag(self, start, way, steps=6, hold=0.0):
        """Press at a spot, move by pixels, hold, let go."""
        self.mouse("mousePressed", start)
        for i in range(1, steps + 1):
            part = i / steps
            self.mouse("mouseMoved", (start[0] + part * way[0], start[1] + part * way[1]))
        time.sleep(hold)
        self.mouse("mouseReleased", (start[0] + way[0], start[1] + way[1]))

    def key(self, code, hold=0.0):
        self.browser.command("Input.dispatchKeyEvent", type="keyDown", code=code)
        time.sleep(hold)
        self.browser.command("Input.dispatchKeyEvent", type="keyUp", code=code)

    def done(self, kind):
        return [done for done in self.flight.script if done.kind == kind]

    def wait_done(self, kind, count=1):
        until = time.monotonic() + 20.0
        while len(self.done(kind)) < count:
            assert time.monotonic() < until, f"nothing came of '{kind}'"
            time.sleep(0.02)

    def close(self):
        self.live.transport.quit = True
        self.thread.join(20.0)


@pytest.fixture(scope="module")
def browser():
    with Browser(*SIZE, network=False) as opened:
        yield opened


@pytest.fixture
def studio(browser):
    """A test during which the page complains of anything has failed."""
    with ViewerServer(0) as server:
        made = Studio(browser, server)
        yield made
        browser.evaluate("1")
        made.close()
    complaints, browser.complaints = browser.complaints, []
    assert complaints == []


def assert_flies_again(run):
    again = fullam.refly(run)
    for name, column in run.columns.items():
        np.testing.assert_array_equal(column, again.columns[name], err_msg=name)


def test_a_hand_drags_pulls_pauses_steps_scrubs_forks_and_kills(studio):
    # The target's arrow along x is dragged: the target moves along x, and nowhere else.
    tip = "[...Gizmo.pose().slice(0, 3).map((x, i) => x + (i === 0 ? 0.6 : 0) * R)]"
    tip = tip.replace("R", "fullam.scene.vehicles[0].radius")
    start = studio.see(f"{SPOT}({tip})")
    end = studio.see(f"{SPOT}({tip}.map((x, i) => x + (i === 0 ? 0.3 : 0)))")
    studio.drag(start, (end[0] - start[0], end[1] - start[1]))
    studio.wait_done("target")
    time.sleep(0.2)
    np.testing.assert_allclose(studio.flight.target[:3], [0.3, 0.0, 1.5], atol=0.02)
    # The tool is pulled with 3 N for a second.
    studio.see("Hands.act('push', { force: [0, 0, -3], at: 'tool', duration: 1 })")
    studio.wait_done("push")
    # The platform is pulled with the mouse: a spring.
    studio.see("Layers.set('ghost', false)")
    studio.drag(studio.see(f"{SPOT}(fullam.place('bodies'))"), (60, -30), hold=0.3)
    studio.wait_done("release")
    assert {done.values["at"] for done in studio.done("pull")} == {"platform"}
    # A rotor is stopped by its button, and known to be.
    studio.see("document.querySelector('.rotors + label input').click()")
    studio.see("document.querySelectorAll('.rotors button')[4].click()")
    studio.wait_done("rotor")
    assert studio.done("rotor")[0].values == {"index": 4, "fails": True, "known": True}
    studio.until("!fullam.status.rotors[4]")
    # Pause by the space bar, then three single steps.
    studio.key("Space")
    studio.until("!fullam.status.playing")
    stands = studio.flight.period
    for k in range(1, 4):
        studio.key("Period")
        studio.until(f"Math.abs(fullam.state.time - {0.01 * (stands + k)}) < 1e-4")
    assert studio.flight.period == stands + 3
    whole = studio.flight.record
    assert_flies_again(whole)
    pulled = np.linalg.norm(hand_forces(whole)[:, 3:], axis=1)
    assert pulled.max() > 2.9
    # Scrubbing shows the past as it was recorded, and changes nothing.
    k = stands // 2
    studio.see(
        f"(() => {{ const s = document.getElementById('slider'); s.value = {0.01 * k};"
        " s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change')); })()"
    )
    studio.until(f"Math.abs(fullam.state.time - {0.01 * k}) < 1e-4")
    shown = studio.see(
        "fullam.viewer.scene_tree.find(['vehicle_1', 'platform']).object.position.toArray()"
    )
    np.testing.assert_allclose(shown, whole.pose[k, :3], atol=1e-5)
    ends = studio.see("fullam.tracks.find((t) => t.trail).trail.ends")
    assert studio.flight.period == stands + 3 and ends > 0.01 * k
    # Playing from there forgets what came after it.
    studio.see("document.getElementById('toggle').click()")
    studio.until(f"fullam.status.playing && fullam.state.time > {0.01 * k + 0.3}")
    studio.see("document.getElementById('toggle').click()")
    studio.until("!fullam.status.playing")
    fork = studio.flight.record
    np.testing.assert_array_equal(fork.pose[:k], whole.pose[:k])
    assert all(done["period"] < k for done in fork.script["interventions"])
    assert_flies_again(fork)


def test_keys_move_the_target_and_controls_switch_what_flies(studio):
    before = studio.flight.target
    studio.key("KeyE", hold=0.5)
    studio.wait_done("target", 3)
    after = studio.flight.target
    assert after[2] > before[2] + 0.1
    np.testing.assert_allclose(after[:2], before[:2], atol=1e-6)
    for name, value in (("controller", "pid"), ("estimator", "kalman"), ("weather", "paper")):
        studio.see(
            f"(() => {{ const s = [...document.querySelectorAll('#panel label')]"
            f".find((l) => l.textContent.startsWith('{name}')).querySelector('select');"
            f" s.value = '{value}'; s.onchange(); }})()"
        )
        studio.until(f"fullam.status.{name} === '{value}'")
    studio.see(
        "(() => { const r = document.querySelector('#panel input[type=range]');"
        " r.value = -40; r.oninput(); })()"
    )
    studio.until("Math.abs(fullam.status.arm[0] + 40) < 1e-9")
    # What makes no sense is said, and changes nothing.
    count = len(studio.flight.script)
    studio.see("fullam.send({ act: 'push', force: 'much' })")
    studio.until("!document.getElementById('note').hidden")
    assert "force" in studio.see("document.getElementById('note').textContent")
    assert len(studio.flight.script) == count
    studio.see("fullam.send({ do: 'speed', value: 4 })")
    studio.until("fullam.status.speed === 4 && document.getElementById('speed').value === '4'")
    studio.see("document.getElementById('seed').value = 7")
    studio.see("document.getElementById('restart').click()")
    studio.until("fullam.status.seed === 7 && fullam.state.time < 3")
    assert studio.flight.plan.seed == 7 and studio.flight.script == []


def test_numbers_layers_and_views(studio):
    studio.until("Charts.times.length > 10")
    assert studio.see("Charts.rows[5].length") == 1 + 1 + 8 + 2 + 2 + 1
    heads = studio.see("[...document.querySelectorAll('#readouts th')].map((c) => c.textContent)")
    assert heads == ["", "position error", "attitude error"]
    shown = "fullam.viewer.scene_tree.find(['vehicle_1', '{}']).object.visible"
    for layer, node in (("trail", "trail"), ("arrows", "rotor_force"), ("ghost", "target")):
        assert studio.see(shown.format(node))
        studio.see(f"Layers.set('{layer}', false)")
        assert not studio.see(shown.format(node))
    tree = "getComputedStyle(document.querySelector('.dg')).display"
    assert studio.see(tree) == "none", "Meshcat's panel is behind an entry"
    for name, axis in (("top", 2), ("front", 0), ("side", 1)):
        studio.see(f"fullam.camera.view('{name}')")
        away = studio.see(
            "Camera.world(fullam.viewer.camera.position.clone().sub(fullam.viewer.controls.target))"
        )
        assert abs(away[axis]) > 0.98 * np.linalg.norm(away)
    studio.key("KeyF")
    assert studio.see("fullam.camera.follows") is False
    # What cannot be delivered is said with the rotors at their bounds.
    studio.flight.push([0.0, 0.0, -25.0], at="platform", duration=0.6)
    studio.until("document.getElementById('warning').textContent.startsWith('saturated')")


def test_a_page_that_goes_lets_go(studio):
    studio.see("fullam.send({ act: 'pull', hand: [0.2, 0.4, 1.4], at: 'tool' })")
    studio.wait_done("pull")
    studio.browser.command("Page.navigate", url="about:blank")
    studio.wait_done("release")
