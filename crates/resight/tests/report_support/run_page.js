// Runs a report page's script against a page of paper: elements that remember, a canvas that writes down what is stroked.
//
//   node run_page.js PAGE.html      prints {"space": [[[x, y], …] of each stroke], "fields": {camera: {…}}, "said": …} as JSON
//
// Numbers only: that the page looks right, eyes decide. The canvas is 960 × 560, as the still image.
"use strict";
const html = require("fs").readFileSync(process.argv[2], "utf8");
const [WIDTH, HEIGHT] = [960, 560];

class Pen {
  constructor() { this.strokes = []; this.path = []; }
  setTransform() {} fillText() {} fillRect() {} setLineDash() {}
  measureText(text) { return { width: 8 * text.length }; }
  beginPath() { this.path = []; }
  moveTo(x, y) { this.path.push([[x, y]]); }
  lineTo(x, y) { this.path[this.path.length - 1].push([x, y]); }
  closePath() {}
  stroke(path) { for (const line of (path || this).path) this.strokes.push({ color: this.strokeStyle, line }); }
}
class Path2D extends Pen {}

class Element {
  constructor(tag, attributes) {
    Object.assign(this, { tag, listeners: {}, attributes, hidden: "hidden" in attributes, style: {}, dataset: {}, options: [] });
    this.id = attributes.id || "";
    this.checked = "checked" in attributes;
    for (const [key, value] of Object.entries(attributes)) if (key.startsWith("data-")) this.dataset[key.slice(5)] = value;
    const classes = new Set();
    this.classList = { add: (c) => classes.add(c), remove: (c) => classes.delete(c), contains: (c) => classes.has(c) };
    [this.clientWidth, this.clientHeight] = [WIDTH, HEIGHT];
    this.caption = { textContent: "" };
    this.parentElement = { querySelector: () => this.caption };
    this.textContent = "";
  }
  getContext() { return (this.pen = new Pen()); }
  addEventListener(kind, listener) { this.listeners[kind] = listener; }
  setAttribute(key, value) { this.attributes[key] = value; }
  add(option) { this.options.push(option); }
  setPointerCapture() {} focus() { document.activeElement = this; }
  fire(kind, event) { this.listeners[kind](Object.assign({ preventDefault() {} }, event)); }
}

const markup = html.replace(/<(script|style)[^>]*>[^]*?<\/\1>/g, "");
const elements = [...markup.matchAll(/<([a-z0-9]+)((?:"[^"]*"|[^">])*)>/g)].map(([, tag, rest]) => {
  const attributes = {};
  for (const [, key, value] of rest.matchAll(/([a-z-]+)(?:="([^"]*)")?/g)) attributes[key] = value || "";
  return new Element(tag, attributes);
});
const json = new Element("script", { id: "rig-data" });
json.textContent = html.match(/<script type="application\/json"[^>]*>([^]*?)<\/script>/)[1];
elements.push(json);

const selectors = {
  "canvas[data-camera]": (e) => e.tag === "canvas" && "camera" in e.dataset,
  "tr[data-view]": (e) => e.tag === "tr" && "view" in e.dataset,
  "input[type=checkbox]": (e) => e.tag === "input",
  "button[data-turn]": (e) => e.tag === "button" && "turn" in e.dataset,
  "[data-script],#bar,canvas": (e) => "script" in e.dataset || e.id === "bar" || e.tag === "canvas",
};
const queue = [];
const root = new Element("html", {});
global.document = {
  documentElement: root,
  activeElement: null,
  getElementById: (id) => elements.find((e) => e.id === id) || null,
  querySelectorAll: (selector) => elements.filter(selectors[selector]),
};
Object.assign(global, {
  Path2D,
  Option: function (text, value) { Object.assign(this, { text, value: String(value) }); },
  window: { devicePixelRatio: 2, addEventListener() {} },
  requestAnimationFrame: (draw) => queue.push(draw),
  getComputedStyle: () => ({ getPropertyValue: (name) => " " + name }),
  matchMedia: () => ({ addEventListener() {} }),
});
const drain = () => { while (queue.length) queue.shift()(); };

(0, eval)(html.match(/<script>([^]*?)<\/script>/)[1]);
drain();
const space = document.getElementById("space");
const fields = document.querySelectorAll("canvas[data-camera]");
const image = () => ({
  space: space.pen.strokes,
  fields: fields.map((f) => ({ n: f.pen.strokes.length, caption: f.caption.textContent })),
  said: document.getElementById("said").textContent,
});
const answer = { scripted: root.classList.contains("scripted"), start: image() };
document.getElementById("after").fire("click");
drain();
answer.first_view = image();
space.fire("keydown", { key: "ArrowLeft" });
drain();
answer.turned = image();
space.fire("keydown", { key: "0" });
drain();
answer.back = image();
space.fire("pointerdown", { pointerId: 1, clientX: 10, clientY: 10 });
space.fire("pointermove", { pointerId: 1, clientX: 40, clientY: 10, buttons: 1 });
space.fire("wheel", { deltaY: -100 });
drain();
answer.dragged = image();
answer.views = document.getElementById("view").options.map((o) => o.text);
console.log(JSON.stringify(answer));
