// Both shapes in one view: dragging rotates both, the wheel zooms, pointing at the source shows the image of a vertex.
"use strict";
(() => {
  const by = (id) => document.getElementById(id);
  const [canvas, stage, status, which, noted] = ["view", "stage", "status", "which", "noted"].map(by);
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) { status.textContent += " This browser has no WebGL 2, so only the still picture is shown."; return; }

  const KINDS = { index: Uint32Array, faces: Uint32Array, images: Int32Array, vertices: Float32Array,
    points: Float32Array, normals: Int8Array, colours: Uint8Array };
  const unpack = (item) => Object.fromEntries(Object.entries(item).map(([key, value]) => [key,
    key in KINDS ? new KINDS[key](Uint8Array.from(atob(value), (c) => c.charCodeAt(0)).buffer) : value]));
  const scene = JSON.parse(by("scene").textContent);
  const shapes = [scene.source, scene.target].map(unpack), maps = scene.maps.map(unpack);

  const program = gl.createProgram();
  for (const [kind, id] of [[gl.VERTEX_SHADER, "vertex"], [gl.FRAGMENT_SHADER, "fragment"]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, by(id).textContent.trim()); gl.compileShader(shader); gl.attachShader(program, shader);
  }
  gl.linkProgram(program); if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return; // the still picture remains
  gl.useProgram(program); gl.enable(gl.DEPTH_TEST); gl.enable(gl.SCISSOR_TEST); gl.clearColor(1, 1, 1, 1);
  const [uTurn, uCentre, uSize] = ["turn", "centre", "size"].map((name) => gl.getUniformLocation(program, name));
  const fill = (kind, data) => { gl.bindBuffer(kind, gl.createBuffer()); gl.bufferData(kind, data, gl.STATIC_DRAW); };
  const drawable = (shape, colours) => {
    const array = gl.createVertexArray(); gl.bindVertexArray(array);
    [["position", shape.vertices, gl.FLOAT], ["normal", shape.normals, gl.BYTE],
      ["colour", colours, gl.UNSIGNED_BYTE]].forEach(([name, values, kind]) => {
      const at = gl.getAttribLocation(program, name);
      fill(gl.ARRAY_BUFFER, values); gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, 3, kind, true, 0, 0);
    });
    fill(gl.ELEMENT_ARRAY_BUFFER, shape.faces); return array;
  };
  const sources = maps.map((map) => drawable(shapes[0], map.colours)), target = drawable(shapes[1], shapes[1].colours);

  // turn has the rows right, up, towards the viewer; panes are [left, top, width, height] in CSS pixels
  let turn, zoom, pan, panes, scale, queued = false, mark = null, pinned = false;
  const reset = () => { turn = [1, 0, 0, 0, 1, 0, 0, 0, 1]; zoom = 1; pan = [0, 0]; };
  const turned = (v, i) => [0, 3, 6].map((r) => turn[r] * v[3 * i] + turn[r + 1] * v[3 * i + 1] + turn[r + 2] * v[3 * i + 2]);
  const rotate = (row, other, angle) => { // points in the direction of row ``other`` move towards ``row``
    const c = Math.cos(angle), s = Math.sin(angle);
    for (let k = 0, [i, j] = [3 * row, 3 * other]; k < 3; k++, i++, j++) {
      [turn[i], turn[j]] = [c * turn[i] + s * turn[j], c * turn[j] - s * turn[i]];
    }
  };
  const middle = (pane) => [0, 1].map((k) => panes[pane][k] + panes[pane][k + 2] / 2);
  const screen = (pane, p) => middle(pane).map((m, k) => m + pan[k] + (k ? -1 : 1) * scale * zoom * p[k]);
  const inside = (pane, at) => at.every((x, k) => x >= panes[pane][k] && x <= panes[pane][k] + panes[pane][k + 2]);
  const layout = () => {
    const w = canvas.clientWidth, h = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    [["width", w], ["height", h]].forEach(([side, length]) => { // setting a size is slow even if it stays the same
      if (canvas[side] !== Math.round(length * ratio)) canvas[side] = Math.round(length * ratio);
    });
    panes = w < h ? [[0, 0, w, h / 2], [0, h / 2, w, h / 2]] : [[0, 0, w / 2, h], [w / 2, 0, w / 2, h]];
    scale = Math.min(...shapes.map((s, k) => Math.min(0.88 * panes[k][2] / s.extent[0], (panes[k][3] - 72) / s.extent[1])));
    [0, 1].forEach((k) => Object.assign(by("name" + k).style,
      { left: middle(k)[0] + "px", top: panes[k][1] + panes[k][3] - 28 + "px" }));
    return [w, h, ratio];
  };
  const draw = () => {
    queued = false; if (!canvas.clientWidth) return; // hidden
    const [w, h, ratio] = layout();
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.uniformMatrix3fv(uTurn, true, turn); gl.uniform2f(uSize, 2 * scale * zoom / w, 2 * scale * zoom / h);
    [sources[which.selectedIndex], target].forEach((array, k) => {
      const [x, y] = screen(k, [0, 0]), [left, top, width, height] = panes[k].map((side) => Math.round(side * ratio));
      gl.scissor(left, canvas.height - top - height, width - 1, height - 1); // leaves a line between the panes
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.uniform2f(uCentre, 2 * x / w - 1, 1 - 2 * y / h);
      gl.bindVertexArray(array); gl.drawElements(gl.TRIANGLES, shapes[k].faces.length, gl.UNSIGNED_INT, 0);
    });
    describe();
  };
  const redraw = () => { if (!queued) { queued = true; requestAnimationFrame(draw); } };

  // the front vertex among those near the pointer that face the viewer; null if there is none
  const under = (e) => {
    const x = e.offsetX, y = e.offsetY, pane = inside(0, [x, y]) ? 0 : 1, shape = shapes[pane], unit = scale * zoom;
    const reach = Math.max(9, 1.2 * unit / Math.sqrt(shape.index.length));
    let hit = null, front = -Infinity;
    for (let vertex = 0; vertex < shape.index.length; vertex++) {
      const p = turned(shape.vertices, vertex), at = screen(pane, p), away = Math.hypot(at[0] - x, at[1] - y);
      const height = p[2] - 2 * away / unit;
      if (away > reach || height < front || turned(shape.normals, vertex)[2] <= 0) continue;
      front = height; hit = { pane, vertex };
    }
    return hit;
  };
  const place = (dot, pane, points, normals, vertex) => { // hollow if the point is on the far side
    const at = screen(pane, turned(points, vertex));
    dot.setAttribute("cx", at[0]); dot.setAttribute("cy", at[1]); dot.classList.toggle("far", turned(normals, vertex)[2] < 0);
    dot.setAttribute("visibility", inside(pane, at) ? "visible" : "hidden");
    return at;
  };
  const describe = () => {
    const marks = ["dot0", "dot1", "link"].map(by), [, , link] = marks;
    for (const item of marks) item.setAttribute("visibility", "hidden");
    if (!mark) { status.textContent = status.dataset.help; return; }
    const { pane, vertex } = mark, map = maps[which.selectedIndex], image = map.images[vertex];
    const own = place(marks[0], pane, shapes[pane].vertices, shapes[pane].normals, vertex);
    status.textContent = `${pane ? "target" : "source"} vertex ${shapes[pane].index[vertex]}`;
    if (pane) return;
    if (image >= 0) {
      const goal = place(marks[1], 1, map.points, map.normals, vertex);
      ["x1", "y1", "x2", "y2"].forEach((name, k) => link.setAttribute(name, (k < 2 ? own : goal)[k % 2]));
      if (inside(0, own) && inside(1, goal)) link.setAttribute("visibility", "visible");
      status.textContent += ` → target vertex ${image}${marks[1].classList.contains("far") ? ", on the far side" : ""}`;
    } else status.textContent += " is unmatched";
    if (pinned) status.textContent += ". Now click the corresponding point on the target to add a landmark.";
  };
  const click = (hit) => {
    if (pinned && hit && hit.pane) {
      noted.value += `${shapes[0].index[mark.vertex]}, ${shapes[1].index[hit.vertex]}\n`; keep();
    }
    pinned = Boolean(hit) && hit.pane === 0; mark = hit; redraw();
  };
  const keep = () => {
    by("save").href = "data:text/plain;charset=utf-8," + encodeURIComponent(noted.value); by("landmarks").hidden = false;
  };
  const closer = (factor, x, y) => { // the point at (x, y) from the middle of its pane stays in place
    const next = Math.min(40, Math.max(0.5, zoom * factor));
    pan = [x, y].map((from, k) => from + (pan[k] - from) * next / zoom); zoom = next; redraw();
  };

  let held = null, way = 0;
  const on = (item, name, act) => item.addEventListener(name, act, { passive: false });
  on(canvas, "pointerdown", (e) => { held = [e.clientX, e.clientY]; way = 0; canvas.setPointerCapture(e.pointerId); });
  on(canvas, "pointermove", (e) => {
    if (!held) { if (!pinned) { mark = under(e); redraw(); } return; }
    const [dx, dy] = [e.clientX - held[0], e.clientY - held[1]]; held = [e.clientX, e.clientY]; way += Math.hypot(dx, dy);
    rotate(0, 2, dx / 150); rotate(2, 1, dy / 150); redraw();
  });
  on(canvas, "pointerup", (e) => { if (held && way < 4) click(under(e)); held = null; });
  ["pointercancel", "lostpointercapture"].forEach((name) => on(canvas, name, () => { held = null; }));
  on(canvas, "pointerleave", () => { if (!held && !pinned) { mark = null; redraw(); } });
  on(canvas, "wheel", (e) => {
    const [x, y] = middle(inside(0, [e.offsetX, e.offsetY]) ? 0 : 1);
    e.preventDefault(); closer(Math.exp(-e.deltaY * (e.deltaMode ? 0.05 : 0.0015)), e.offsetX - x, e.offsetY - y);
  });
  const keys = { ArrowLeft: () => rotate(0, 2, -0.1), ArrowRight: () => rotate(0, 2, 0.1),
    ArrowUp: () => rotate(2, 1, -0.1), ArrowDown: () => rotate(2, 1, 0.1), "+": () => closer(1.2, 0, 0),
    "-": () => closer(1 / 1.2, 0, 0), Escape: () => click(null) };
  on(canvas, "keydown", (e) => { if (keys[e.key]) { e.preventDefault(); keys[e.key](); redraw(); } });
  on(canvas, "webglcontextlost", () => stage.classList.remove("usable", "live"));
  on(by("reset"), "click", () => { reset(); redraw(); });
  on(by("flat"), "click", () => { stage.classList.toggle("live"); redraw(); });
  on(which, "change", redraw); on(window, "resize", redraw); on(noted, "input", keep);
  which.selectedIndex = 0; reset(); stage.classList.add("usable", "live"); redraw();
})();
