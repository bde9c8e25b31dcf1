// The panel beside the view: it asks the server to match, shows what came out, and keeps it. See WorkPage.result for the data.
"use strict";
(() => {
  const by = (id) => document.getElementById(id);
  const FEWEST = 3, OFF = 0.05, SLOW = 1000, QUICK = 120; // milliseconds between two questions
  const DONE = { match: "Matched", choose: "Refined", save: "Saved", download: "Packed" };
  const token = new URLSearchParams(location.search).get("token");
  const [A, B] = ["name0", "name1"].map((id) => by(id).textContent.replace(/^(source|target): /, ""));
  let state = { job: null, revision: 0, unsaved: false }, shown = null, timer = null, turn = 0, packing = false;

  const ask = async (path, body) => {
    const options = body === undefined ? {} : { method: "POST", body: JSON.stringify(body) };
    const answer = await fetch(path, { ...options, headers: { "X-Isomatch-Token": token, "Content-Type": "application/json" } });
    if (!answer.ok) throw new Error(await answer.text());
    return answer;
  };
  const trouble = (words) => { by("trouble").textContent = words; by("trouble").hidden = !words; };
  const make = (name, attributes, ...inner) => {
    const made = document.createElement(name); Object.assign(made, attributes); made.append(...inner); return made;
  };
  const small = (text, act, title = "") =>
    make("button", { type: "button", className: "small", title, onclick: act }, text);

  const several = (n) => `${n} pair${n === 1 ? "" : "s"}`;
  const step = () => { // what to do next
    const { rows, whole, chosen } = landmarks, open = rows.find((row) => row.includes(null));
    if (chosen) return `Click the new place of point ${chosen.row + 1} on ${chosen.pane ? B : A}, or drag it.`;
    if (open) {
      const side = open[0] === null ? A : B, point = rows.indexOf(open) + 1;
      return report?.guess(open) >= 0
        ? `Point ${point} on ${side} is where the map puts it. Confirm it, or click its right place.`
        : `Now click the same point, ${point}, on ${side}.`;
    }
    if (!rows.length) return `If you know points that correspond, click one on ${A}, then the same one on ${B}. None are needed.`;
    if (whole.length < FEWEST) return `${several(whole.length)}; at least ${FEWEST} are needed, best far apart and one on one side only.`;
    return `${several(whole.length)}. Drag a point to correct it.`;
  };
  const end = (row, pane) => row[pane] ?? "…";
  const listed = () => {
    by("step").textContent = step();
    const off = new Map((shown?.landmarks ?? []).map(({ pair, off: far }) => [pair.join(), far]));
    const focus = [...by("pairs").querySelectorAll("button")].indexOf(document.activeElement);
    by("pairs").replaceChildren(...landmarks.rows.map((row, k) => {
      const open = row.includes(null), guess = open ? report?.guess(row) : undefined, far = off.get(row.join());
      const ends = make("span", { className: "ends" }, `${end(row, 0)} → ${end(row, 1)}`);
      if (far > OFF) ends.append(" ", make("span", { className: "off", title: "distance of the image from your point, in √area" }, `${Math.round(100 * far)} % off`));
      const item = make("li", { className: [open && "unsure", landmarks.chosen?.row === k && "chosen"].filter(Boolean).join(" ") },
        make("span", { className: "chip" }, `${k + 1}`), ends);
      item.style.setProperty("--own", `var(--pin${k % 8})`);
      if (guess >= 0) item.append(small("Confirm", () => landmarks.put(k, row.indexOf(null), guess), "The point lies where the map puts it"));
      if (row[0] !== null) item.append(small("Look", () => report?.look(0, row[0]), "Turn the point to the front"));
      item.append(Object.assign(small("×", () => landmarks.drop(k), "Remove"), { ariaLabel: `Remove pair ${k + 1}` }));
      return item;
    }));
    if (focus >= 0) [...by("pairs").querySelectorAll("button")].slice(0, focus + 1).pop()?.focus(); // it is not lost with the list
    enable();
  };
  const enable = () => {
    const busy = Boolean(state.job), n = landmarks.whole.length;
    by("match").disabled = busy || (n > 0 && n < FEWEST);
    by("match").textContent = shown?.outcome ? "Match again" : n ? `Match with ${several(n)}` : "Match";
    by("cancel").hidden = !busy; by("progress").hidden = !busy;
    ["choose", "write", "download"].forEach((id) => { by(id).disabled = busy; });
    by("clear").disabled = !landmarks.rows.length; by("propose").hidden = !shown || !report;
    ["only", "hold"].forEach((id) => { by(id).disabled = !n; });
  };

  const doubts = (regions) => regions.map(({ area, vertex, image, runner_up, reason }) => {
    const buttons = make("div", { className: "row" }, small("Look", () => report?.look(0, vertex), "Turn it to the front"));
    const settle = (goal) => landmarks.answer(vertex, goal);
    if (image !== null) buttons.append(small("It is right", () => settle(image), "Adds its middle and the image as a pair"));
    if (runner_up !== null) buttons.append(small("The other place", () => settle(runner_up), "Adds its middle and the image by the other map as a pair"));
    buttons.append(small("Pick", () => { settle(null); report?.look(0, vertex); }, "Adds its middle; then click the right place"));
    const words = regions.length > 1 ? [make("strong", {}, area), ` of the surface around vertex ${vertex}: ${reason}.`] : [`Around vertex ${vertex}.`];
    return make("li", {}, ...words, buttons); // a single region is told in the sentence above
  });
  const runners_up = (all) => all.map(({ name, origin, about }, k) =>
    make("label", { title: origin && `found by ${origin}` },
      make("input", { type: "radio", name: "runner_up", value: k, checked: !k, onchange: () => compare(k) }),
      make("span", {}, name), make("span", { className: "soft" }, about)));
  const compare = (k) => {
    report?.show(k); listed();
    by("choose").hidden = !shown.runners_up[k].name.startsWith("alternative");
    by("choose").value = k;
  };
  by("doubtful").onclick = () => {
    const on = by("doubtful").ariaPressed !== "true";
    report?.colour(on ? "doubt" : "position"); by("doubtful").ariaPressed = on; by("doubtful").textContent = on ? "Hide" : "Show";
  };
  const head = (headline, advice, colour) => {
    by("outcome").textContent = headline; by("advice").textContent = advice;
    if (colour) document.documentElement.style.setProperty("--sign", colour);
  };
  const take = (found) => {
    shown = found;
    head(found.headline, found.advice, found.colour);
    by("how").hidden = !found.sure && !found.regions.length; by("sure").textContent = found.sure; by("since").textContent = found.since;
    by("regions").replaceChildren(...doubts(found.regions)); by("doubts").hidden = !found.regions.length;
    by("doubtful").ariaPressed = false; by("doubtful").textContent = "Show";
    by("runners_up").replaceChildren(...runners_up(found.runners_up)); by("others").hidden = found.runners_up.length < 2; by("choose").hidden = true;
    by("asked").innerHTML = found.questions; by("details").innerHTML = found.details;
    by("found").hidden = by("keeping").hidden = !found.outcome; // a map that was given is no result
    report?.take(found.scene); listed();
  };

  const doing = () => {
    const { job, stage, share, seconds, last } = state;
    by("progress").value = share ?? 0;
    by("doing").textContent = job ? `${stage || job} · ${seconds.toFixed(1)} s` : last ? `${DONE[last.job]} in ${last.seconds.toFixed(1)} s` : "";
  };
  const look = async () => {
    clearTimeout(timer);
    const own = ++turn;
    try {
      const before = state, told = await (await ask("state")).json();
      if (own !== turn) return; // something was begun since
      state = told;
      if (state.error) trouble(state.error);
      if (state.revision !== before.revision) {
        take(await (await ask("result")).json());
        if (before.revision) by("written").textContent = "This result is not saved yet.";
      }
      if (state.written !== before.written && state.written) by("written").textContent = state.written;
      if (packing && state.packed !== before.packed) { packing = false; await fetched(); } // other tabs see it too
      doing(); enable();
    } catch (error) {
      if (own !== turn) return;
      state = { ...state, job: null }; enable();
      trouble(error instanceof TypeError
        ? "isomatch open has ended. Start it again; your landmarks can be saved from “Options”."
        : error.message);
      if (error instanceof TypeError) return; // nobody answers
    }
    if (own === turn) timer = setTimeout(look, state.job ? QUICK : SLOW);
  };
  const start = async (what, body) => {
    trouble(""); clearTimeout(timer); turn += 1; packing = what === "pack";
    state = { ...state, job: what, stage: "", share: 0, seconds: 0 }; doing(); enable(); // until the server tells more
    try { await ask(what, body); } catch (error) { trouble(error.message); packing = false; }
    await look();
  };
  const fetched = async () => {
    const href = URL.createObjectURL(await (await ask("packed")).blob());
    make("a", { href, download: "isomatch.zip" }).click(); setTimeout(() => URL.revokeObjectURL(href), 60000);
  };
  const match = () => start("match", { landmarks: landmarks.whole, only: by("only").checked, hold: by("hold").checked,
    start: by("pose").checked ? "pose" : "auto", orientation: by("orientation").value });
  by("match").onclick = match;
  by("propose").onclick = () => { // points that are far from one another, with the map's images to be confirmed
    const taken = landmarks.rows.map(([own]) => own).filter((own) => own !== null), rows = [];
    while (!rows.length || landmarks.rows.length + rows.length < FEWEST) {
      rows.push([report.farthest([...taken, ...rows.map(([own]) => own)]), null]);
    }
    landmarks.extend(rows);
  };
  by("cancel").onclick = () => start("cancel", {});
  by("choose").onclick = () => start("choose", { number: Number(by("choose").value) });
  by("write").onclick = () => start("write", {});
  by("download").onclick = () => start("pack", {});
  addEventListener("keydown", (e) => {
    if (!(e.ctrlKey || e.metaKey) || e.target === by("noted")) return;
    if (e.key === "Enter" && !by("match").disabled) match();
    if (e.key === "z") { e.preventDefault(); landmarks.undo(); }
  });
  addEventListener("beforeunload", (e) => { if (state.unsaved) e.preventDefault(); });

  const redraw = landmarks.changed;
  landmarks.guesses = true;
  landmarks.changed = () => { redraw(); listed(); };
  head(by("outcome").textContent, "Press Match. It needs no help; points that you know to correspond make it surer.");
  listed(); look();
})();
