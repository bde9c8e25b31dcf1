// Landmarks: a list of pairs that clicks fill and that can be edited as text. The browser keeps it under a key of the shapes.
"use strict";
const landmarks = (() => {
  const by = (id) => document.getElementById(id);
  const [text, problem, save, picking] = ["noted", "problem", "save", "picking"].map(by);
  const given = JSON.parse(by("given").textContent), key = "isomatch " + JSON.stringify(given);
  const HEAD = "# source, target", MISSING = "?";
  // rows are [source vertex, target vertex], null where it is still missing; the next click replaces the chosen end
  const list = { rows: [], chosen: null, changed: () => {} };
  const past = []; // texts before each change

  const written = (rows) => [HEAD, ...rows.map((row) => row.map((vertex) => vertex ?? MISSING).join(", "))].join("\n") + "\n";
  const stored = (value) => { // some browsers keep nothing for pages that are opened as files
    try {
      if (value === undefined) return localStorage.getItem(key);
      localStorage.setItem(key, value);
    } catch { by("kept").textContent = "This browser does not keep the list. Save it before you close the page."; }
    return null;
  };
  let before = "";
  const read = () => {
    const lines = text.value.split("\n").map((line) => line.split("#")[0].trim());
    const pairs = lines.map((line) => line.match(/^(\d+|\?)(?:\s*,\s*|\s+)(\d+|\?)$/));
    const wrong = lines.findIndex((line, k) => line && !pairs[k]);
    problem.textContent = wrong < 0 ? "" : `Line ${wrong + 1} is not a pair of vertices and is left out.`;
    list.rows = pairs.filter(Boolean).map((pair) => pair.slice(1).map((word) => (word === MISSING ? null : Number(word))));
    list.whole = list.rows.filter((row) => !row.includes(null));
    save.href = "data:text/plain;charset=utf-8," + encodeURIComponent(written(list.whole));
    if (list.rows.length || picking.checked) by("landmarks").hidden = false;
    by("undo").disabled = !past.length;
    before = text.value; stored(text.value); list.changed();
  };
  const write = (rows, again = false) => { // "again" if it goes on with the change before
    if (!again) past.push(before);
    text.value = written(rows); read();
  };

  list.put = (row, pane, vertex, again) =>
    write(list.rows.map((each, k) => (k === row ? each.map((own, side) => (side === pane ? vertex : own)) : each)), again);
  list.add = (pane, vertex) => {
    const { chosen } = list, row = list.rows.findIndex((each) => each[pane] === null);
    list.chosen = null;
    if (chosen && chosen.pane === pane) list.put(chosen.row, pane, vertex);
    else if (row < 0) write([...list.rows, pane ? [null, vertex] : [vertex, null]]);
    else list.put(row, pane, vertex);
  };
  list.extend = (rows) => write([...list.rows, ...rows]);
  list.answer = (vertex, place) => { // where a point is, or null: to be clicked
    const row = list.rows.findIndex((each) => each[0] === vertex);
    if (row < 0) write([...list.rows, [vertex, place]]); else list.put(row, 1, place);
  };
  list.drop = (row) => { list.chosen = null; write(list.rows.filter((_, k) => k !== row)); };
  list.choose = (end) => { // again: not any more
    const { chosen } = list;
    list.chosen = end && chosen && chosen.row === end.row && chosen.pane === end.pane ? null : end; list.changed();
  };
  list.undo = () => { if (past.length) { list.chosen = null; text.value = past.pop(); read(); } };
  text.addEventListener("input", () => { if (text.value !== before) past.push(before); read(); }); picking.addEventListener("change", read);
  document.addEventListener("click", ({ target }) => { // an answer to a question
    const [vertex, place] = (target.dataset?.pair ?? "").split(",");
    if (place) list.answer(Number(vertex), place === MISSING ? null : Number(place));
  });
  by("undo").addEventListener("click", list.undo);
  by("clear").addEventListener("click", () => { list.chosen = null; write([]); });
  text.value = stored() ?? written(given.landmarks); read();
  return list;
})();
