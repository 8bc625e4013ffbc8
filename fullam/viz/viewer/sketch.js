// A film as lines on a canvas: what a notebook shows where no server of its kernel is at hand.
"use strict";
(() => {
  const canvas = document.getElementById("sketch"), pen = canvas.getContext("2d");
  const slider = document.getElementById("time"), button = document.getElementById("play");
  const bytes = Uint8Array.from(atob(SKETCH.data), (c) => c.charCodeAt(0));
  const steps = new Int16Array(bytes.buffer), { count, width, scale, centre } = SKETCH;
  let yaw = SKETCH.yaw, pitch = SKETCH.pitch, moment = 0, last = null, playing = count > 1;

  // Numbers of a moment, between two frames.
  function row(t) {
    const at = Math.min(Math.max(t * SKETCH.rate, 0), count - 1), k = Math.floor(at), f = at - k;
    const a = k * width, b = Math.min(k + 1, count - 1) * width, out = new Float64Array(width);
    for (let i = 0; i < width; i++) out[i] = steps[a + i] + f * (steps[b + i] - steps[a + i]);
    return out;
  }
  const point = (r, i) => [0, 1, 2].map((k) => centre[k] + r[i + k] * scale);

  function turned(r, i, [x, y, z]) {
    const q = [r[i], r[i + 1], r[i + 2], r[i + 3]];
    const length = Math.hypot(...q) || 1;
    const [a, b, c, w] = q.map((v) => v / length);
    const u = 2 * (b * z - c * y), v = 2 * (c * x - a * z), s = 2 * (a * y - b * x);
    return [x + w * u + b * s - c * v, y + w * v + c * u - a * s, z + w * s + a * v - b * u];
  }

  function project([x, y, z]) {
    const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    const [a, b, c] = [x - centre[0], y - centre[1], z - centre[2]];
    const side = cy * b - sy * a, away = -(cy * a + sy * b), up = c * cp + away * sp;
    const far = 4 * SKETCH.radius, zoom = 0.42 * Math.min(canvas.width, canvas.height);
    const k = zoom * far / (SKETCH.radius * (far + away * cp - c * sp));
    return [canvas.width / 2 + k * side, canvas.height / 2 - k * up];
  }

  function line(points, colour, thick = 1, alpha = 1) {
    pen.beginPath();
    for (const p of points) pen.lineTo(...project(p));
    Object.assign(pen, { strokeStyle: colour, lineWidth: thick * devicePixelRatio,
      globalAlpha: alpha });
    pen.stroke();
  }

  function ground() {
    const r = SKETCH.radius, [x, y] = centre, z = SKETCH.ground;
    for (let k = -4; k <= 4; k++) {
      const d = k * r / 2;
      line([[x - 2 * r, y + d, z], [x + 2 * r, y + d, z]], "#9aa4b0", 1, 0.35);
      line([[x + d, y - 2 * r, z], [x + d, y + 2 * r, z]], "#9aa4b0", 1, 0.35);
    }
  }

  function around(it) {
    for (const edge of it.world) line(edge, "#a9865b", 1.5, 0.7);
    for (const [colour, points] of it.scene) line(points, colour, 1.5, 0.8);
    for (let k = 1; k < it.task.length; k++)
      if (k % 2) line([it.task[k - 1], it.task[k]], "#1f9e89", 2, 0.8);
  }

  function bodies(r, it) {
    for (const { at, lines } of it.bodies) {
      const origin = point(r, at);
      for (const [colour, points] of lines)
        line(points.map((p) => turned(r, at + 3, p).map((v, k) => v + origin[k])), colour, 1.5);
    }
  }

  function touched(r, it) {
    if (it.contact !== null) line([point(r, it.contact), point(r, it.tool)], "#101418", 3);
    const k = Math.min(Math.floor(moment * SKETCH.rate + 1e-6), count - 1) * width;
    for (const i of it.balls) {
      if (steps[k + i] > 32000) continue;  // not carried
      pen.beginPath();
      pen.arc(...project(point(r, i)), 5 * devicePixelRatio, 0, 2 * Math.PI);
      Object.assign(pen, { fillStyle: "#5e3c99", globalAlpha: 1 });
      pen.fill();
    }
  }

  function vehicle(r, it) {
    for (const [at, colour, alpha] of [[it.target, "#1f9e89", 0.5], [it.pose, null, 1]]) {
      if (at === null) continue;
      const origin = point(r, at);
      const place = (p) => turned(r, at + 3, p).map((v, k) => v + origin[k]);
      for (const rotor of it.rotors) {
        const [hub, ...ring] = rotor.ring.map(place);
        line([origin, hub], colour ?? "#3c4148", 2.5, alpha);
        line([...ring, ring[0]], colour ?? rotor.colour, 1.5, alpha);
      }
    }
    const arm = [point(r, it.pose), ...it.joints.map((i) => point(r, i))];
    if (it.tool !== null) {
      const path = [];
      for (let k = 0; k <= Math.min(moment * SKETCH.rate, count - 1); k++) {
        path.push(point(steps, k * width + it.tool));
      }
      arm.push(point(r, it.tool));
      line([...path, arm.at(-1)], it.colour, 1, 0.6);
    }
    line(arm, "#7d838c", 4);
    bodies(r, it);
    touched(r, it);
  }

  function draw() {
    const box = canvas.getBoundingClientRect();
    canvas.width = box.width * devicePixelRatio;
    canvas.height = box.height * devicePixelRatio;
    pen.lineJoin = pen.lineCap = "round";
    ground();
    const r = row(moment);
    for (const it of SKETCH.vehicles) { around(it); vehicle(r, it); }
    slider.value = moment;
    document.getElementById("now").textContent = `${moment.toFixed(2)} s`;
    button.textContent = playing ? "Pause" : "Play";
  }

  function tick(now) {
    if (!document.body.contains(canvas)) return;  // the kernel's page is here instead
    if (playing) {
      moment += last === null ? 0 : (now - last) / 1000;
      if (moment > SKETCH.duration) moment = 0;
      draw();
    }
    last = now;
    requestAnimationFrame(tick);
  }

  slider.max = SKETCH.duration;
  document.getElementById("bar").hidden = count < 2;
  button.onclick = () => { playing = !playing; draw(); };
  slider.oninput = () => { playing = false; moment = Number(slider.value); draw(); };
  canvas.onpointermove = (event) => {
    if (!event.buttons) return;
    yaw -= event.movementX / 150;
    pitch = Math.min(1.5, Math.max(-0.3, pitch + event.movementY / 150));
    draw();
  };
  addEventListener("resize", draw);
  draw();
  requestAnimationFrame(tick);
})();
