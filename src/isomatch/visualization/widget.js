// The page of a result in a frame of a notebook. It begins with the pairs that are known, and each change of its list is
// told to Python. It is dark where the notebook is.
const themeOf = ({ jpThemeLight, vscodeThemeKind }) => { // empty where the notebook does not tell
  if (jpThemeLight) return jpThemeLight === "true" ? "light" : "dark";
  return vscodeThemeKind ? (vscodeThemeKind.endsWith("light") ? "light" : "dark") : "";
};
const begun = (page, pairs, theme) => {
  const whole = new DOMParser().parseFromString(page, "text/html"), style = whole.querySelector("style");
  const given = whole.getElementById("given");
  given.textContent = JSON.stringify({ ...JSON.parse(given.textContent), landmarks: pairs });
  if (theme) {
    style.textContent = style.textContent.replace("(prefers-color-scheme: dark)", theme === "dark" ? "all" : "not all");
    style.textContent += `:root { color-scheme: ${theme}; }`;
  }
  return "<!DOCTYPE html>\n" + whole.documentElement.outerHTML;
};
const render = ({ model, el }) => {
  const frame = document.createElement("iframe");
  frame.setAttribute("sandbox", "allow-scripts allow-downloads"); frame.title = "Both shapes in 3D";
  frame.style.cssText = `width: 100%; height: ${model.get("height")}px; border: 0;`;
  frame.srcdoc = begun(model.get("page"), model.get("pairs"), themeOf(document.body.dataset));
  const hear = ({ source, data }) => {
    if (source !== frame.contentWindow || data?.isomatch !== "landmarks") return;
    model.set("pairs", data.pairs); model.save_changes();
  };
  window.addEventListener("message", hear);
  el.append(frame);
  return () => window.removeEventListener("message", hear);
};
export default { render };
