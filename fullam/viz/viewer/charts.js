// Strip charts beside the scene: the last ten seconds up to the moment that is shown.
"use strict";
const Charts = (() => {
  const WINDOW = 10, PAUSE = 80, MOST = 36000;  // [s], [ms], rows
  const COLOURS = ["#0072b2", "#d55e00", "#cc79a7", "#009e73", "#e69f00", "#56b4e9", "#7a5195",
    "#4d4d4d", "#8c564b", "#17becf", "#bcbd22", "#ef5675"];
  const box = document.getElementById("strips"), fold = document.getElementById("charts");
  let strips = [], times = [], rows = [], drawn = 0, waiting = false, now = 0;

  // What is drawn: for each strip its lines, and how a line's value is had from a frame.
  function layout(scene) {
    const of = (kind, vehicle) => fullam.tracks.filter(
      (t) => t.kind === kind && t.vehicle === vehicle);
    const first = scene.vehicles[0], [wrench] = of("wrench", first);
    const poses = scene.vehicles.map((v) => ({ at: of("readout", v)[0].at, colour: v.colour }));
    const rotors = of("thrust", first), top = first.rotors.max_speeds;
    const pair = (title, i) => ({ title, own: true, lines: [
      { unit: "N", colour: COLOURS[0], get: (f) => f[wrench.at + i] },
      { unit: "N m", colour: COLOURS[1], get: (f) => f[wrench.at + i + 1] }] });
    const list = [
      { title: "position error", lines: poses.map(({ at, colour }) => (
        { unit: "mm", colour, get: (f) => 1000 * f[at] })) },
      { title: "attitude error", lines: poses.map(({ at, colour }) => (
        { unit: "\u00b0", colour, get: (f) => f[at + 1] * 180 / Math.PI })) },
      { title: "rotor speeds, bound", bound: Math.max(...top), quiet: "rad/s",
        lines: rotors.map((t, i) => ({ unit: "rad/s", colour: COLOURS[i % COLOURS.length],
          get: (f) => Math.sqrt(Math.max(f[t.at], 0)) * top[i] })) },
      pair("u_dc", 0), pair("residual", 2),
    ];
    if (scene.contact)
      list.push({ title: "contact force", lines: [
        { unit: "N", colour: "#101418", get: (f) => f[wrench.at + 5] }] });
    if (scene.live || scene.touched)
      list.push({ title: "hand's pull", lines: [
        { unit: "N", colour: "#c2185b", get: (f) => f[wrench.at + 4] }] });
    return list;
  }

  fullam.on("scene", (scene) => {
    times = [], rows = [], strips = [];
    box.replaceChildren();
    fold.hidden = scene.clock === false;
    if (fold.hidden) return;
    let at = 0;
    for (const strip of layout(scene)) {
      const head = document.createElement("div"), canvas = document.createElement("canvas");
      const title = Object.assign(document.createElement("span"), { textContent: strip.title });
      const value = document.createElement("span");
      head.append(title, value);
      box.append(head, canvas);
      strips.push({ ...strip, canvas, value, at });
      at += strip.lines.length;
    }
  });

  const row = (f) => Float32Array.from(strips.flatMap(({ lines }) => lines.map((l) => l.get(f))));

  fullam.on("film", ({ count, width, fps, data }) => {
    if (!strips.length) return;
    times = Array.from({ length: count }, (_, k) => k / fps);
    rows = times.map((_, k) => row(data.subarray(k * width, (k + 1) * width)));
  });

  fullam.on("frame", (values) => {
    if (!strips.length) return;
    now = values[0];
    if (!fullam.isFilm && now > (times[times.length - 1] ?? -1)) {
      times.push(now);
      rows.push(row(values));
      if (times.length > MOST) times.splice(0, MOST / 2), rows.splice(0, MOST / 2);
    }
    if (!waiting && fold.open) {
      waiting = true;
      setTimeout(() => requestAnimationFrame(draw), Math.max(0, PAUSE - (performance.now() - drawn)));
    }
  });

  fullam.on("forget", (t) => {
    const keep = index(t + 1e-6);
    times.length = rows.length = keep;
  });

  // How many rows are at or before a time.
  function index(t) {
    let low = 0, high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle + 1; else high = middle;
    }
    return low;
  }

  fold.addEventListener("toggle", draw);
  window.addEventListener("resize", draw);

  function draw() {
    waiting = false;
    drawn = performance.now();
    const from = Math.max(0, index(now - WINDOW) - 1), to = index(now + 1e-4);
    for (const strip of strips) paint(strip, from, to);
  }

  function paint({ canvas, value, lines, at, bound, own, quiet }, from, to) {
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    if (!w || to <= from) return;
    if (canvas.width !== Math.round(w * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, w, h);
    pen.fillStyle = "rgba(29, 39, 51, 0.05)";
    pen.fillRect(0, 0, w, h);
    const tops = lines.map((_, i) => {
      let top = bound ? bound * 1.05 : 1e-9;
      for (let k = from; k < to; k++) top = Math.max(top, rows[k][at + i] * 1.08);
      return top;
    });
    const shared = Math.max(...tops);
    const x = (t) => w * (1 - (now - t) / WINDOW);
    if (bound) {
      pen.strokeStyle = "#b34700";
      pen.setLineDash([4, 3]);
      pen.beginPath();
      pen.moveTo(0, h * (1 - bound / shared));
      pen.lineTo(w, h * (1 - bound / shared));
      pen.stroke();
      pen.setLineDash([]);
    }
    pen.lineWidth = lines.length > 3 ? 1 : 1.5;
    lines.forEach((line, i) => {
      const top = own ? tops[i] : shared;
      pen.strokeStyle = line.colour;
      pen.beginPath();
      for (let k = from; k < to; k++) {
        const y = h - 1 - (h - 3) * rows[k][at + i] / top;
        if (k === from) pen.moveTo(x(times[k]), y); else pen.lineTo(x(times[k]), y);
      }
      pen.stroke();
    });
    const last = rows[to - 1];
    value.replaceChildren(...(quiet ? [`${bound.toFixed(0)} ${quiet}`] : lines.map((line, i) => {
      const v = last[at + i], text = `${v.toFixed(v < 10 ? 2 : v < 100 ? 1 : 0)} ${line.unit} `;
      return Object.assign(document.createElement("span"),
        { textContent: text, style: `color: ${line.colour}` });
    })));
  }

  return { get rows() { return rows; }, get times() { return times; }, draw };
})();
