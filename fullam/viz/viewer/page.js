// The page: a Meshcat viewer that shows frames, live from a socket or from a film with a slider.
//
// A scene is JSON (see fullam/viz/viewer/scene.py). A frame is a Float32Array: the time, then the
// values of each track in order; WIDTH says how many each kind has.
"use strict";
const fullam = (() => {
  const THREE = MeshCat.THREE;
  const WIDTH = { pose: 7, thrust: 1, spin: 1, vector: 6, trail: 3, readout: 4 };
  const element = (id) => document.getElementById(id);
  const software = Quality.software();
  const viewer = Quality.viewer(element("meshcat-pane"), software);
  const names = (path) => path.split("/");
  const state = { time: 0, frames: 0, rendered: 0, ready: false, playing: false };
  let scene = null, tracks = [], film = null, ground = null, looked = false, last = null;

  // Lights and background of our own: a sky, a sun that casts shadows, a soft light from behind.
  viewer.renderer.outputEncoding = THREE.sRGBEncoding;
  for (const name of ["SpotLight", "PointLightNegativeX", "PointLightPositiveX", "AmbientLight",
    "FillLight"]) viewer.set_property(["Lights", name], "visible", false);
  viewer.set_property(["Grid"], "visible", false);
  viewer.set_property(["Axes"], "visible", false);
  viewer.set_property(["Background"], "visible", false);
  viewer.hide_background();
  const sky = new THREE.HemisphereLight(0xf4f8ff, 0x8d9aa8, 0.62);
  sky.position.set(0, 0, 1);
  viewer.set_object(["Lights", "Sky"], sky);
  const sun = new THREE.DirectionalLight(0xfff2e0, 0.72);
  sun.castShadow = true;
  sun.shadow.mapSize.set(1024, 1024);
  sun.shadow.bias = -0.0006;
  sun.shadow.normalBias = 0.01;
  sun.shadow.radius = 3;
  viewer.set_object(["Lights", "Sun"], sun);
  viewer.scene_tree.find(["Lights", "Sun"]).object.add(sun.target);
  const fill = new THREE.DirectionalLight(0xdfeaff, 0.25);
  fill.position.set(-3, 4, 2);
  viewer.set_object(["Lights", "Back"], fill);

  const quality = Quality.control(viewer, sun, software);
  const render = viewer.render.bind(viewer);
  viewer.render = () => { place_labels(); render(); state.rendered++; quality.rendered(); };

  // ---- the scene -----------------------------------------------------------------------------
  function load(next) {
    for (const vehicle of scene?.vehicles ?? []) viewer.delete_path([vehicle.path]);
    scene = next;
    tracks = [];
    last = null;
    stop_film();
    ground = ground ?? Shapes.ground();
    viewer.set_object(["ground"], ground.group);
    ground.group.position.set(0, 0, scene.ground);
    const tint = Shapes.colours(scene.colours);
    let at = 1;
    element("labels").replaceChildren();
    element("readouts").replaceChildren();
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
    if (!looked || !scene.keep_camera) look(scene.centre, scene.radius);
    looked = true;
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
    if (track.kind === "readout") return scene.clock === false ? () => {} : readout(vehicle);
    const node = viewer.scene_tree.find(names(track.path)).object;
    if (track.kind === "pose") return (f, i) => move(node, f, i);
    if (track.kind === "spin") return (f, i) => { node.rotation.z = f[i]; };
    if (track.kind === "trail") {
      track.trail = new Shapes.Trail(track);
      viewer.set_object(names(track.path), track.trail.object);
      return (f, i) => { if (!film) track.trail.add(f[i], f[i + 1], f[i + 2], track.least); };
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

  function readout(vehicle) {
    const row = element("readouts").insertRow();
    const name = row.insertCell(), cells = [0, 1, 2].map(() => row.insertCell());
    name.append(Object.assign(document.createElement("span"), { className: "swatch" }));
    name.firstChild.style.background = vehicle.colour;
    name.append(vehicle.label);
    cells[0].className = cells[1].className = "number";
    cells[2].className = "saturated";
    return (f, i) => {
      cells[0].textContent = `${(1000 * f[i]).toFixed(0)} mm`;
      cells[1].textContent = `${(f[i + 1] * 180 / Math.PI).toFixed(1)}\u00b0`;
      cells[2].textContent = f[i + 2] > 0.5 ? "saturated" : "";
      vehicle.height = f[i + 3];
    };
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

  // ---- the camera ----------------------------------------------------------------------------
  const three = (p) => new THREE.Vector3(p[0], p[2], -p[1]);  // Meshcat's scene has y upwards

  function look(centre, radius, direction = scene.direction) {
    const target = three(centre), away = three(direction).normalize();
    viewer.camera.fov = 32;
    viewer.camera.zoom = 1;
    const narrow = Math.min(1, viewer.camera.aspect || 1);
    const distance = radius / Math.sin(0.5 * viewer.camera.fov * Math.PI / 180) / narrow;
    // The camera sits in a node that Meshcat has turned; its own axes are three.js's.
    viewer.camera.position.copy(target).addScaledVector(away, distance);
    viewer.controls.target.copy(target);
    viewer.controls.update();
    light(centre, radius);
    ground.grid.material.uniforms.reach.value = 3.5 * radius + 1.5;
  }

  function light(centre, radius) {
    const reach = radius + 1.2, camera = sun.shadow.camera;
    const place = new THREE.Vector3(...centre);
    sun.position.copy(place).add(new THREE.Vector3(2.0, -1.6, 5.0));
    sun.target.position.copy(place);
    Object.assign(camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.5,
      far: 14 });
    camera.updateProjectionMatrix();
    ground.grid.material.uniforms.centre.value.set(centre[0], centre[1]);
  }

  // Follow the vehicles once they leave the middle of the picture; the view turns with the user.
  function follow() {
    const bodies = tracks.filter((t) => t.kind === "pose" && t.main);
    if (!bodies.length) return;
    const middle = new THREE.Vector3();
    for (const body of bodies) {
      const p = viewer.scene_tree.find(names(body.path)).object.position;
      middle.add(three([p.x, p.y, p.z]));
    }
    middle.divideScalar(bodies.length);
    const gap = middle.sub(viewer.controls.target), far = gap.length() - 0.6 * scene.radius;
    if (far <= 0) return;
    gap.setLength(far);
    viewer.controls.target.add(gap);
    viewer.camera.position.add(gap);
    const t = viewer.controls.target;
    light([t.x, -t.z, t.y], scene.radius);
  }

  function place_labels() {
    if (!scene || scene.vehicles.length < 2) return;
    for (const vehicle of scene.vehicles) {
      const p = viewer.scene_tree.find([vehicle.path, "platform"]).object.position;
      const spot = three([p.x, p.y, p.z + vehicle.radius * 1.5]).project(viewer.camera);
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
    if (scene.clock !== false) element("clock").innerHTML = `<small>t =</small> ${state.time.toFixed(2)}${end}`;
    follow();
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
        track.trail.add(film.data[i], film.data[i + 1], film.data[i + 2]);
      }
    }
    element("slider").max = film.length;
    element("player").hidden = count < 2;
    document.body.classList.toggle("film", count > 1);
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
    const shown = Math.floor(state.time * film.fps) + 1;
    for (const track of tracks) if (track.trail) track.trail.show(shown);
    element("slider").value = state.time;
  }

  function play(on = true) {
    if (!film || film.count < 2) return;
    if (on && state.time >= film.length - 1e-6) seek(0);
    state.playing = on;
    element("toggle").textContent = on ? "Pause" : "Play";
    if (on) requestAnimationFrame((now) => step(now, now));
  }

  function step(before, now) {
    if (!state.playing) return;
    seek(state.time + 1e-3 * (now - before) * Number(element("speed").value));
    if (state.time >= film.length - 1e-6) play(false);
    else requestAnimationFrame((next) => step(now, next));
  }

  element("toggle").onclick = () => play(!state.playing);
  element("slider").oninput = (event) => { play(false); seek(Number(event.target.value)); };
  document.addEventListener("keydown", (event) => {
    if (event.code === "Space" && event.target === document.body) play(!state.playing);
  });

  // ---- live ----------------------------------------------------------------------------------
  function connect() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://` +
      `${location.host}/feed`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) { if (scene && !film) frame(new Float32Array(data)); return; }
      const message = JSON.parse(data);
      if (message.scene) load(message.scene);
      if (message.film) { set_film(message.film); play(); }
      for (const [k, points] of Object.entries(message.trails ?? {}))
        for (const p of points) tracks.filter((t) => t.trail)[k].trail.add(...p);
    };
    socket.onclose = () => {
      if (!film) element("details").textContent = `${scene?.details ?? ""} (server stopped)`;
    };
  }

  return { viewer, state, load, frame, film: set_film, seek, play, look, connect,
    still: quality.still, quality,
    get last() { return last; }, get scene() { return scene; } };
})();
