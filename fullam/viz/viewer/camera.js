// The camera: where it looks from, whether it follows, and what light goes with it.
"use strict";
const Camera = (() => {
  const THREE = MeshCat.THREE;
  const three = (p) => new THREE.Vector3(p[0], p[2], -p[1]);  // Meshcat's scene has y upwards
  const world = (v) => [v.x, -v.z, v.y];
  const VIEWS = { front: [1, 0, 0.12], side: [0, -1, 0.12], top: [-0.01, 0, 1] };

  function lights(viewer) {
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
    return sun;
  }

  // `place(name)` gives where "bodies" (their middle) and the "tool" are, or null.
  function control(viewer, sun, place) {
    let scene = null, ground = null;
    const my = { follows: true };

    function light(centre, radius) {
      const reach = radius + 1.2, camera = sun.shadow.camera;
      const middle = new THREE.Vector3(...centre);
      sun.position.copy(middle).add(new THREE.Vector3(2.0, -1.6, 5.0));
      sun.target.position.copy(middle);
      Object.assign(camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.5,
        far: 14 });
      camera.updateProjectionMatrix();
      ground.grid.material.uniforms.centre.value.set(centre[0], centre[1]);
    }

    my.use = (next, floor) => { scene = next; ground = floor; };

    my.look = (centre, radius, direction = scene.direction) => {
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
      viewer.set_dirty();
    };

    // From the front, the side, the top; at the tool; or as at first.
    my.view = (name) => {
      const bodies = place("bodies") ?? scene.centre, tool = place("tool");
      if (name === "home") my.look(my.follows ? bodies : scene.centre, scene.radius);
      else if (name === "tool" && tool) my.look(tool, 0.22 * scene.radius);
      else if (VIEWS[name]) my.look(bodies, 0.75 * scene.radius, VIEWS[name]);
    };

    // Go along once the vehicles leave the middle of the picture; the view turns with the user.
    my.moved = () => {
      const middle = my.follows && place("bodies");
      if (!middle) return;
      const gap = three(middle).sub(viewer.controls.target);
      const far = gap.length() - 0.6 * scene.radius;
      if (far <= 0) return;
      gap.setLength(far);
      viewer.controls.target.add(gap);
      viewer.camera.position.add(gap);
      light(world(viewer.controls.target), scene.radius);
    };

    // The ray of a pointer, in three.js's axes.
    my.ray = (event) => {
      const box = viewer.renderer.domElement.getBoundingClientRect();
      const spot = new THREE.Vector2(2 * (event.clientX - box.left) / box.width - 1,
        1 - 2 * (event.clientY - box.top) / box.height);
      const caster = new THREE.Raycaster();
      viewer.camera.updateMatrixWorld();
      caster.setFromCamera(spot, viewer.camera);
      return caster;
    };

    // Directions in the horizontal plane as the user sees it: away from the camera, and right.
    my.heading = () => {
      const away = viewer.controls.target.clone().sub(viewer.camera.position);
      const [x, y] = world(away), size = Math.hypot(x, y) || 1;
      return { away: [x / size, y / size], right: [y / size, -x / size] };
    };
    return my;
  }

  return { three, world, lights, control, VIEWS };
})();
