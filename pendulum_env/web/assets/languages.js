// The page's languages. English stands in the scripts and the layout; each other language is a table from English to its words.

let language = "en";
const ORIGINAL = []; // what the layout says in English: [node or element, attribute or null, text]

/** A sentence in the page's language; each {} in it takes one of the values. */
function t(text, ...values) {
  const found = language === "en" ? text : PAGE.texts[language][text] ?? text;
  return values.reduce((said, value) => said.replace("{}", () => local(String(value))), found);
}

/** Numbers in a text as the language writes them. */
function local(text) {
  return language === "en" ? text : text.replace(/(\d)\.(\d)/g, `$1${PAGE.texts[language]["."]}$2`);
}

/** Remember what the layout says, once. */
function remember() {
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    if (node.textContent.trim() && !node.parentElement.closest("script, style, h1, #software")) ORIGINAL.push([node, null, node.textContent]);
  }
  for (const one of document.querySelectorAll("[aria-label], [title]")) {
    for (const name of ["aria-label", "title"]) if (one.hasAttribute(name)) ORIGINAL.push([one, name, one.getAttribute(name)]);
  }
}

/** Say the layout in another language. */
function translate(wanted) {
  language = wanted;
  document.documentElement.lang = wanted;
  for (const [one, name, text] of ORIGINAL) {
    const words = text.replace(text.trim(), () => t(text.trim()));
    if (name) one.setAttribute(name, words);
    else one.textContent = words;
  }
}
