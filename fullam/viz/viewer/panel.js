// The controls: player, and what may be switched while it flies.
"use strict";
const Panel = (() => {
  const element = (id) => document.getElementById(id);
  const panel = element("panel"), slider = element("slider"), toggle = element("toggle");
  const fields = {};
  let live = null, held = false, note = null, trim = null;

  function field(name, text, options, change) {
    const label = document.createElement("label"), select = document.createElement("select");
    for (const option of options) select.append(new Option(option));
    select.onchange = () => change(select.value);
    label.append(text, select);
    panel.append(label);
    fields[name] = select;
  }

  function joint({ name, unit, low, high }, i) {
    const label = document.createElement("label"), output = document.createElement("output");
    const range = Object.assign(document.createElement("input"),
      { type: "range", min: low, max: high, step: unit === "m" ? 0.001 : 1 });
    const short = name.length > 14 ? `\u2026${name.slice(-13)}` : name;
    const show = () => {
      output.textContent = `${Number(range.value).toFixed(unit === "m" ? 3 : 0)} ${unit}`;
    };
    range.oninput = () => {
      show();
      const positions = fields.joints.map((j) => Number(j.range.value));
      Hands.act("typed arm", { positions });
    };
    label.append(short, range, output);
    panel.append(label);
    fields.joints[i] = { range, show };
  }

  function rotors(names) {
    const row = document.createElement("div"), known = document.createElement("input");
    row.className = "rotors";
    known.type = "checkbox";
    fields.rotors = names.map((name, i) => {
      const button = Object.assign(document.createElement("button"), { type: "button",
        textContent: name.replace(/^rotor_?/, ""), title: `stop ${name}, or let it work again` });
      button.setAttribute("aria-pressed", "false");
      button.setAttribute("aria-label", `stop ${name}`);
      button.onclick = () => Hands.act("rotor", { index: i, known: known.checked,
        fails: button.getAttribute("aria-pressed") !== "true" });
      row.append(button);
      return button;
    });
    const label = document.createElement("label");
    label.append("tell the allocation", known);
    panel.append("stop a rotor", row, label);
  }

  fullam.on("scene", (scene) => {
    live = scene.live ?? null;
    document.body.classList.toggle("live", Boolean(live));
    element("controls").hidden = element("step").hidden = element("again").hidden = !live;
    panel.replaceChildren();
    if (!live) return;
    element("player").hidden = false;
    slider.max = 0;
    fields.joints = [];
    const act = (kind) => (name) => Hands.act(kind, kind === "weather" ? { weather: name } : { name });
    field("controller", "controller", live.controllers, act("controller"));
    field("compensation", "compensation", live.compensations, act("compensation"));
    field("estimator", "estimator", live.estimators, act("estimator"));
    field("weather", "weather", live.weathers, act("weather"));
    live.joints.forEach(joint);
    rotors(live.rotors);
    const help = document.createElement("small");
    help.textContent = "Drag the vehicle or its arm to pull; drag arrows and rings to move the " +
      "target. Keys: W A S D, Q E move it, I J K L, U O tilt it; space plays, . steps, " +
      "1-5 look, F follows.";
    panel.append(help);
  });

  fullam.on("status", (status) => {
    if (!live) return;
    if (!status) { toggle.textContent = "Play"; return; }
    toggle.textContent = status.playing ? "Pause" : "Play";
    slider.max = status.flown;
    if (!held) slider.value = status.past ?? status.flown;
    element("speed").value = String(status.speed);
    if (document.activeElement !== element("seed")) element("seed").value = status.seed;
    for (const name of ["controller", "estimator", "weather"]) fields[name].value = status[name];
    fields.compensation.parentElement.hidden = status.compensation === null;
    fields.compensation.value = status.compensation ?? "";
    fields.joints.forEach(({ range, show }, i) => {
      if (document.activeElement === range) return;
      range.value = status.arm[i];
      show();
    });
    fields.rotors.forEach((button, i) =>
      button.setAttribute("aria-pressed", String(!status.rotors[i])));
    if (status.trim && status.trim !== trim) say(status.trim);
    trim = status.trim;
    if (status.outcome === "diverged") say(`diverged ${status.reason}; scrub back, or restart`);
  });

  fullam.on("frame", (values) => {
    if (live && !held && !fullam.isFilm && fullam.status?.playing) {
      slider.max = Math.max(slider.max, values[0]);
      slider.value = values[0];
    }
  });

  function say(text) {
    element("note").textContent = text;
    element("note").hidden = false;
    clearTimeout(note);
    note = setTimeout(() => { element("note").hidden = true; }, 6000);
  }
  fullam.on("note", say);

  const order = (what, values = {}) => fullam.send({ do: what, ...values });

  function play() {
    if (live && !fullam.isFilm) order(fullam.status?.playing ? "pause" : "play");
    else fullam.play(!fullam.state.playing);
  }

  toggle.onclick = play;
  element("step").onclick = () => order("step");
  slider.oninput = () => {
    if (live && !fullam.isFilm) { held = true; order("scrub", { time: Number(slider.value) }); }
    else { fullam.play(false); fullam.seek(Number(slider.value)); }
  };
  slider.onchange = () => { held = false; };
  element("speed").onchange = (event) => {
    if (live) order("speed", { value: Number(event.target.value) });
  };
  element("restart").onclick = () => order("restart", { seed: Number(element("seed").value) });

  document.addEventListener("keydown", (event) => {
    const node = event.target;
    if (event.ctrlKey || event.metaKey || node.matches?.("input[type=number], select")) return;
    if (event.code === "Space" && !node.matches?.("button, summary, input[type=checkbox]")) {
      event.preventDefault();
      play();
    }
    if (event.code === "Period" && live) order("step");
  });

  return { say };
})();
