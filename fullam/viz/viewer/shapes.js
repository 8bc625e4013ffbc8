// Shapes, arrows, trail and ground, built with the three.js that Meshcat brings.
"use strict";
const Shapes = (() => {
  const THREE = MeshCat.THREE;
  const UP = new THREE.Vector3(0, 1, 0);
  const FADE = 3.0, OLDEST = 0.15;  // of a trail: [s], and what is left of its opacity
  const linear = (css) => new THREE.Color(css).convertSRGBToLinear();

  // Two materials a mesh: a fine one, and one that a slow or software renderer draws quickly.
  function dress(mesh, spec, more = {}) {
    const see_through = (spec.opacity ?? 1) < 1, look = { color: linear(spec.colour),
      transparent: see_through, opacity: spec.opacity ?? 1, depthWrite: !see_through,
      side: spec.type === "mesh" || see_through ? THREE.DoubleSide : THREE.FrontSide,
      flatShading: spec.type === "mesh" };
    if (spec.glow) Object.assign(look, { emissive: linear(spec.colour),
      emissiveIntensity: spec.glow });
    Object.assign(look, more);
    const fine = new THREE.MeshStandardMaterial({ ...look, roughness: 0.5, metalness: 0.0 });
    mesh.userData = { fine, fast: new THREE.MeshLambertMaterial(look) };
    mesh.material = fine;
    return mesh;
  }

  function fineness(scene, fine) {
    scene.traverse((node) => {
      if (node.userData.fine) node.material = fine ? node.userData.fine : node.userData.fast;
    });
  }

  function floats(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }

  function geometry(spec) {
    if (spec.type === "box") return new THREE.BoxGeometry(...spec.size);
    if (spec.type === "sphere") return new THREE.SphereGeometry(spec.radius, 32, 20);
    if (spec.type === "ellipsoid") return new THREE.SphereGeometry(1, 32, 20).scale(...spec.size);
    if (spec.type === "capsule") return capsule(spec);
    if (spec.type === "cylinder" || spec.type === "cone") {
      const top = spec.type === "cone" ? 0 : spec.radius;
      const sides = spec.radius > 0.05 ? 40 : 14;
      return new THREE.CylinderGeometry(top, spec.radius, spec.length, sides).rotateX(Math.PI / 2);
    }
    if (spec.type === "torus") return new THREE.TorusGeometry(spec.radius, spec.tube, 3, 40);
    if (spec.type === "mesh") {
      const mesh = new THREE.BufferGeometry();
      mesh.setAttribute("position", new THREE.BufferAttribute(floats(spec.vertices), 3));
      mesh.setIndex(new THREE.BufferAttribute(new Uint32Array(floats(spec.faces).buffer), 1));
      mesh.computeVertexNormals();
      return mesh;
    }
    throw new Error(`unknown shape ${spec.type}`);
  }

  // A ball whose halves are drawn apart along z; its middle band, below 1 % narrower, is the rest.
  function capsule({ radius, length }) {
    const ball = new THREE.SphereGeometry(radius, radius > 0.05 ? 32 : 14, 21).rotateX(Math.PI / 2);
    const place = ball.attributes.position;
    for (let i = 0; i < place.count; i++) {
      place.setZ(i, place.getZ(i) + 0.5 * length * Math.sign(place.getZ(i)));
    }
    return ball;
  }

  // One geometry of several that stand still against each other: fewer things to draw.
  function merged(specs) {
    const parts = specs.map((spec) => {
      const part = geometry(spec), place = new THREE.Matrix4();
      const [x, y, z, ...q] = spec.pose ?? [0, 0, 0, 0, 0, 0, 1];
      place.compose(new THREE.Vector3(x, y, z), new THREE.Quaternion(...q).normalize(),
        new THREE.Vector3(1, 1, 1));
      return part.applyMatrix4(place);
    });
    const whole = new THREE.BufferGeometry();
    for (const name of ["position", "normal"]) {
      const size = parts.reduce((sum, part) => sum + part.attributes[name].array.length, 0);
      const numbers = new Float32Array(size);
      let at = 0;
      for (const part of parts) {
        numbers.set(part.attributes[name].array, at);
        at += part.attributes[name].array.length;
      }
      whole.setAttribute(name, new THREE.BufferAttribute(numbers, 3));
    }
    const faces = [];
    let first = 0;
    for (const part of parts) {
      for (const vertex of part.index.array) faces.push(first + vertex);
      first += part.attributes.position.count;
      part.dispose();
    }
    whole.setIndex(faces);
    return whole;
  }

  // What shapes may be merged: those of one parent and one look, without children of their own.
  function groups(specs) {
    const parents = new Set(specs.map(({ path }) => path.slice(0, path.lastIndexOf("/"))));
    const found = new Map();
    specs.forEach((spec, k) => {
      const parent = spec.path.slice(0, spec.path.lastIndexOf("/"));
      const alone = parents.has(spec.path) ? k : "";
      const look = [parent, spec.colour, spec.opacity ?? 1, spec.type === "mesh", alone].join();
      found.set(look, [...(found.get(look) ?? []), spec]);
    });
    return [...found.values()];
  }

  function shape(spec, whole = geometry(spec)) {
    const mesh = dress(new THREE.Mesh(whole), spec);
    mesh.castShadow = (spec.opacity ?? 1) > 0.3;
    mesh.receiveShadow = mesh.castShadow;
    return mesh;
  }

  // An arrow along +y with one head (a force) or two (a moment); its vector scales it.
  class Arrow {
    constructor({ radius, colour, heads = 1, through = false }) {
      this.radius = radius;
      this.heads = [];
      const spec = { colour, glow: 0.25 };
      const more = through ? { transparent: true, opacity: 0.92, depthTest: false } : {};
      this.object = new THREE.Group();
      const shaft = new THREE.CylinderGeometry(radius, radius, 1, 16);
      this.shaft = dress(new THREE.Mesh(shaft), spec, more);
      this.object.add(this.shaft);
      for (let i = 0; i < heads; i++) {
        const cone = new THREE.ConeGeometry(2.4 * radius, 1, 20);
        this.heads.push(dress(new THREE.Mesh(cone), spec, more));
        this.object.add(this.heads[i]);
      }
      for (const child of this.object.children) {
        child.castShadow = !through;
        child.renderOrder = through ? 10 : 0;
      }
    }
    length(value) {
      this.object.visible = value > 0.5 * this.radius;
      const head = Math.min(6.5 * this.radius, 0.6 * value / this.heads.length);
      const shaft = Math.max(value - head, 1e-6);
      this.shaft.scale.y = shaft;
      this.shaft.position.y = 0.5 * shaft;
      this.heads.forEach((cone, i) => {
        cone.scale.set(1, head, 1);
        cone.position.y = value - (0.5 + 0.75 * i) * head;
      });
    }
    point(x, y, z, scale) {
      const vector = new THREE.Vector3(x, y, z);
      const size = vector.length();
      if (size > 0) this.object.quaternion.setFromUnitVectors(UP, vector.divideScalar(size));
      this.length(size * scale);
    }
    tint(colour) {
      for (const { userData } of this.object.children)
        for (const material of [userData.fine, userData.fast]) {
          material.color.copy(colour);
          material.emissive.copy(colour);
        }
    }
  }

  // Have a mesh fade with the age of what is drawn: `born` is an attribute of its points, `now` a
  // uniform, both in seconds.
  function fading(mesh, now) {
    for (const material of [mesh.userData.fine, mesh.userData.fast])
      material.onBeforeCompile = (shader) => {
        shader.uniforms.now = now;
        shader.vertexShader = `attribute float born; varying float when;\n${shader.vertexShader}`
          .replace("#include <begin_vertex>", "#include <begin_vertex>\nwhen = born;");
        shader.fragmentShader = `uniform float now; varying float when;\n${shader.fragmentShader}`
          .replace("#include <dithering_fragment>", `#include <dithering_fragment>
            gl_FragColor.a *= ${OLDEST} + ${(1 - OLDEST).toFixed(3)} *
              exp(-max(now - when, 0.0) / ${FADE.toFixed(3)});`);
      };
    return mesh;
  }

  // A thin tube through points that come one by one, and fade.
  class Trail {
    constructor({ radius, colour }) {
      this.sides = 5;
      this.radius = radius;
      this.now = { value: 0 };
      this.object = fading(dress(new THREE.Mesh(new THREE.BufferGeometry()),
        { colour, glow: 0.4, opacity: 0.9 }), this.now);
      this.object.frustumCulled = false;
      this.clear();
    }
    // Forget all points, and have room for so many.
    clear(capacity = 6000) {
      const tube = this.object.geometry;
      this.points = [];
      this.times = [];
      if (capacity !== this.capacity) {
        this.capacity = capacity;
        for (const name of ["position", "normal"])
          tube.setAttribute(name, new THREE.BufferAttribute(
            new Float32Array(3 * this.sides * capacity), 3));
        tube.setAttribute("born", new THREE.BufferAttribute(
          new Float32Array(this.sides * capacity), 1));
        const faces = [];
        for (let k = 0; k < capacity - 1; k++)
          for (let i = 0; i < this.sides; i++) {
            const a = k * this.sides + i, b = k * this.sides + (i + 1) % this.sides;
            faces.push(a, b, a + this.sides, b, b + this.sides, a + this.sides);
          }
        tube.setIndex(faces);
        tube.dispose();  // the renderer's buffers have the old size
      }
      this.show(0);
    }
    show(count) {
      this.now.value = this.times[count - 1] ?? 0;
      this.object.geometry.setDrawRange(0, 6 * this.sides * Math.max(0, count - 1));
    }
    // Time of the last point.
    get ends() { return this.times[this.times.length - 1] ?? -Infinity; }
    // Draw what was drawn by a time, and no more; or forget what came after it.
    until(t) {
      let count = this.points.length;
      while (count > 0 && this.times[count - 1] > t + 1e-4) count--;
      this.show(count);
      return count;
    }
    forget(t) { this.points.length = this.times.length = this.until(t); }
    add(x, y, z, t = 0, least = 0) {
      const point = new THREE.Vector3(x, y, z), last = this.points[this.points.length - 1];
      if (last && least > 0 && last.distanceTo(point) < least) return;
      if (this.points.length === this.capacity) {  // forget the older half
        const from = this.capacity / 2, kept = this.points.slice(from);
        const times = this.times.slice(from);
        this.clear(this.capacity);
        kept.forEach((p, i) => this.add(p.x, p.y, p.z, times[i]));
      }
      this.points.push(point);
      this.times.push(t);
      const k = this.points.length - 1, { position, normal, born } = this.object.geometry.attributes;
      const along = last ? point.clone().sub(last) : new THREE.Vector3(0, 0, 1);
      if (along.lengthSq() < 1e-18) along.set(0, 0, 1);
      const helper = Math.abs(along.z) < 0.8 * along.length() ? [0, 0, 1] : [1, 0, 0];
      const u = new THREE.Vector3(...helper).cross(along).normalize();
      const w = along.normalize().cross(u).normalize();
      for (let i = 0; i < this.sides; i++) {
        const angle = 2 * Math.PI * i / this.sides, n = u.clone().multiplyScalar(Math.cos(angle));
        n.addScaledVector(w, Math.sin(angle));
        const place = point.clone().addScaledVector(n, this.radius), row = k * this.sides + i;
        position.setXYZ(row, place.x, place.y, place.z);
        normal.setXYZ(row, n.x, n.y, n.z);
        born.setX(row, t);
      }
      position.needsUpdate = normal.needsUpdate = born.needsUpdate = true;
      this.show(this.points.length);
    }
  }

  // A grid that fades with the distance, half a metre between fine lines, a metre between bold.
  function ground() {
    const plane = new THREE.PlaneGeometry(60, 60);
    const grid = new THREE.Mesh(plane, new THREE.ShaderMaterial({
      transparent: true, depthWrite: false, extensions: { derivatives: true },
      uniforms: { centre: { value: new THREE.Vector2() }, reach: { value: 4.0 } },
      vertexShader: `varying vec2 place;
        void main() { place = (modelMatrix * vec4(position, 1.0)).xz * vec2(1.0, -1.0);
          gl_Position = projectionMatrix * viewMatrix * modelMatrix * vec4(position, 1.0); }`,
      fragmentShader: `varying vec2 place; uniform vec2 centre; uniform float reach;
        float line(float cell, float wide) { vec2 x = place / cell, d = fwidth(x);
          vec2 g = abs(fract(x - 0.5) - 0.5) / max(d, 1e-6);
          return 1.0 - clamp(min(g.x, g.y) / wide, 0.0, 1.0); }
        void main() { float fade = exp(-pow(length(place - centre) / reach, 2.0));
          float ink = max(0.20 * line(0.5, 1.0), 0.42 * line(1.0, 1.2));
          gl_FragColor = vec4(vec3(0.16, 0.24, 0.33), ink * fade); }`,
    }));
    const shade = new THREE.Mesh(plane, new THREE.ShadowMaterial({ opacity: 0.2 }));
    shade.receiveShadow = true;
    shade.position.z = -0.002;
    const group = new THREE.Group();
    group.add(shade, grid);
    return { group, grid };
  }

  function colours(stops) {
    const list = stops.map(linear), out = new THREE.Color();
    return (share) => {
      const x = Math.min(Math.max(share, 0), 1) * (list.length - 1), k = Math.floor(x);
      return out.copy(list[k]).lerp(list[Math.min(k + 1, list.length - 1)], x - k);
    };
  }

  // The axes of a frame: x red, y green, z blue.
  function triad(size) {
    const axes = new THREE.AxesHelper(size);
    axes.material.depthTest = false;
    axes.renderOrder = 12;
    return axes;
  }

  return { Arrow, Trail, triad, dress, shape, merged, groups, ground, colours, floats, fineness };
})();
