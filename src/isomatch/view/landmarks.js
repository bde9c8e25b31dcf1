// Landmarks: a list of pairs that clicks fill and that can be edited as text. The browser keeps it under a key of the shapes.
"use strict";
const landmarks = (() => {
  const by = (id) => document.getElementById(id);
  const [text, problem, save, picking] = ["noted", "problem", "save", "picking"].map(by);
  const given = JSON.parse(by("given").textContent), key = "isomatch " + JSON.stringify(given);
  const HEAD = "# source, target", MISSING = "?";
  const list = { rows: [], changed: () => {} };  // rows are [source vertex, target vertex], null where it is still missing

  const written = (rows) => [HEAD, ...rows.map((row) => row.map((vertex) => vertex ?? MISSING).join(", "))].join("\n") + "\n";
  const stored = (value) => { // some browsers keep nothing for pages that are opened as files
    try {
      if (value === undefined) return localStorage.getItem(key);
      localStorage.setItem(key, value);
    } catch { by("kept").textContent = "This browser does not keep the list. Save it before you close the page."; }
    return null;
  };
  const read = () => {
    const lines = text.value.split("\n").map((line) => line.split("#")[0].trim());
    const pairs = lines.map((line) => line.match(/^(\d+|\?)(?:\s*,\s*|\s+)(\d+|\?)$/));
    const wrong = lines.findIndex((line, k) => line && !pairs[k]);
    problem.textContent = wrong < 0 ? "" : `Line ${wrong + 1} is not a pair of vertices and is left out.`;
    list.rows = pairs.filter(Boolean).map((pair) => pair.slice(1).map((word) => (word === MISSING ? null : Number(word))));
    const whole = list.rows.filter((row) => !row.includes(null));
    save.href = "data:text/plain;charset=utf-8," + encodeURIComponent(written(whole));
    if (list.rows.length || picking.checked) by("landmarks").hidden = false;
    stored(text.value); list.changed();
  };
  const write = (rows) => { text.value = written(rows); read(); };

  list.add = (pane, vertex) => {
    const rows = [...list.rows], row = rows.findIndex((each) => each[pane] === null);
    if (row < 0) rows.push(pane ? [null, vertex] : [vertex, null]);
    else rows[row] = pane ? [rows[row][0], vertex] : [vertex, rows[row][1]];
    write(rows);
  };
  text.addEventListener("input", read); picking.addEventListener("change", read);
  by("undo").addEventListener("click", () => write(list.rows.slice(0, -1)));
  by("clear").addEventListener("click", () => write([]));
  text.value = stored() ?? written(given.landmarks); read();
  return list;
})();
