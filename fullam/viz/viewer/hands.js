// Hands on the flight: the mouse pulls the vehicle or drags the target, keys and a gamepad move it.
"use strict";
const Hands = (() => {
  const THREE = MeshCat.THREE;
  const SPEED = 0.8, RATE = 0.9, EVERY = 33;  // [m/s], [rad/s], [ms]
  const pane = document.getElementById("meshcat-pane");
  const held = new Set();
  let pull = null, timer = null, before = 0, goal = null, goal_until = 0;

  const live = () => Boolean(fullam.status);
  const act = (kind, values) => fullam.send({ act: kind, ...values });
  const aim = ([x, y, z, ...attitude]) => act("target", { position: [x, y, z], attitude });

  // At most one message of a kind in a sixtieth of a second; the last one is never lost.
  function sparing(send) {
    let waiting = null, ready = true;
    const go = () => {
      if (waiting === null) { ready = true; return; }
      send(waiting);
      waiting = null;
      ready = false;
      setTimeout(go, 16);
    };
    return (value) => { waiting = value; if (ready) go(); };
  }
  const aim_sparingly = sparing(aim);
  const pull_sparingly = sparing((hand) => { if (pull) act("pull", { hand, at: pull.at }); });

  // ---- the mouse, or a finger ----------------------------------------------------------------
  // Which of the first vehicle's bodies is under the pointer.
  function body_under(caster) {
    const { path } = fullam.scene.vehicles[0];
    const main = fullam.tracks.filter((t) => t.kind === "pose" && t.path.startsWith(`${path}/`) &&
      !t.scene && !t.path.endsWith("/target"));
    let found = null;
    for (const track of main) {
      const root = fullam.viewer.scene_tree.find(fullam.names(track.path)).object;
      for (const hit of caster.intersectObject(root, true)) {
        if (!hit.object.userData.fine || hit.object.material.depthTest === false) continue;
        if (hidden(hit.object)) continue;
        if (!found || hit.distance < found.distance) found = { ...hit, at: track.main
          ? "platform" : "tool" };
        break;
      }
    }
    return found;
  }
  const hidden = (node) => node && (!node.visible || hidden(node.parent));

  function down(event) {
    if (!live() || event.button > 0 || !event.isPrimary || !fullam.last) return;
    const caster = fullam.camera.ray(event);
    if (Gizmo.grab(caster)) { take(event); return; }
    const hit = body_under(caster);
    if (!hit) return;
    const foot = fullam.place(hit.at === "tool" ? "tool" : "bodies");
    const normal = fullam.viewer.camera.getWorldDirection(new THREE.Vector3());
    pull = { at: hit.at, foot, grip: Camera.world(hit.point),
      plane: new THREE.Plane().setFromNormalAndCoplanarPoint(normal, hit.point) };
    take(event);
    pull_sparingly(foot);
  }

  function take(event) {
    fullam.viewer.controls.enabled = false;
    pane.setPointerCapture(event.pointerId);
    event.preventDefault();
    event.stopPropagation();
  }

  function moved(event) {
    if (!pull && !Gizmo.drag) return;
    event.stopPropagation();
    const caster = fullam.camera.ray(event);
    if (Gizmo.drag) {
      const pose = Gizmo.move(caster);
      if (pose) aim_sparingly(pose);
      return;
    }
    const point = caster.ray.intersectPlane(pull.plane, new THREE.Vector3());
    if (!point) return;
    const now = Camera.world(point);
    pull_sparingly(pull.foot.map((x, i) => x + now[i] - pull.grip[i]));
  }

  function up(event) {
    if (!pull && !Gizmo.drag) return;
    event.stopPropagation();
    if (pull) { pull = null; act("release", {}); }
    Gizmo.release();
    fullam.viewer.controls.enabled = true;
  }
  // Before Meshcat's own controls, which listen on the canvas inside.
  pane.addEventListener("pointerdown", down, true);
  pane.addEventListener("pointermove", moved, true);
  pane.addEventListener("pointerup", up, true);
  pane.addEventListener("pointercancel", up, true);
  window.addEventListener("blur", () => { held.clear(); });

  // ---- keys and gamepad ----------------------------------------------------------------------
  const MOVES = { KeyW: [0, 1], KeyS: [0, -1], KeyD: [1, 1], KeyA: [1, -1], KeyE: [2, 1],
    KeyQ: [2, -1], KeyI: [3, 1], KeyK: [3, -1], KeyL: [4, 1], KeyJ: [4, -1], KeyU: [5, 1],
    KeyO: [5, -1] };
  const writes = (node) => node.matches?.("input:not([type=range]):not([type=checkbox]), textarea");

  document.addEventListener("keydown", (event) => {
    if (writes(event.target) || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.code === "Escape" && pull) { pull = null; act("release", {}); }
    if (!live() || !(event.code in MOVES)) return;
    if (event.target.matches?.("select")) event.target.blur();
    event.preventDefault();
    held.add(event.code);
    start();
  });
  document.addEventListener("keyup", (event) => held.delete(event.code));

  const dead = (x) => (Math.abs(x) < 0.15 ? 0 : x);

  // Six shares: away, right, up; and tilts about right, away, up.
  function wanted() {
    const out = [0, 0, 0, 0, 0, 0];
    for (const code of held) { const [i, sign] = MOVES[code]; out[i] += sign; }
    for (const pad of navigator.getGamepads?.() ?? []) {
      if (!pad) continue;
      const [x, y, u, v] = pad.axes.map(dead), b = (i) => pad.buttons[i]?.value ?? 0;
      out[0] -= y ?? 0; out[1] += x ?? 0; out[2] += b(7) - b(6);
      out[3] -= v ?? 0; out[4] += u ?? 0; out[5] += b(4) - b(5);
    }
    return out;
  }

  function start() {
    if (timer === null) { before = performance.now(); timer = setInterval(tick, EVERY); }
  }

  function tick() {
    const now = performance.now(), dt = Math.min(0.1, (now - before) / 1000), w = wanted();
    before = now;
    if (!live() || !w.some(Boolean)) {
      if (!held.size && !gamepads) { clearInterval(timer); timer = null; }
      return;
    }
    // The server's echo is a moment old: go on from what was asked for last.
    const from = goal && now < goal_until ? goal : Gizmo.pose();
    const { away, right } = fullam.camera.heading(), way = SPEED * dt, turn = RATE * dt;
    const p = [0, 1].map((i) => from[i] + way * (w[0] * away[i] + w[1] * right[i]));
    const axis = new THREE.Vector3(-w[3] * right[0] + w[4] * away[0],
      -w[3] * right[1] + w[4] * away[1], w[5]);
    const angle = axis.length() * turn;
    const q = new THREE.Quaternion(...from.slice(3));
    if (angle > 0) q.premultiply(new THREE.Quaternion().setFromAxisAngle(axis.normalize(), angle));
    goal = [...p, from[2] + way * w[2], q.x, q.y, q.z, q.w];
    goal_until = now + 250;
    aim(goal);
  }

  let gamepads = 0;
  window.addEventListener("gamepadconnected", () => { gamepads++; start(); });
  window.addEventListener("gamepaddisconnected", () => { gamepads--; });

  return { act, aim, get pulling() { return Boolean(pull); } };
})();
