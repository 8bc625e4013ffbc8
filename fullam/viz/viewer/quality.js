// As good a picture as the renderer can keep moving, and a fine one when it stands still.
"use strict";
const Quality = (() => {
  const THREE = MeshCat.THREE;
  const LEVELS = [{ fine: true, ratio: 1 }, { fine: false, ratio: 1 }, { fine: false, ratio: 0.7 },
    { fine: false, ratio: 0.5 }];
  const SLOW = 34, SAMPLE = 12, REST = 500;  // [ms], frames, [ms]

  // Whether WebGL is drawn by the processor.
  function software() {
    const gl = document.createElement("canvas").getContext("webgl");
    const info = gl && gl.getExtension("WEBGL_debug_renderer_info");
    const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
    return /swiftshader|llvmpipe|softpipe|software/i.test(name);
  }

  // Meshcat's viewer; in software its multisampling would halve the frame rate.
  function viewer(pane, plain) {
    if (!plain) return new MeshCat.Viewer(pane);
    const renderer = new THREE.WebGLRenderer({ antialias: false, alpha: true });
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    pane.appendChild(renderer.domElement);
    return new MeshCat.Viewer(pane, true, renderer);
  }

  function control(viewer, sun, plain) {
    let level = plain ? 1 : 0, before = 0, sum = 0, count = 0, timer = null, shown = null;

    function use(fine, ratio) {
      const key = `${fine} ${ratio}`;
      if (key === shown) return;
      shown = key;
      sun.castShadow = fine;
      Shapes.fineness(viewer.scene, fine);
      viewer.renderer.setPixelRatio(ratio * window.devicePixelRatio);
    }

    // Everything as fine as it gets; without multisampling, two pixels for one.
    function still() {
      clearTimeout(timer);
      before = 0;
      use(true, plain ? 2 : 1);
      viewer.render();
    }

    return {
      still,
      get level() { return level; },
      refresh() { shown = null; },
      moved() {
        use(LEVELS[level].fine, LEVELS[level].ratio);
        clearTimeout(timer);
        timer = setTimeout(still, REST);
      },
      rendered() {
        const now = performance.now(), gap = now - before;
        before = now;
        if (gap > 1000) { sum = count = 0; return; }
        sum += gap;
        if (++count < SAMPLE) return;
        if (sum / count > SLOW && level < LEVELS.length - 1) level++;
        sum = count = 0;
      },
    };
  }

  return { software, viewer, control };
})();
