// Two shapes and their maps: pointing at the source shows the image of a vertex, clicks place landmarks, dragging moves them.
"use strict";
const report = (() => {
  const by = (id) => document.getElementById(id);
  const [canvas, stage, status, which, layer, checker, wire, turned, picking] =
    ["view", "stage", "status", "which", "layer", "checker", "wire", "turned", "picking"].map(by);
  const scene = JSON.parse(by("scene").textContent);
  const shapes = [scene.source, scene.target].map(unpack);
  const unpacked = (given) => given.maps.map(unpack).map((map) => ({ ...map,
    layers: Object.fromEntries(Object.entries(map.layers).map(([name, layer]) => [name, unpack(layer)])) }));
  let maps = unpacked(scene), { filed } = scene; // others may be taken later
  const now = () => maps[which.selectedIndex];  // undefined where there is no map
  const shown = () => now()?.layers[layer.value];  // undefined where colours are those of positions
  const where = shapes.map((shape) => new Map(Array.from(shape.index, (vertex, k) => [vertex, k])));

  const GREY = [174, 174, 174], NO_VALUE = 255, LEVELS = 254, NOWHERE = 1e6, SQUARES = 14;
  const valueOf = ({ low, high, ratio, levels }, vertex) => {
    const share = levels[vertex] / LEVELS;
    return ratio ? low * (high / low) ** share : low + (high - low) * share;
  };
  const number = (value, { ratio }) => (ratio ? "× " : "") + Number(value.toPrecision(3));
  const paint = () => {
    const map = now(), item = shown();
    let colours = map?.colours ?? plain(shapes[0]);
    if (item) {
      const table = Array.from({ length: NO_VALUE + 1 }, (_, k) => (k === NO_VALUE ? GREY : rampColour(item.ramp, k / LEVELS)));
      colours = Uint8Array.from({ length: colours.length }, (_, k) => table[item.levels[Math.floor(k / 3)]][k % 3]);
      paintRamp(item.ramp);
      by("low").textContent = "≤ " + number(item.low, item); by("high").textContent = "≥ " + number(item.high, item);
      by("meaning").textContent = item.meaning;
    }
    by("legend").hidden = !item;
    view.put(0, "colour", colours); view.put(1, "colour", map && !item ? shapes[1].colours : plain(shapes[1]));
    if (map) view.put(0, "place", map.points.map((x, k) => (map.images[Math.floor(k / 3)] < 0 ? NOWHERE : x)));
  };
  const offer = () => { // the layers of the map that is shown
    const kept = layer.value;
    layer.replaceChildren(...["position", ...Object.keys(now()?.layers ?? {})].map((name) => new Option(name)));
    layer.value = now() && kept in now().layers ? kept : "position"; paint();
  };

  let mark = null, pinned = false;
  const product = (a, b) => a.map((_, k) => [0, 1, 2].reduce((sum, m) => sum + a[3 * Math.floor(k / 3) + m] * b[3 * m + k % 3], 0));
  const transposed = (a) => a.map((_, k) => a[3 * (k % 3) + Math.floor(k / 3)]);
  const rotation = (pane, turn) => { // scene.filed brings the source to how it lies in its file, filed from there to the target
    if (pane) return turn;
    return product(turned.checked ? product(turn, transposed(filed)) : turn, scene.filed);
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
      return [{ row: k, pane, made, at: view.place(made, pane, shapes[pane].vertices, shapes[pane].normals, at) }];
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
    const own = view.place(marks[0], pane, shapes[pane].vertices, shapes[pane].normals, vertex);
    status.textContent = `${pane ? "target" : "source"} vertex ${shapes[pane].index[vertex]}`;
    if (pane || !map) return;
    const asked = goal !== undefined, [on, k] = asked ? [{ points: shapes[1].vertices, normals: shapes[1].normals }, goal] : [map, vertex];
    if (asked || image >= 0) {
      const to = view.place(marks[1], 1, on.points, on.normals, k);
      ["x1", "y1", "x2", "y2"].forEach((name, end) => link.setAttribute(name, (end < 2 ? own : to)[end % 2]));
      if (view.inside(0, own) && view.inside(1, to)) link.setAttribute("visibility", "visible");
      if (!asked) status.textContent += ` → target vertex ${image}${marks[1].classList.contains("far") ? ", on the far side" : ""}`;
    } else status.textContent += " is unmatched";
    if (item && item.levels[vertex] !== NO_VALUE) status.textContent += `, ${layer.value} ${number(valueOf(item, vertex), item)}`;
  };
  const click = (hit) => {
    if (picking.checked && hit) landmarks.add(hit.pane, shapes[hit.pane].index[hit.vertex]);
    pinned = Boolean(hit) && hit.pane === 0 && !picking.checked; mark = hit; view.redraw();
  };
  const view = viewer(shapes, {
    rotation, lines: () => wire.checked, squares: () => (checker.checked && now() ? SQUARES : 0),
    drawn: () => { pin(); describe(); },
    grabbed: (e) => (picking.checked ? gripped(e) : null),
    pulled: (grip, e) => {
      const hit = view.under(e); if (hit?.pane !== grip.pane) return;
      landmarks.put(grip.row, grip.pane, shapes[hit.pane].index[hit.vertex], grip.moved); grip.moved = true;
    },
    hovered: (e) => {
      canvas.style.cursor = picking.checked && gripped(e) ? "move" : "";
      if (!pinned) { mark = view.under(e); view.redraw(); }
    },
    tapped: (e, grip) => {
      if (!e) { landmarks.choose(null); click(null); }
      else if (grip && !grip.made.classList.contains("guess")) landmarks.choose({ row: grip.row, pane: grip.pane });
      else click(view.under(e));
    },
    left: () => { if (!pinned) { mark = null; view.redraw(); } },
  });
  if (!view) return null;
  const on = (item, name, act) => item.addEventListener(name, act, { passive: false });
  on(by("flat"), "click", () => { stage.classList.toggle("live"); view.redraw(); });
  on(which, "change", offer); on(layer, "change", paint);
  [checker, wire, turned].forEach((box) => on(box, "change", view.redraw));
  const pickingOrNot = () => stage.classList.toggle("picking", picking.checked);
  on(picking, "change", pickingOrNot); landmarks.changed = view.redraw;
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
    view.face(pane, shapes[pane].normals, at); mark = { pane, vertex: at }; pinned = true;
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
  by("flat").hidden = !stage.querySelector("img"); turned.checked = false; pickingOrNot(); begin();
  return { take, look, show, colour, guess, farthest };
})();
