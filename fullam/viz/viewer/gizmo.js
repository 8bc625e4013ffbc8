// Three arrows and three rings around the target: what is dragged by them is sent to the server.
"use strict";
const Gizmo = (() => {
  const THREE = MeshCat.THREE;
  const COLOURS = ["#d0342c", "#2f8f3e", "#2563c9"];
  const AXES = [new THREE.Vector3(1, 0, 0), new THREE.Vector3(0, 1, 0), new THREE.Vector3(0, 0, 1)];
  const up = new THREE.Vector3(0, 1, 0);
  let group = null, handles = [], drag = null;

  function build(scene) {
    const vehicle = scene.vehicles[0], r = vehicle.radius;
    group = new THREE.Group();
    handles = [];
    AXES.forEach((axis, i) => {
      const arrow = new Shapes.Arrow({ radius: 0.012 * r, colour: COLOURS[i], through: true });
      arrow.object.quaternion.setFromUnitVectors(up, axis);
      arrow.object.position.copy(axis).multiplyScalar(0.3 * r);
      arrow.length(0.75 * r);
      const ring = Shapes.dress(new THREE.Mesh(new THREE.TorusGeometry(0.92 * r, 0.008 * r, 6, 72)),
        { colour: COLOURS[i], glow: 0.3, opacity: 0.45 });
      ring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), axis);
      // A finger needs more to hold on to than the eye needs to see.
      const rod = new THREE.Mesh(new THREE.CylinderGeometry(0.09 * r, 0.09 * r, 0.75 * r, 8));
      rod.position.y = 0.375 * r;
      arrow.object.add(rod);
      const hoop = new THREE.Mesh(new THREE.TorusGeometry(0.92 * r, 0.05 * r, 6, 48));
      ring.add(hoop);
      for (const wide of [rod, hoop]) wide.material.visible = false;
      group.add(arrow.object, ring);
      handles.push({ mesh: rod, axis: i, turns: false }, { mesh: hoop, axis: i, turns: true });
    });
    fullam.viewer.set_object([vehicle.path, "handles"], group);
  }

  const target = () => fullam.tracks.find((t) => t.path?.endsWith("/target"));

  // The pose of the target, as [p, quaternion xyzw] in the scene's axes (z upwards).
  function pose() {
    const at = target().at;
    return Array.from(fullam.last.slice(at, at + 7));
  }

  fullam.on("scene", (scene) => {
    group = null;
    drag = null;
    if (scene.live && target()) build(scene);
  });

  fullam.on("frame", () => {
    if (!group || drag?.turns) return;
    const [x, y, z] = drag?.pose ?? pose();
    group.position.set(x, y, z);
    group.visible = Layers.on.ghost;
  });

  // Where a ray meets a plane, in the scene's axes; null where it does not.
  function on_plane(ray, point, normal) {
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(
      Camera.three(normal.toArray()), Camera.three(point.toArray()));
    const hit = ray.intersectPlane(plane, new THREE.Vector3());
    return hit && new THREE.Vector3(...Camera.world(hit));
  }

  // How far along an axis through a point the ray passes closest to it.
  function along(ray, point, axis) {
    const d = new THREE.Vector3(...Camera.world(ray.direction));
    const o = new THREE.Vector3(...Camera.world(ray.origin)).sub(point);
    const b = d.dot(axis), k = 1 - b * b;
    return k < 1e-4 ? 0 : (o.dot(axis) - b * o.dot(d)) / k;
  }

  function spin(ray) {
    const hit = on_plane(ray, drag.centre, drag.axis);
    if (!hit) return null;
    const arm = hit.sub(drag.centre);
    return Math.atan2(arm.dot(drag.second), arm.dot(drag.first));
  }

  // Take hold of what is under the pointer; whether there was something.
  function grab(caster) {
    if (!group || !group.visible) return false;
    const hits = caster.intersectObjects(handles.map(({ mesh }) => mesh), false);
    if (!hits.length) return false;
    const handle = handles.find(({ mesh }) => mesh === hits[0].object);
    const now = pose(), centre = new THREE.Vector3(...now), axis = AXES[handle.axis].clone();
    drag = { ...handle, pose: now, start: now.slice(), centre, axis,
      first: AXES[(handle.axis + 1) % 3], second: AXES[(handle.axis + 2) % 3] };
    drag.from = drag.turns ? spin(caster.ray) : along(caster.ray, centre, axis);
    return true;
  }

  function move(caster) {
    if (drag.turns) {
      const angle = spin(caster.ray);
      if (angle === null) return;
      const turn = new THREE.Quaternion().setFromAxisAngle(drag.axis, angle - drag.from);
      const q = turn.multiply(new THREE.Quaternion(...drag.start.slice(3)));
      drag.pose = [...drag.start.slice(0, 3), q.x, q.y, q.z, q.w];
    } else {
      const way = along(caster.ray, drag.centre, drag.axis) - drag.from;
      const p = drag.centre.clone().addScaledVector(drag.axis, way);
      drag.pose = [p.x, p.y, p.z, ...drag.start.slice(3)];
    }
    return drag.pose;
  }

  return { grab, move, pose, release() { drag = null; }, get drag() { return drag; } };
})();
