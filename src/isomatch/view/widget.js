// The page of a result in a frame of a notebook. It begins with the pairs that are known; its list is theirs from then on.
const begun = (page, pairs) => {
  const whole = new DOMParser().parseFromString(page, "text/html"), given = whole.getElementById("given");
  given.textContent = JSON.stringify({ ...JSON.parse(given.textContent), landmarks: pairs });
  return "<!DOCTYPE html>\n" + whole.documentElement.outerHTML;
};
const render = ({ model, el }) => {
  const frame = document.createElement("iframe");
  frame.setAttribute("sandbox", "allow-scripts allow-downloads"); frame.title = "Both shapes in 3D";
  const dark = document.body.dataset.jpThemeLight === "false" ? "dark" : "inherit";
  frame.style.cssText = `width: 100%; height: ${model.get("height")}px; border: 0; color-scheme: ${dark};`;
  frame.srcdoc = begun(model.get("page"), model.get("pairs"));
  const hear = ({ source, data }) => {
    if (source !== frame.contentWindow || data?.isomatch !== "landmarks") return;
    model.set("pairs", data.pairs); model.save_changes();
  };
  window.addEventListener("message", hear);
  el.append(frame);
  return () => window.removeEventListener("message", hear);
};
export default { render };
