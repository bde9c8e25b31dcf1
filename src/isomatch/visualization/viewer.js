// Surfaces in 3D, each in a pane of one canvas: dragging rotates all of them, wheel or two fingers zoom.
"use strict";
const unpack = (() => { // arrays from base 64
  const KINDS = { index: Uint32Array, faces: Uint16Array, images: Int32Array, vertices: Float32Array, points: Float32Array,
    normals: Int8Array, colours: Uint8Array, levels: Uint8Array };
  return (item) => Object.fromEntries(Object.entries(item).map(([key, value]) => [key,
    key in KINDS ? new KINDS[key](Uint8Array.from(atob(value), (c) => c.charCodeAt(0)).buffer) : value]));
})();
const svg = (name, attributes, ...inner) => {
  const made = document.createElementNS(document.querySelector("#stage svg").namespaceURI, name);
  Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value)); made.append(...inner); return made;
};
const CLAY = [200, 200, 196];
const rampColour = (ramp, share) => { // of a share from 0 to 1
  const at = Math.max(0, Math.min(share, 1)) * (ramp.length - 1), k = Math.min(Math.floor(at), ramp.length - 2);
  return ramp[k].map((low, c) => low + (ramp[k + 1][c] - low) * (at - k));
};
const paintRamp = (ramp) => {
  document.getElementById("ramp").style.background = `linear-gradient(90deg, ${ramp.map((stop) => `rgb(${stop})`)})`;
};
const plain = (shape) => new Uint8Array(shape.normals.length).map((_, k) => CLAY[k % 3]);
// null without WebGL 2; turn has the rows right, up, towards the viewer, panes are [left, top, width, height] in CSS pixels
const viewer = (shapes, { rotation = (pane, turn) => turn, squares = () => 0, lines = () => false, drawn = () => {},
  grabbed = () => null, pulled = () => {}, hovered = () => {}, tapped = () => {}, left = () => {} } = {}) => {
  const canvas = document.getElementById("view"), stage = document.getElementById("stage");
  const names = stage.querySelectorAll(".name"), gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) { document.getElementById("status").textContent += " This browser has no WebGL 2, so there is no 3D view."; return null; }
  const program = gl.createProgram();
  for (const [kind, id] of [[gl.VERTEX_SHADER, "vertex"], [gl.FRAGMENT_SHADER, "fragment"]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, document.getElementById(id).textContent.trim()); gl.compileShader(shader); gl.attachShader(program, shader);
  }
  gl.linkProgram(program); if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null; // the still picture remains
  gl.useProgram(program); gl.clearColor(0, 0, 0, 0);
  [gl.DEPTH_TEST, gl.SCISSOR_TEST, gl.BLEND].forEach((switched) => gl.enable(switched));
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  const [uTurn, uCentre, uSize, uSquares, uLine] = ["turn", "centre", "size", "squares", "line"].map(
    (name) => gl.getUniformLocation(program, name));
  const filled = (kind, held, data) => { gl.bindBuffer(kind, held); gl.bufferData(kind, data, gl.STATIC_DRAW); return held; };
  const edges = (faces) => { // each edge once
    const seen = new Set();
    for (let k = 0; k < faces.length; k++) {
      const a = faces[k], b = faces[k % 3 === 2 ? k - 2 : k + 1]; seen.add(Math.min(a, b) * 65536 + Math.max(a, b));
    }
    return Uint16Array.from([...seen].flatMap((edge) => [Math.floor(edge / 65536), edge % 65536]));
  };
  const surfaces = shapes.map((shape) => { // values of vertices can be replaced
    const array = gl.createVertexArray(); gl.bindVertexArray(array);
    const attribute = (name, kind, values) => {
      const at = gl.getAttribLocation(program, name), held = filled(gl.ARRAY_BUFFER, gl.createBuffer(), values);
      gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, 3, kind, true, 0, 0); return held;
    };
    return { array, position: attribute("position", gl.FLOAT, shape.vertices), normal: attribute("normal", gl.BYTE, shape.normals),
      colour: attribute("colour", gl.UNSIGNED_BYTE, plain(shape)), place: attribute("place", gl.FLOAT, shape.vertices),
      n: shape.faces.length, faces: filled(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer(), shape.faces) };
  });
  const put = (pane, name, data) => { filled(gl.ARRAY_BUFFER, surfaces[pane][name], data); redraw(); };

  let turn, zoom, pan, panes, scale, queued = false;
  const reset = () => { turn = [1, 0, 0, 0, 1, 0, 0, 0, 1]; zoom = 1; pan = [0, 0]; redraw(); };
  const seen = (r, v, i) => [0, 3, 6].map((k) => r[k] * v[3 * i] + r[k + 1] * v[3 * i + 1] + r[k + 2] * v[3 * i + 2]);
  const rotate = (row, other, angle) => { // points in the direction of row ``other`` move towards ``row``
    const c = Math.cos(angle), s = Math.sin(angle);
    for (let k = 0, [i, j] = [3 * row, 3 * other]; k < 3; k++, i++, j++) {
      [turn[i], turn[j]] = [c * turn[i] + s * turn[j], c * turn[j] - s * turn[i]];
    }
    redraw();
  };
  const face = (pane, normals, k) => { // a point to the viewer
    const [x, y, z] = seen(rotation(pane, turn), normals, k);
    rotate(2, 0, Math.atan2(x, z)); rotate(2, 1, Math.atan2(y, Math.hypot(x, z)));
  };
  const middle = (pane) => [0, 1].map((k) => panes[pane][k] + panes[pane][k + 2] / 2);
  const screen = (pane, p) => middle(pane).map((m, k) => m + pan[k] + (k ? -1 : 1) * scale * zoom * p[k]);
  const inside = (pane, at) => at.every((x, k) => x >= panes[pane][k] && x <= panes[pane][k] + panes[pane][k + 2]);
  const paneAt = (e) => Math.max(panes.findIndex((_, pane) => inside(pane, [e.offsetX, e.offsetY])), 0);
  const layout = () => {
    const w = canvas.clientWidth, h = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    [["width", w], ["height", h]].forEach(([side, length]) => { // setting a size is slow even if it stays the same
      if (canvas[side] !== Math.round(length * ratio)) canvas[side] = Math.round(length * ratio);
    });
    const [across, up] = w < h ? [w, h / shapes.length] : [w / shapes.length, h];
    panes = shapes.map((_, k) => (w < h ? [0, k * up, across, up] : [k * across, 0, across, up]));
    scale = Math.min(...shapes.map(({ extent }) => Math.min(0.88 * across / extent[0], (up - Math.min(72, 0.3 * up)) / extent[1])));
    names.forEach((name, k) => Object.assign(name.style, { left: middle(k)[0] + "px", top: panes[k][1] + up - 28 + "px" }));
    return [w, h, ratio];
  };
  const draw = () => {
    queued = false; if (!canvas.clientWidth) return; // hidden
    const [w, h, ratio] = layout();
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.uniform2f(uSize, 2 * scale * zoom / w, 2 * scale * zoom / h); gl.uniform1f(uSquares, squares());
    surfaces.forEach((surface, k) => {
      const [x, y] = screen(k, [0, 0]), [left, top, width, height] = panes[k].map((side) => Math.round(side * ratio));
      gl.scissor(left, canvas.height - top - height, width, height);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.uniformMatrix3fv(uTurn, true, rotation(k, turn)); gl.uniform2f(uCentre, 2 * x / w - 1, 1 - 2 * y / h);
      gl.bindVertexArray(surface.array);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, surface.faces); gl.drawElements(gl.TRIANGLES, surface.n, gl.UNSIGNED_SHORT, 0);
      if (!lines()) return;
      if (!surface.edges) {
        const ends = edges(shapes[k].faces);
        surface.nEnds = ends.length; surface.edges = filled(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer(), ends);
      }
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, surface.edges); gl.uniform1f(uLine, 0.35);
      gl.drawElements(gl.LINES, surface.nEnds, gl.UNSIGNED_SHORT, 0); gl.uniform1f(uLine, 0);
    });
    drawn();
  };
  const redraw = () => { if (!queued) { queued = true; requestAnimationFrame(draw); } };
  const spot = (pane, points, normals, k) => { // where a point is drawn, its height, and how it faces the viewer
    const r = rotation(pane, turn), p = seen(r, points, k);
    return { at: screen(pane, p), height: p[2], facing: seen(r, normals, k)[2] };
  };
  const place = (dot, pane, points, normals, k) => { // "far" if the point is on the far side
    const { at, facing } = spot(pane, points, normals, k);
    dot.setAttribute("transform", `translate(${at})`); dot.classList.toggle("far", facing < 0);
    dot.setAttribute("visibility", inside(pane, at) ? "visible" : "hidden");
    return at;
  };
  // the front vertex among those near the pointer that face the viewer; null if there is none
  const under = (e) => {
    const x = e.offsetX, y = e.offsetY, pane = paneAt(e), shape = shapes[pane], unit = scale * zoom, n = shape.vertices.length / 3;
    const reach = Math.max(9, 1.2 * unit / Math.sqrt(n)), r = rotation(pane, turn);
    let hit = null, front = -Infinity;
    for (let vertex = 0; vertex < n; vertex++) {
      const p = seen(r, shape.vertices, vertex), at = screen(pane, p), away = Math.hypot(at[0] - x, at[1] - y);
      const height = p[2] - 2 * away / unit;
      if (away > reach || height < front || seen(r, shape.normals, vertex)[2] <= 0) continue;
      front = height; hit = { pane, vertex };
    }
    return hit;
  };
  const closer = (factor, x, y) => { // the point at (x, y) from the middle of its pane stays in place
    const next = Math.min(40, Math.max(0.5, zoom * factor));
    pan = [x, y].map((from, k) => from + (pan[k] - from) * next / zoom); zoom = next; redraw();
  };

  let grip = null, way = 0;
  const fingers = new Map(); // where each pointer that is down was last
  const on = (item, name, act) => item.addEventListener(name, act, { passive: false });
  const still = (e) => (e.pointerType === "touch" ? 10 : 4); // pixels that a click may move
  on(canvas, "pointerdown", (e) => {
    fingers.set(e.pointerId, [e.offsetX, e.offsetY]); canvas.setPointerCapture(e.pointerId);
    way = fingers.size > 1 ? Infinity : 0; grip = fingers.size === 1 ? grabbed(e) : null;
  });
  on(canvas, "pointermove", (e) => {
    const from = fingers.get(e.pointerId), to = [e.offsetX, e.offsetY];
    if (!from) { hovered(e); return; }
    fingers.set(e.pointerId, to);
    way += Math.hypot(to[0] - from[0], to[1] - from[1]);
    if (fingers.size === 2) {
      const [other] = [...fingers].filter(([id]) => id !== e.pointerId).map(([, at]) => at);
      const [x, y] = middle(paneAt({ offsetX: other[0], offsetY: other[1] }));
      const far = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]);
      closer(far(to) / Math.max(far(from), 1), (to[0] + other[0]) / 2 - x, (to[1] + other[1]) / 2 - y);
      pan = pan.map((along, k) => along + (to[k] - from[k]) / 2);
    } else if (grip) { if (way >= still(e)) pulled(grip, e); }
    else { rotate(0, 2, (to[0] - from[0]) / 150); rotate(2, 1, (to[1] - from[1]) / 150); }
  });
  on(canvas, "pointerup", (e) => { if (fingers.has(e.pointerId) && way < still(e)) tapped(e, grip); });
  ["pointerup", "pointercancel", "lostpointercapture"].forEach((name) => on(canvas, name, (e) => { fingers.delete(e.pointerId); grip = null; }));
  on(canvas, "pointerleave", () => { if (!fingers.size) left(); });
  on(canvas, "wheel", (e) => {
    const [x, y] = middle(paneAt(e));
    e.preventDefault(); closer(Math.exp(-e.deltaY * (e.deltaMode ? 0.05 : 0.0015)), e.offsetX - x, e.offsetY - y);
  });
  const keys = { ArrowLeft: () => rotate(0, 2, -0.1), ArrowRight: () => rotate(0, 2, 0.1), ArrowUp: () => rotate(2, 1, -0.1),
    ArrowDown: () => rotate(2, 1, 0.1), "+": () => closer(1.2, 0, 0), "-": () => closer(1 / 1.2, 0, 0), Escape: () => tapped(null) };
  on(canvas, "keydown", (e) => { if (keys[e.key]) { e.preventDefault(); keys[e.key](); } });
  on(canvas, "webglcontextlost", () => stage.classList.remove("usable", "live"));
  on(document.getElementById("reset"), "click", reset); on(window, "resize", redraw);
  stage.classList.add("usable", "live"); reset();
  return { put, redraw, face, place, spot, under, inside, unit: () => scale * zoom };
};
