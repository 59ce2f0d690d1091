// SVG and HTML elements, axes and lines.

const SVG = "http://www.w3.org/2000/svg";

/** An element with attributes and children. */
function element(name, attributes = {}, ...children) {
  return filled(document.createElement(name), attributes, children);
}

/** An SVG element. */
function drawn(name, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, name), attributes, children);
}

function filled(made, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== false) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children);
  return made;
}

/** Hand a TOML file to the user. */
function download(text, name) {
  const href = URL.createObjectURL(new Blob([text], { type: "application/toml" }));
  element("a", { href, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(href), 1000);
}

/** A picture with a label for screen readers. */
function picture(width, height, label) {
  return drawn("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label });
}

/** A text of a picture. */
function label(x, y, text, anchor = "middle", kind = "tick") {
  return drawn("text", { x, y, "text-anchor": anchor, class: kind }, String(text));
}

const FINE = 10;

/** A path through points, in integer tenths, which are fast to write and parse. */
function pathOf(count, x, y, isClosed = false) {
  const parts = new Array(count);
  for (let i = 0; i < count; i++) parts[i] = `${Math.round(FINE * x(i))} ${Math.round(FINE * y(i))}`;
  return count ? `M${parts.join("L")}${isClosed ? "Z" : ""}` : "";
}

/** A path in tenths. */
function line(kind) {
  return drawn("path", { class: kind, transform: `scale(${1 / FINE})`, "vector-effect": "non-scaling-stroke" });
}

/** A row thinned to a number of equal steps. */
function thinned(length, most) {
  return Math.max(1, Math.ceil(length / most));
}

/** Colour of the k-th place. */
function colour(k) {
  return `s${k % 8}`;
}

/** A scale that grows with what is drawn, and shrinks only when it is far too large. */
class Scale {
  constructor() { this.top = 0; }
  /** Update the scale; return true if it changed. */
  follow(value) {
    const stays = this.top > 0 && value <= this.top && value >= 0.3 * this.top;
    if (stays) return false;
    const before = this.top;
    this.top = roundUp(value);
    return this.top !== before;
  }
}
