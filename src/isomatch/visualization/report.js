// Both shapes in one view: dragging rotates both, wheel or two fingers zoom, pointing at the source shows the image of a
// vertex, clicks place landmarks, and dragging moves them.
"use strict";
const report = (() => {
  const by = (id) => document.getElementById(id);
  const [canvas, stage, status, which, layer, checker, wire, turned, picking] =
    ["view", "stage", "status", "which", "layer", "checker", "wire", "turned", "picking"].map(by);
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) { status.textContent += " This browser has no WebGL 2, so there is no 3D view."; return null; }

  const KINDS = { index: Uint32Array, faces: Uint32Array, images: Int32Array, vertices: Float32Array,
    points: Float32Array, normals: Int8Array, colours: Uint8Array, levels: Uint8Array };
  const unpack = (item) => Object.fromEntries(Object.entries(item).map(([key, value]) => [key,
    key in KINDS ? new KINDS[key](Uint8Array.from(atob(value), (c) => c.charCodeAt(0)).buffer) : value]));
  const scene = JSON.parse(by("scene").textContent);
  const shapes = [scene.source, scene.target].map(unpack);
  const unpacked = (given) => given.maps.map(unpack).map((map) => ({ ...map,
    layers: Object.fromEntries(Object.entries(map.layers).map(([name, layer]) => [name, unpack(layer)])) }));
  let maps = unpacked(scene), { filed } = scene; // others may be taken later
  const now = () => maps[which.selectedIndex];  // undefined where there is no map
  const shown = () => now()?.layers[layer.value];  // undefined where colours are those of positions
  const where = shapes.map((shape) => new Map(Array.from(shape.index, (vertex, k) => [vertex, k])));

  const program = gl.createProgram();
  for (const [kind, id] of [[gl.VERTEX_SHADER, "vertex"], [gl.FRAGMENT_SHADER, "fragment"]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, by(id).textContent.trim()); gl.compileShader(shader); gl.attachShader(program, shader);
  }
  gl.linkProgram(program); if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null; // the still picture remains
  gl.useProgram(program); gl.clearColor(0, 0, 0, 0);
  [gl.DEPTH_TEST, gl.SCISSOR_TEST, gl.BLEND].forEach((switched) => gl.enable(switched));
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  const [uTurn, uCentre, uSize, uSquares, uLine] = ["turn", "centre", "size", "squares", "line"].map(
    (name) => gl.getUniformLocation(program, name));
  const buffer = (kind, data) => {
    const made = gl.createBuffer(); gl.bindBuffer(kind, made); gl.bufferData(kind, data, gl.STATIC_DRAW); return made;
  };
  const edges = (faces) => { // each edge once
    const seen = new Set();
    for (let k = 0; k < faces.length; k++) {
      const a = faces[k], b = faces[k % 3 === 2 ? k - 2 : k + 1]; seen.add(Math.min(a, b) * 2 ** 26 + Math.max(a, b));
    }
    return Uint32Array.from([...seen].flatMap((edge) => [Math.floor(edge / 2 ** 26), edge % 2 ** 26]));
  };
  const surfaces = shapes.map((shape) => { // one for each pane; a map or a layer replaces colours and places
    const array = gl.createVertexArray(); gl.bindVertexArray(array);
    const attribute = (name, kind, values) => {
      const at = gl.getAttribLocation(program, name), made = buffer(gl.ARRAY_BUFFER, values);
      gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, 3, kind, true, 0, 0); return made;
    };
    attribute("position", gl.FLOAT, shape.vertices); attribute("normal", gl.BYTE, shape.normals);
    return { array, colour: attribute("colour", gl.UNSIGNED_BYTE, new Uint8Array(shape.normals.length)),
      place: attribute("place", gl.FLOAT, shape.vertices), n: shape.faces.length,
      faces: buffer(gl.ELEMENT_ARRAY_BUFFER, shape.faces) };
  });
  const CLAY = [200, 200, 196], GREY = [174, 174, 174], NO_VALUE = 255, LEVELS = 254, NOWHERE = 1e6, SQUARES = 14;
  const rampColour = (ramp, level) => {
    const at = level / LEVELS * (ramp.length - 1), k = Math.min(Math.floor(at), ramp.length - 2);
    return ramp[k].map((low, c) => low + (ramp[k + 1][c] - low) * (at - k));
  };
  const plain = (shape) => new Uint8Array(shape.normals.length).map((_, k) => CLAY[k % 3]);
  const valueOf = ({ low, high, ratio, levels }, vertex) => {
    const share = levels[vertex] / LEVELS;
    return ratio ? low * (high / low) ** share : low + (high - low) * share;
  };
  const number = (value, { ratio }) => (ratio ? "× " : "") + Number(value.toPrecision(3));
  const paint = () => {
    const map = now(), item = shown();
    let colours = map?.colours ?? plain(shapes[0]);
    if (item) {
      const table = Array.from({ length: NO_VALUE + 1 }, (_, k) => (k === NO_VALUE ? GREY : rampColour(item.ramp, k)));
      colours = Uint8Array.from({ length: colours.length }, (_, k) => table[item.levels[Math.floor(k / 3)]][k % 3]);
      by("ramp").style.background = `linear-gradient(90deg, ${item.ramp.map((stop) => `rgb(${stop})`)})`;
      by("low").textContent = "≤ " + number(item.low, item); by("high").textContent = "≥ " + number(item.high, item);
      by("meaning").textContent = item.meaning;
    }
    by("legend").hidden = !item;
    const put = (held, data) => { gl.bindBuffer(gl.ARRAY_BUFFER, held); gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW); };
    put(surfaces[0].colour, colours);
    put(surfaces[1].colour, map && !item ? shapes[1].colours : plain(shapes[1]));
    if (map) put(surfaces[0].place, map.points.map((x, k) => (map.images[Math.floor(k / 3)] < 0 ? NOWHERE : x)));
    redraw();
  };
  const offer = () => { // the layers of the map that is shown
    const kept = layer.value;
    layer.replaceChildren(...["position", ...Object.keys(now()?.layers ?? {})].map((name) => new Option(name)));
    layer.value = now() && kept in now().layers ? kept : "position"; paint();
  };

  // turn has the rows right, up, towards the viewer; panes are [left, top, width, height] in CSS pixels
  let turn, zoom, pan, panes, scale, queued = false, mark = null, pinned = false;
  const reset = () => { turn = [1, 0, 0, 0, 1, 0, 0, 0, 1]; zoom = 1; pan = [0, 0]; };
  const product = (a, b) => a.map((_, k) => [0, 1, 2].reduce((sum, m) => sum + a[3 * Math.floor(k / 3) + m] * b[3 * m + k % 3], 0));
  const transposed = (a) => a.map((_, k) => a[3 * (k % 3) + Math.floor(k / 3)]);
  const rotation = (pane) => { // scene.filed brings the source to how it lies in its file, filed from there to the target
    if (pane) return turn;
    return product(turned.checked ? product(turn, transposed(filed)) : turn, scene.filed);
  };
  const seen = (r, v, i) => [0, 3, 6].map((k) => r[k] * v[3 * i] + r[k + 1] * v[3 * i + 1] + r[k + 2] * v[3 * i + 2]);
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
    scale = Math.min(...shapes.map((s, k) => Math.min(0.88 * panes[k][2] / s.extent[0], (panes[k][3] - Math.min(72, 0.3 * panes[k][3])) / s.extent[1])));
    [0, 1].forEach((k) => Object.assign(by("name" + k).style,
      { left: middle(k)[0] + "px", top: panes[k][1] + panes[k][3] - 28 + "px" }));
    return [w, h, ratio];
  };
  const draw = () => {
    queued = false; if (!canvas.clientWidth) return; // hidden
    const [w, h, ratio] = layout();
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.uniform2f(uSize, 2 * scale * zoom / w, 2 * scale * zoom / h);
    gl.uniform1f(uSquares, checker.checked && now() ? SQUARES : 0);
    surfaces.forEach((surface, k) => {
      const [x, y] = screen(k, [0, 0]), [left, top, width, height] = panes[k].map((side) => Math.round(side * ratio));
      gl.scissor(left, canvas.height - top - height, width, height);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.uniformMatrix3fv(uTurn, true, rotation(k)); gl.uniform2f(uCentre, 2 * x / w - 1, 1 - 2 * y / h);
      gl.bindVertexArray(surface.array);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, surface.faces); gl.drawElements(gl.TRIANGLES, surface.n, gl.UNSIGNED_INT, 0);
      if (!wire.checked) return;
      if (!surface.edges) {
        const ends = edges(shapes[k].faces); surface.nEnds = ends.length; surface.edges = buffer(gl.ELEMENT_ARRAY_BUFFER, ends);
      }
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, surface.edges); gl.uniform1f(uLine, 0.35);
      gl.drawElements(gl.LINES, surface.nEnds, gl.UNSIGNED_INT, 0); gl.uniform1f(uLine, 0);
    });
    pin();
    describe();
  };
  const redraw = () => { if (!queued) { queued = true; requestAnimationFrame(draw); } };

  // the front vertex among those near the pointer that face the viewer; null if there is none
  const under = (e) => {
    const x = e.offsetX, y = e.offsetY, pane = inside(0, [x, y]) ? 0 : 1, shape = shapes[pane], unit = scale * zoom;
    const reach = Math.max(9, 1.2 * unit / Math.sqrt(shape.index.length)), r = rotation(pane);
    let hit = null, front = -Infinity;
    for (let vertex = 0; vertex < shape.index.length; vertex++) {
      const p = seen(r, shape.vertices, vertex), at = screen(pane, p), away = Math.hypot(at[0] - x, at[1] - y);
      const height = p[2] - 2 * away / unit;
      if (away > reach || height < front || seen(r, shape.normals, vertex)[2] <= 0) continue;
      front = height; hit = { pane, vertex };
    }
    return hit;
  };
  const place = (dot, pane, points, normals, vertex) => { // "far" if the point is on the far side
    const r = rotation(pane), at = screen(pane, seen(r, points, vertex));
    dot.setAttribute("transform", `translate(${at})`); dot.classList.toggle("far", seen(r, normals, vertex)[2] < 0);
    dot.setAttribute("visibility", inside(pane, at) ? "visible" : "hidden");
    return at;
  };
  const svg = (name, attributes, ...inner) => {
    const made = document.createElementNS(by("pins").namespaceURI, name);
    Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value)); made.append(...inner); return made;
  };
  const nearest = (points, p, counts) => { // number of the nearest of some points, of those that count
    let best, least = Infinity;
    for (let k = 0; 3 * k < points.length; k++) {
      const away = (points[3 * k] - p[0]) ** 2 + (points[3 * k + 1] - p[1]) ** 2 + (points[3 * k + 2] - p[2]) ** 2;
      if (away < least && counts(k)) { least = away; best = k; }
    }
    return best;
  };
  const guess = ([own, goal]) => { // the missing end of a pair by the map that is shown; undefined if there is none
    const map = now(), from = where[0].get(own), to = where[1].get(goal), at = (points, k) => points.slice(3 * k, 3 * k + 3);
    if (!map || !landmarks.guesses) return undefined;
    if (to !== undefined) return shapes[0].index[nearest(map.points, at(shapes[1].vertices, to), (k) => map.images[k] >= 0)];
    if (from === undefined || map.images[from] < 0) return undefined;
    if (where[1].has(map.images[from])) return map.images[from];
    return shapes[1].index[nearest(shapes[1].vertices, at(map.points, from), () => true)];  // of those that are shown
  };
  const TOUCHED = 20, POINTED = 11; // pixels around a pin that belong to it
  let pins = [];
  const pin = () => {
    pins = landmarks.rows.flatMap((row, k) => row.flatMap((own, pane) => {
      const at = where[pane].get(own ?? guess(row)), { chosen } = landmarks; if (at === undefined) return [];
      const kind = [own === null ? "guess" : row.includes(null) && "half", chosen?.row === k && chosen.pane === pane && "chosen"];
      const made = svg("g", { class: ["pin", ...kind.filter(Boolean)].join(" "), style: `--own: var(--pin${k % 8})` },
        svg("circle", { r: 9 }), svg("text", {}, k + 1));
      return [{ row: k, pane, made, at: place(made, pane, shapes[pane].vertices, shapes[pane].normals, at) }];
    }));
    by("pins").replaceChildren(...pins.map(({ made }) => made));
  };
  const gripped = (e) => { // the pin at the pointer, of those that face the viewer
    const away = ({ at }) => Math.hypot(at[0] - e.offsetX, at[1] - e.offsetY);
    const near = pins.filter((each) => away(each) < (e.pointerType === "touch" ? TOUCHED : POINTED) && !each.made.classList.contains("far"));
    return near.sort((a, b) => away(a) - away(b))[0] ?? null;
  };
  const describe = () => {
    const marks = ["dot0", "dot1", "link"].map(by), [, , link] = marks;
    for (const item of marks) item.setAttribute("visibility", "hidden");
    if (!mark) { status.textContent = now() ? status.dataset.help : "Drag to rotate both shapes; the wheel or two fingers zoom."; return; }
    const { pane, vertex, goal } = mark, map = now(), image = map?.images[vertex], item = shown();
    const own = place(marks[0], pane, shapes[pane].vertices, shapes[pane].normals, vertex);
    status.textContent = `${pane ? "target" : "source"} vertex ${shapes[pane].index[vertex]}`;
    if (pane || !map) return;
    const asked = goal !== undefined, [on, k] = asked ? [{ points: shapes[1].vertices, normals: shapes[1].normals }, goal] : [map, vertex];
    if (asked || image >= 0) {
      const to = place(marks[1], 1, on.points, on.normals, k);
      ["x1", "y1", "x2", "y2"].forEach((name, end) => link.setAttribute(name, (end < 2 ? own : to)[end % 2]));
      if (inside(0, own) && inside(1, to)) link.setAttribute("visibility", "visible");
      if (!asked) status.textContent += ` → target vertex ${image}${marks[1].classList.contains("far") ? ", on the far side" : ""}`;
    } else status.textContent += " is unmatched";
    if (item && item.levels[vertex] !== NO_VALUE) status.textContent += `, ${layer.value} ${number(valueOf(item, vertex), item)}`;
  };
  const click = (hit) => {
    if (picking.checked && hit) landmarks.add(hit.pane, shapes[hit.pane].index[hit.vertex]);
    pinned = Boolean(hit) && hit.pane === 0 && !picking.checked; mark = hit; redraw();
  };
  const closer = (factor, x, y) => { // the point at (x, y) from the middle of its pane stays in place
    const next = Math.min(40, Math.max(0.5, zoom * factor));
    pan = [x, y].map((from, k) => from + (pan[k] - from) * next / zoom); zoom = next; redraw();
  };

  let grip = null, way = 0;
  const fingers = new Map(); // where each pointer that is down was last
  const on = (item, name, act) => item.addEventListener(name, act, { passive: false });
  on(canvas, "pointerdown", (e) => {
    fingers.set(e.pointerId, [e.offsetX, e.offsetY]); canvas.setPointerCapture(e.pointerId);
    way = fingers.size > 1 ? Infinity : 0; grip = picking.checked && fingers.size === 1 ? gripped(e) : null;
  });
  on(canvas, "pointermove", (e) => {
    const from = fingers.get(e.pointerId), to = [e.offsetX, e.offsetY], still = e.pointerType === "touch" ? 10 : 4;
    if (!from) {
      canvas.style.cursor = picking.checked && gripped(e) ? "move" : "";
      if (!pinned) { mark = under(e); redraw(); }
      return;
    }
    fingers.set(e.pointerId, to);
    way += Math.hypot(to[0] - from[0], to[1] - from[1]);
    if (fingers.size === 2) {
      const [other] = [...fingers].filter(([id]) => id !== e.pointerId).map(([, at]) => at), [x, y] = middle(inside(0, other) ? 0 : 1);
      const far = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]);
      closer(far(to) / Math.max(far(from), 1), (to[0] + other[0]) / 2 - x, (to[1] + other[1]) / 2 - y);
      pan = pan.map((along, k) => along + (to[k] - from[k]) / 2);
    } else if (grip) {
      const hit = way < still ? null : under(e);
      if (hit?.pane === grip.pane) { landmarks.put(grip.row, grip.pane, shapes[hit.pane].index[hit.vertex], grip.moved); grip.moved = true; }
    } else { rotate(0, 2, (to[0] - from[0]) / 150); rotate(2, 1, (to[1] - from[1]) / 150); redraw(); }
  });
  on(canvas, "pointerup", (e) => {
    if (fingers.has(e.pointerId) && way < (e.pointerType === "touch" ? 10 : 4)) {
      if (grip && !grip.made.classList.contains("guess")) landmarks.choose({ row: grip.row, pane: grip.pane }); else click(under(e));
    }
  });
  ["pointerup", "pointercancel", "lostpointercapture"].forEach((name) => on(canvas, name, (e) => { fingers.delete(e.pointerId); grip = null; }));
  on(canvas, "pointerleave", () => { if (!fingers.size && !pinned) { mark = null; redraw(); } });
  on(canvas, "wheel", (e) => {
    const [x, y] = middle(inside(0, [e.offsetX, e.offsetY]) ? 0 : 1);
    e.preventDefault(); closer(Math.exp(-e.deltaY * (e.deltaMode ? 0.05 : 0.0015)), e.offsetX - x, e.offsetY - y);
  });
  const keys = { ArrowLeft: () => rotate(0, 2, -0.1), ArrowRight: () => rotate(0, 2, 0.1),
    ArrowUp: () => rotate(2, 1, -0.1), ArrowDown: () => rotate(2, 1, 0.1), "+": () => closer(1.2, 0, 0),
    "-": () => closer(1 / 1.2, 0, 0), Escape: () => { landmarks.choose(null); click(null); } };
  on(canvas, "keydown", (e) => { if (keys[e.key]) { e.preventDefault(); keys[e.key](); redraw(); } });
  on(canvas, "webglcontextlost", () => stage.classList.remove("usable", "live"));
  on(by("reset"), "click", () => { reset(); redraw(); });
  on(by("flat"), "click", () => { stage.classList.toggle("live"); redraw(); });
  on(which, "change", offer); on(layer, "change", paint); on(window, "resize", redraw);
  [checker, wire, turned].forEach((box) => on(box, "change", redraw));
  const pickingOrNot = () => stage.classList.toggle("picking", picking.checked);
  on(picking, "change", pickingOrNot); landmarks.changed = redraw;
  const begin = () => { // with the first of the maps
    by("turning").hidden = filed[0] + filed[4] + filed[8] > 3 - 1e-6 || !maps.length;
    ["layers", "checkers"].forEach((id) => { by(id).hidden = !maps.length; });
    by("maps").hidden = maps.length < 2; which.selectedIndex = 0; layer.value = "position"; offer();
  };
  const take = (given) => { // maps in place of those before, of the same shapes
    maps = unpacked(given); filed = given.filed; mark = null; pinned = false;
    which.replaceChildren(...maps.map(({ name }) => new Option(name))); begin();
  };
  const look = (pane, vertex) => { // turn a vertex to the viewer
    const at = where[pane].get(vertex); if (at === undefined) return;
    const [x, y, z] = seen(rotation(pane), shapes[pane].normals, at);
    rotate(2, 0, Math.atan2(x, z)); rotate(2, 1, Math.atan2(y, Math.hypot(x, z)));
    mark = { pane, vertex: at }; pinned = true; redraw();
  };
  const ask = ({ target }) => { // show both ends of an answer
    const [vertex, goal] = (target.dataset?.pair ?? "?").split(",").map(Number);
    if (!where[0].has(vertex)) return;
    look(0, vertex); mark.goal = where[1].get(goal);
  };
  ["pointerover", "focusin"].forEach((name) => on(document, name, ask));
  on(document, "click", ({ target }) => { if (target.dataset?.map in maps) show(Number(target.dataset.map)); });
  const farthest = (taken) => { // the vertex with an image that is farthest from some, or from the middle
    const at = (k) => shapes[0].vertices.slice(3 * k, 3 * k + 3), known = taken.map((vertex) => where[0].get(vertex)).filter((k) => k !== undefined);
    const from = known.length ? known.map(at) : [[0, 0, 0]], { images } = maps[0];
    const away = Array.from(shapes[0].index, (_, k) => (images[k] < 0 ? -1 : Math.min(...from.map((p) => Math.hypot(...at(k).map((x, c) => x - p[c]))))));
    return shapes[0].index[away.indexOf(away.reduce((a, b) => Math.max(a, b)))];
  };
  const show = (number) => { which.selectedIndex = number; offer(); };
  const colour = (name) => { layer.value = name; paint(); };
  by("flat").hidden = !stage.querySelector("img"); turned.checked = false; reset(); pickingOrNot();
  stage.classList.add("usable", "live"); begin();
  return { take, look, show, colour, guess, farthest };
})();
