// Parts of the page: finding them and making new ones. Text goes in as text, never as HTML.

const SVG_NAMES = "http://www.w3.org/2000/svg";

/**
 * @template {Element} T
 * @param {string} id
 * @param {new () => T} Type what it must be
 * @returns {T}
 */
export function part(id, Type) {
  const found = document.getElementById(id);
  if (found instanceof Type) return found;
  throw new Error(`page: has no ${Type.name} #${id}`);
}

/**
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, string>} [attributes]
 * @param {(Node | string)[]} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/**
 * @template {keyof SVGElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, string>} [attributes]
 * @returns {SVGElementTagNameMap[K]}
 */
export function svgElement(tag, attributes = {}) {
  const made = document.createElementNS(SVG_NAMES, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

/**
 * @param {string} name of the group
 * @param {Record<string, string>} words value and what it is called
 * @param {(value: string) => void} choose
 * @returns {{parts: HTMLElement[], show: (value: string) => void}}
 */
export function radioGroup(name, words, choose) {
  const inputs = Object.keys(words).map((value) => {
    const input = element("input", { type: "radio", name, value });
    input.addEventListener("change", () => choose(value));
    return input;
  });
  return {
    parts: inputs.map((input) => element("label", {}, input, element("span", {}, words[input.value]))),
    show: (value) => inputs.forEach((input) => (input.checked = input.value === value)),
  };
}

/** @param {string} text a line for the reader, until the next one */
export function say(text) {
  const line = part("message", HTMLElement);
  line.textContent = text;
  line.tabIndex = line.scrollHeight > line.clientHeight ? 0 : -1; // keys reach what scrolls
}

/**
 * @param {string} text
 * @param {string} done what to say then
 */
export async function copyText(text, done) {
  try {
    await navigator.clipboard.writeText(text);
    say(done);
  } catch {
    say(`The browser does not let the page copy; copy it here: ${text}`);
  }
}
