// A shape beside the template: numbered landmarks in the colours of their expected errors, and the colours of the map.
"use strict";
(() => {
  const by = (id) => document.getElementById(id);
  const scene = JSON.parse(by("scene").textContent), shapes = scene.shapes.map(unpack), { names, semi, high, ramp } = scene.marks;
  const marks = scene.marks.sides.map(unpack), said = by("status").textContent;
  const colourOf = (error) => (error === null ? [255, 255, 255] : rampColour(ramp, error / high)); // white where it was given
  const CELL = 2.5; // mean distances of vertices: pixel of a coarse image of heights
  const STEEP = 3; // cells by which the surface is higher where a point is behind it; one if the point looks away
  const heights = (pane) => { // a function that tells whether a point is behind the surface
    const n = shapes[pane].vertices.length / 3, cell = CELL / Math.sqrt(n), top = new Map();
    const key = ([x, y]) => 65536 * Math.floor(x / (cell * view.unit())) + Math.floor(y / (cell * view.unit()));
    for (let k = 0; k < n; k++) {
      const { at, height } = view.spot(pane, shapes[pane].vertices, shapes[pane].normals, k), where = key(at);
      if (!(top.get(where) > height)) top.set(where, height);
    }
    return ({ at, height, facing }) => top.get(key(at)) > height + (facing < 0 ? 1 : STEEP) * cell;
  };
  let chosen = null, pinned = false, pins = []; // pinned if it was clicked
  const made = marks.map(({ errors }) => names.map((_, k) => {
    const [r, g, b] = colourOf(errors[k]), own = svg("g", { class: `mark${semi[k] ? " semi" : ""}${errors[k] === null ? " given" : ""}`,
      style: `--own: rgb(${r}, ${g}, ${b}); --ink: ${0.3 * r + 0.6 * g + 0.1 * b > 140 ? "#111" : "#fff"}` }, svg("circle", { r: semi[k] ? 2.5 : 8 }));
    if (!semi[k]) own.append(svg("text", {}, k + 1));
    return own;
  }));
  const drawn = () => {
    pins = [];
    marks.forEach(({ points, normals }, pane) => {
      const isBehind = names.length ? heights(pane) : null;
      names.forEach((_, k) => {
        const own = made[pane][k], isShown = !Number.isNaN(points[3 * k]) && (!semi[k] || by("semi").checked);
        const spot = isShown && view.spot(pane, points, normals, k), isIn = isShown && view.inside(pane, spot.at);
        own.setAttribute("visibility", isIn ? "visible" : "hidden"); if (!isIn) return;
        own.setAttribute("transform", `translate(${spot.at})`); own.classList.toggle("chosen", k === chosen);
        const isFar = isBehind(spot); own.classList.toggle("far", isFar); if (!isFar) pins.push({ pane, k, at: spot.at });
      });
    });
  };
  const tell = () => {
    if (chosen === null) { by("status").textContent = said; return; }
    const error = marks[0].errors[chosen];
    by("status").textContent = `${chosen + 1} ${names[chosen]}` + (error === null ? "" : `: expected error ${Number(error.toPrecision(3))}`);
  };
  const choose = (k, isPinned) => { pinned = isPinned; if (k !== chosen) { chosen = k; tell(); view.redraw(); } };
  const near = (e) => { // the landmark at the pointer
    const away = ({ at }) => Math.hypot(at[0] - e.offsetX, at[1] - e.offsetY), reach = e.pointerType === "touch" ? 20 : 10;
    return pins.filter((pin) => away(pin) < reach).sort((a, b) => away(a) - away(b))[0]?.k ?? null;
  };
  const view = viewer(shapes, { drawn, lines: () => by("wire").checked,
    hovered: (e) => { const k = near(e); if (k !== null || !pinned) choose(k, false); },
    tapped: (e) => { const k = e && near(e); choose(k, k !== null); } });
  if (!view) return;
  by("pins").append(...made.flatMap((pane) => [...pane.filter((_, k) => semi[k]), ...pane.filter((_, k) => !semi[k])]));
  const paint = () => shapes.forEach((shape, pane) => view.put(pane, "colour", by("mapped").checked ? shape.colours : plain(shape)));
  ["semi", "wire"].forEach((id) => by(id).addEventListener("change", view.redraw)); by("mapped").addEventListener("change", paint);
  document.addEventListener("click", ({ target }) => { // a landmark of the table to the viewer
    const k = Number(target.dataset?.landmark ?? NaN); if (Number.isNaN(k)) return;
    choose(k, true); view.face(0, marks[0].normals, k); by("stage").scrollIntoView({ block: "nearest" });
  });
  paintRamp(ramp); paint();
})();
