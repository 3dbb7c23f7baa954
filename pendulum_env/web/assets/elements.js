// Parts of every page: elements, and files for the person at the page.

const DEGREES = 180 / Math.PI;
const byId = (id) => document.getElementById(id);

/** Make an element; text given as a child or as textContent is never read as HTML. */
function element(kind, properties = {}, ...children) {
  const made = document.createElement(kind);
  for (const [name, value] of Object.entries(properties)) {
    if (name in made && name !== "list") made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** Hand a file to the browser. */
function download(name, blob) {
  const link = element("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
