// The page: a Meshcat viewer that shows frames, live from a socket or from a film with a slider.
//
// A scene is JSON (see fullam/viz/viewer/scene.py). A frame is a Float32Array: the time, then the
// values of each track in order; WIDTH says how many each kind has. Other scripts listen by
// `fullam.on(event, f)` to "scene" (scene), "frame" (values), "film" (film), "status" (status),
// "forget" (time) and "live" (whether the server speaks).
"use strict";
const fullam = (() => {
  const THREE = MeshCat.THREE;
  const WIDTH = { pose: 7, thrust: 1, spin: 1, vector: 6, trail: 3, ball: 4, readout: 4, wrench: 6 };
  const element = (id) => document.getElementById(id);
  const software = Quality.software();
  const viewer = Quality.viewer(element("meshcat-pane"), software);
  const names = (path) => path.split("/");
  const state = { time: 0, frames: 0, rendered: 0, ready: false, playing: false, live: false };
  const listeners = {};
  const on = (event, f) => { (listeners[event] ??= []).push(f); };
  const emit = (event, value) => { for (const f of listeners[event] ?? []) f(value); };
  let scene = null, tracks = [], film = null, ground = null, looked = false, last = null;
  let status = null, socket = null;

  const sun = Camera.lights(viewer);
  const camera = Camera.control(viewer, sun, place);
  const quality = Quality.control(viewer, sun, software);
  const render = viewer.render.bind(viewer);
  viewer.render = () => { place_labels(); render(); state.rendered++; quality.rendered(); };

  // ---- the scene -----------------------------------------------------------------------------
  function load(next) {
    for (const vehicle of scene?.vehicles ?? []) viewer.delete_path([vehicle.path]);
    scene = next;
    tracks = [];
    last = null;
    if (!scene.live) status = null;
    stop_film();
    ground = ground ?? Shapes.ground();
    viewer.set_object(["ground"], ground.group);
    ground.group.position.set(0, 0, scene.ground);
    const tint = Shapes.colours(scene.colours);
    let at = 1;
    element("labels").replaceChildren();
    element("readouts").replaceChildren();
    element("warning").textContent = "";
    if (scene.clock !== false) head_readouts();
    for (const vehicle of scene.vehicles) {
      for (const specs of Shapes.groups(vehicle.shapes)) add_shapes(specs);
      vehicle.labelled = Object.assign(document.createElement("div"),
        { textContent: vehicle.label });
      vehicle.labelled.style.color = vehicle.colour;
      if (scene.vehicles.length > 1) element("labels").append(vehicle.labelled);
      for (const track of vehicle.tracks) {
        const entry = { ...track, vehicle, at };
        entry.set = setter(entry, vehicle, tint);
        tracks.push(entry);
        at += WIDTH[track.kind];
      }
    }
    element("title").textContent = scene.title;
    element("details").textContent = scene.details;
    element("clock").textContent = "";
    document.title = `${scene.title} - fullam`;
    draw_legend();
    camera.use(scene, ground);
    if (!looked || !scene.keep_camera) camera.look(scene.centre, scene.radius);
    looked = true;
    emit("scene", scene);
    quality.refresh();
    quality.moved();
    viewer.set_dirty();
  }

  function add_shapes(specs) {
    const path = names(specs[0].path), alone = specs.length === 1;
    viewer.set_object(path, Shapes.shape(specs[0], alone ? undefined : Shapes.merged(specs)));
    if (alone && specs[0].pose) move(viewer.scene_tree.find(path).object, specs[0].pose, 0);
  }

  function move(node, values, at) {
    node.position.set(values[at], values[at + 1], values[at + 2]);
    node.quaternion.set(values[at + 3], values[at + 4], values[at + 5], values[at + 6]);
    node.quaternion.normalize();
  }

  // What a track does with its values: a function of (frame, index of its first value).
  function setter(track, vehicle, tint) {
    if (track.kind === "wrench") return () => {};
    if (track.kind === "readout") return scene.clock === false ? () => {} : readout(vehicle);
    const node = viewer.scene_tree.find(names(track.path)).object;
    if (track.kind === "pose") return (f, i) => move(node, f, i);
    if (track.kind === "ball") return (f, i) => {
      node.position.set(f[i], f[i + 1], f[i + 2]);
      node.visible = f[i + 3] > 0.5;
    };
    if (track.kind === "spin") return (f, i) => { node.rotation.z = f[i]; };
    if (track.kind === "trail") {
      track.trail = new Shapes.Trail(track);
      viewer.set_object(names(track.path), track.trail.object);
      return (f, i) => {
        if (film) return;
        if (track.trail.ends >= f[0]) track.trail.until(f[0]);
        else track.trail.add(f[i], f[i + 1], f[i + 2], f[0], track.least);
      };
    }
    const arrow = new Shapes.Arrow(track);
    viewer.set_object(names(track.path), arrow.object);
    if (track.kind === "thrust") {
      move(node, track.pose, 0);
      arrow.object.rotation.x = Math.PI / 2;
      return (f, i) => { arrow.length(track.length * f[i]); arrow.tint(tint(f[i])); };
    }
    return (f, i) => {
      node.position.set(f[i], f[i + 1], f[i + 2]);
      arrow.point(f[i + 3], f[i + 4], f[i + 5], track.scale);
    };
  }

  function head_readouts() {
    const row = element("readouts").insertRow();
    for (const text of ["", "position error", "attitude error"])
      row.append(Object.assign(document.createElement("th"), { textContent: text, scope: "col" }));
  }

  function readout(vehicle) {
    const row = element("readouts").insertRow();
    const name = row.insertCell(), cells = [0, 1].map(() => row.insertCell());
    name.append(Object.assign(document.createElement("span"), { className: "swatch" }));
    name.firstChild.style.background = vehicle.colour;
    name.append(vehicle.label);
    cells[0].className = cells[1].className = "number";
    return (f, i) => {
      cells[0].textContent = `${(1000 * f[i]).toFixed(0)} mm`;
      cells[1].textContent = `${(f[i + 1] * 180 / Math.PI).toFixed(1)}\u00b0`;
      vehicle.saturated = f[i + 2] > 0.5;
    };
  }

  // Which rotors keep the command from being delivered: those at a bound while it is not.
  function warn(values) {
    const lines = [];
    for (const vehicle of scene.vehicles) {
      if (!vehicle.saturated) continue;
      const shares = tracks.filter((t) => t.vehicle === vehicle && t.kind === "thrust");
      const full = [], idle = [];
      shares.forEach((t, i) => {
        if (values[t.at] > 0.97) full.push(vehicle.rotors.names[i]);
        else if (values[t.at] < 0.003) idle.push(vehicle.rotors.names[i]);
      });
      const said = [full.length ? `${full.join(", ")} at full speed` : "",
        idle.length ? `${idle.join(", ")} at rest` : ""].filter(Boolean).join("; ");
      lines.push(`${scene.vehicles.length > 1 ? `${vehicle.label}: ` : ""}saturated` +
        (said ? `: ${said}` : ""));
    }
    element("warning").textContent = lines.join(" \u00b7 ");
  }

  function draw_legend() {
    const legend = element("legend");
    legend.replaceChildren();
    const bar = document.createElement("span"), ends = document.createElement("span");
    legend.append("thrust of each rotor", bar, ends);
    bar.className = "bar";
    bar.style.background = `linear-gradient(90deg, ${scene.colours.join(", ")})`;
    ends.className = "ends";
    ends.innerHTML = "<span>idle</span><span>saturated</span>";
    for (const [colour, text] of scene.legend) {
      const line = document.createElement("div"), swatch = document.createElement("span");
      swatch.className = "swatch";
      swatch.style.background = colour;
      line.append(swatch, text);
      legend.append(line);
    }
  }

  // Where the middle of the platforms, or the first vehicle's tool, is.
  function place(name) {
    const found = tracks.filter((t) => name === "tool" ? t.kind === "trail" : t.main);
    if (!found.length || !last) return null;
    const some = name === "tool" ? found.slice(0, 1) : found;
    return [0, 1, 2].map((i) => some.reduce((sum, t) => sum + last[t.at + i], 0) / some.length);
  }

  function place_labels() {
    if (!scene || scene.vehicles.length < 2) return;
    for (const vehicle of scene.vehicles) {
      const p = viewer.scene_tree.find([vehicle.path, "platform"]).object.position;
      const spot = Camera.three([p.x, p.y, p.z + vehicle.radius * 1.5]).project(viewer.camera);
      const pane = element("meshcat-pane");
      vehicle.labelled.style.left = `${(0.5 + 0.5 * spot.x) * pane.clientWidth}px`;
      vehicle.labelled.style.top = `${(0.5 - 0.5 * spot.y) * pane.clientHeight}px`;
    }
  }

  // ---- frames --------------------------------------------------------------------------------
  function frame(values) {
    state.time = values[0];
    state.frames++;
    state.ready = true;
    last = values;
    for (const track of tracks) track.set(values, track.at);
    const end = scene.duration ? ` <small>/ ${scene.duration.toFixed(1)} s</small>` : " s";
    if (scene.clock !== false) {
      element("clock").innerHTML = `<small>t =</small> ${state.time.toFixed(2)}${end}`;
      warn(values);
    }
    emit("frame", values);
    camera.moved();
    quality.moved();
    viewer.set_dirty();
  }

  function interpolate(t) {
    if (film.count < 2) return film.data;
    const x = Math.min(Math.max(t * film.fps, 0), film.count - 1);
    const k = Math.min(Math.floor(x), film.count - 2), part = x - k, out = film.buffer;
    const a = k * film.width, b = a + film.width;
    for (let i = 0; i < film.width; i++)
      out[i] = (1 - part) * film.data[a + i] + part * film.data[b + i];
    for (const track of tracks) {
      if (track.kind !== "pose") continue;
      const q = track.at + 3;
      let dot = 0;
      for (let i = q; i < q + 4; i++) dot += film.data[a + i] * film.data[b + i];
      if (dot < 0) for (let i = q; i < q + 4; i++)
        out[i] = (1 - part) * film.data[a + i] - part * film.data[b + i];
    }
    return out;
  }

  // ---- films ---------------------------------------------------------------------------------
  function set_film({ fps, count, width, data, start = 0 }) {
    film = { fps, count, width, data: Shapes.floats(data), buffer: new Float32Array(width) };
    film.length = (count - 1) / fps;
    for (const track of tracks) if (track.trail) {
      track.trail.clear(count);
      for (let k = 0; k < count; k++) {
        const i = k * width + track.at;
        track.trail.add(film.data[i], film.data[i + 1], film.data[i + 2], k / fps);
      }
    }
    element("slider").max = film.length;
    element("player").hidden = count < 2;
    document.body.classList.toggle("film", count > 1);
    emit("film", film);
    seek(start);
  }

  function stop_film() {
    film = null;
    state.playing = false;
    element("player").hidden = true;
    document.body.classList.remove("film");
  }

  function seek(t) {
    if (!film) return;
    frame(interpolate(t));
    state.time = Math.min(Math.max(t, 0), film.length);
    const shown = Math.floor(state.time * film.fps + 1e-6) + 1;
    for (const track of tracks) if (track.trail) track.trail.show(shown);
    element("slider").value = state.time;
  }

  function play(playing = true) {
    if (!film || film.count < 2) return;
    if (playing && state.time >= film.length - 1e-6) seek(0);
    state.playing = playing;
    element("toggle").textContent = playing ? "Pause" : "Play";
    if (playing) requestAnimationFrame((now) => step(now, now));
  }

  function step(before, now) {
    if (!state.playing || !film) return;
    seek(state.time + 1e-3 * (now - before) * Number(element("speed").value));
    if (state.time >= film.length - 1e-6) play(false);
    else requestAnimationFrame((next) => step(now, next));
  }

  // ---- live ----------------------------------------------------------------------------------
  function connect() {
    const address = new URL("feed", location.href);  // relative: behind a proxy it is longer
    address.protocol = address.protocol.replace("http", "ws");
    socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) {
        if (scene && !film) frame(new Float32Array(data));
        return;
      }
      const message = JSON.parse(data);
      if (message.scene) load(message.scene);
      if (message.film) { set_film(message.film); play(); }
      Object.entries(message.trails ?? {}).forEach(([k, points]) => {
        const { trail } = tracks.filter((t) => t.trail)[k];
        for (const p of points) trail.add(...p);
      });
      if ("forget" in message) {
        for (const track of tracks) track.trail?.forget(message.forget);
        emit("forget", message.forget);
      }
      if (message.status) { status = message.status; emit("status", status); }
      if (message.note) emit("note", message.note);
    };
    socket.onopen = () => { state.live = true; };
    socket.onclose = () => {
      state.live = false;
      emit("status", null);
      if (!film) element("details").textContent = `${scene?.details ?? ""} (server stopped)`;
    };
  }

  function send(message) {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  }

  return { viewer, state, load, frame, film: set_film, seek, play, connect, send, on, camera,
    still: quality.still, quality, names, place, look: camera.look,
    get tracks() { return tracks; }, get status() { return status; },
    get last() { return last; }, get scene() { return scene; }, get isFilm() { return !!film; } };
})();
