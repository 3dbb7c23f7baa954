// The page in a notebook: a frame that holds it, and its link, which Python and the page keep equal.

function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.title = "LabPendulum";
  frame.style.cssText = `width: 100%; height: ${model.get("height")}px; border: 0`;
  frame.srcdoc = model.get("page");
  el.append(frame);
  let known = "";
  const timer = setInterval(() => {
    const page = frame.contentWindow?.LabPendulum;
    if (!page) return;
    const wanted = model.get("link");
    if (wanted !== known) {
      known = wanted;
      const wrong = page.readLink(wanted);
      page.rebuild();
      if (wrong) page.say(wrong);
      return;
    }
    const now = page.linkText(false);
    if (now !== known) {
      known = now;
      model.set("link", now);
      model.save_changes();
    }
  }, 300);
  return () => clearInterval(timer);
}

export default { render };
