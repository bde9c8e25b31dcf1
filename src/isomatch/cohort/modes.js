// The mean of shapes, moved along each mode by a slider; the colour is the displacement along the normal of the mean.
"use strict";
(() => {
  const by = (id) => document.getElementById(id);
  const scene = JSON.parse(by("scene").textContent), { high, ramp } = scene;
  const mean = unpack(scene.mean), modes = scene.modes.map(unpack), n = mean.vertices.length;
  const sliders = modes.map((_, k) => by(`mode${k + 1}`));
  const view = viewer([mean], { lines: () => by("wire").checked });
  if (!view) return;
  const normalsOf = (v) => { // sums of those of faces, by their areas
    const sums = new Float32Array(n), { faces } = mean;
    for (let f = 0; f < faces.length; f += 3) {
      const [a, b, c] = [3 * faces[f], 3 * faces[f + 1], 3 * faces[f + 2]], p = [0, 1, 2].map((k) => v[b + k] - v[a + k]);
      const q = [0, 1, 2].map((k) => v[c + k] - v[a + k]);
      for (const at of [a, b, c]) for (let k = 0; k < 3; k++) sums[at + k] += p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3];
    }
    const unit = new Int8Array(n);
    for (let i = 0; i < n; i += 3) {
      const length = Math.hypot(sums[i], sums[i + 1], sums[i + 2]) || 1;
      for (let k = 0; k < 3; k++) unit[i + k] = Math.round(127 * sums[i + k] / length);
    }
    return unit;
  };
  const move = () => {
    const by_sd = sliders.map(({ value }) => Number(value)), away = new Float32Array(n), colours = new Uint8Array(n);
    modes.forEach(({ vertices }, k) => { if (by_sd[k]) for (let i = 0; i < n; i++) away[i] += by_sd[k] * vertices[i]; });
    const vertices = mean.vertices.map((x, i) => x + away[i]);
    for (let i = 0; i < n; i += 3) {
      const outward = (away[i] * mean.normals[i] + away[i + 1] * mean.normals[i + 1] + away[i + 2] * mean.normals[i + 2]) / 127;
      colours.set(rampColour(ramp, 0.5 + outward * scene.unit / high / 2), i);
    }
    view.put(0, "position", vertices); view.put(0, "normal", by_sd.some(Boolean) ? normalsOf(vertices) : mean.normals);
    view.put(0, "colour", colours);
    sliders.forEach((slider, k) => {
      const told = (by_sd[k] > 0 ? "+" : "") + by_sd[k].toFixed(1).replace("-", "−") + " sd";
      slider.nextElementSibling.textContent = told; slider.setAttribute("aria-valuetext", told);
    });
  };
  sliders.forEach((slider) => slider.addEventListener("input", move)); by("wire").addEventListener("change", view.redraw);
  by("mean").addEventListener("click", () => { sliders.forEach((slider) => { slider.value = 0; }); move(); });
  paintRamp(ramp); move();
})();
