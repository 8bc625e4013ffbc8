// Views, following, and layers that can be switched on and off.
"use strict";
const Layers = (() => {
  const bar = document.getElementById("views");
  const on = { arrows: true, ghost: true, trail: true, world: true, task: true, frames: false,
    forces: false };
  const LABELS = { arrows: "arrows", ghost: "target", trail: "tool's path", world: "world",
    task: "path asked for", frames: "frames", forces: "attainable forces" };

  const button = (text, title, click) => Object.assign(document.createElement("button"),
    { type: "button", textContent: text, title, onclick: click });

  const views = ["home", "front", "side", "top", "tool"].map((name, i) =>
    button(name, `look: the ${i + 1} key`, () => fullam.camera.view(name)));
  const follows = button("follow", "go along with the vehicle: the F key", () => follow());
  follows.setAttribute("aria-pressed", "true");
  const menu = document.createElement("details"), list = document.createElement("div");
  menu.append(Object.assign(document.createElement("summary"), { textContent: "layers" }), list);
  const boxes = {};

  function entry(text, checked, change) {
    const label = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked });
    box.onchange = () => change(box.checked);
    label.append(box, ` ${text}`);
    list.append(label);
    return box;
  }
  for (const name of Object.keys(on)) boxes[name] = entry(LABELS[name], on[name],
    (value) => set(name, value));
  entry("Meshcat's tree", false, (value) => document.body.classList.toggle("tree", value));
  bar.append(...views, follows, menu);

  function follow(value = !fullam.camera.follows) {
    fullam.camera.follows = value;
    follows.setAttribute("aria-pressed", String(value));
  }

  function set(name, value) {
    on[name] = value;
    boxes[name].checked = value;
    apply();
  }

  const has = (vehicle, part) => vehicle.shapes.some(({ path }) =>
    path.startsWith(`${vehicle.path}/${part}/`));
  const own = (vehicle, part) => has(vehicle, part) ? [`${vehicle.path}/${part}`] : [];

  // A path's node exists only if something was put there.
  function nodes(vehicle, name) {
    const paths = {
      arrows: vehicle.tracks.filter((t) => t.kind === "thrust" || t.kind === "vector")
        .map((t) => t.path),
      ghost: [`${vehicle.path}/target`],
      trail: [`${vehicle.path}/trail`],
      world: own(vehicle, "world"),
      task: own(vehicle, "task"),
      frames: [`${vehicle.path}/platform/frame`, `${vehicle.path}/target/frame`],
      forces: vehicle.shapes.filter((s) => s.path.endsWith("/forces")).map((s) => s.path),
    };
    return paths[name].map((path) => fullam.viewer.scene_tree.find(fullam.names(path)).object);
  }

  function apply() {
    for (const vehicle of fullam.scene.vehicles)
      for (const name of Object.keys(on))
        for (const node of nodes(vehicle, name)) node.visible = on[name];
    fullam.viewer.set_dirty();
  }

  fullam.on("scene", (scene) => {
    for (const vehicle of scene.vehicles) {
      const bodies = ["platform", ...(vehicle.tracks.some((t) => t.path?.endsWith("/target"))
        ? ["target"] : [])];
      for (const body of bodies)
        fullam.viewer.set_object([vehicle.path, body, "frame"],
          Shapes.triad(0.9 * vehicle.radius));
    }
    const bodies = scene.vehicles.some((v) => v.shapes.some((s) => s.path.endsWith("/forces")));
    boxes.forces.parentElement.hidden = !bodies;
    for (const part of ["world", "task"])
      boxes[part].parentElement.hidden = !scene.vehicles.some((v) => has(v, part));
    if (!scene.live && bodies) on.forces = boxes.forces.checked = true;  // it was asked for
    apply();
  });

  document.addEventListener("keydown", (event) => {
    if (event.target.matches?.("input, select, textarea") || event.ctrlKey || event.metaKey) return;
    if (event.code === "KeyF") follow();
    const digit = /^Digit([1-5])$/.exec(event.code);
    if (digit) views[digit[1] - 1].click();
  });

  if (window.innerWidth < 700)  // a telephone shows the scene first
    for (const id of ["charts", "controls"]) document.getElementById(id).open = false;

  return { set, follow, on };
})();
