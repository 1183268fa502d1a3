"use strict";
// Shows the rows of a night: those that fit what is asked for, first a screenful and then a hundred at a time; details are
// loaded when opened.
const FIRST = 30;
const STEP = 100;
const list = document.getElementById("rows");
const search = document.getElementById("search");
const selects = ["group", "severity", "tag"].map((name) => document.getElementById(name));
const status = document.getElementById("status");
const more = document.getElementById("more");
let data = { verdicts: [], tags: [], rows: [] };
let matching = [];
let shown = 0;

async function unpack() {
  const packed = document.getElementById("data").textContent.trim();
  const letters = atob(packed);
  const bytes = new Uint8Array(letters.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = letters.charCodeAt(k); // Uint8Array.from makes a text of each letter
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

function text(parent, tag, content, className) {
  const element = document.createElement(tag);
  element.textContent = content;
  if (className) element.className = className;
  parent.append(element);
  return element;
}

function element(row) {
  const [name, address, verdict, , , message, since, , picture, curve] = row;
  const [key, word, fine, left] = data.verdicts[verdict];
  const details = document.createElement("details");
  details.className = `scenario ${key}${fine ? " fine" : ""}`;
  const summary = text(details, "summary", "");
  text(summary, "span", word, left ? "left" : fine ? "good" : "bad");
  summary.append(" ");
  text(summary, "code", name);
  if (message) summary.append(`: ${message}`);
  if (curve) text(summary, "span", ` ${curve}`, "curve").title = "smallest clearance of the last nights";
  if (!fine) text(summary, "span", ` (${since ? `since ${since.slice(0, 16).replace("T", " ")}` : "for the first time"})`, "note");
  details.addEventListener("toggle", () => open(details, name, address, picture));
  return details;
}

function open(details, name, address, picture) {
  if (!details.open || details.childElementCount > 1) return;
  if (!address) {
    text(details, "p", "It was not run.");
    return;
  }
  const link = text(text(details, "p", ""), "a", "on a page of its own");
  link.href = address;
  if (picture) {
    const image = document.createElement("img");
    image.src = picture;
    image.alt = `${name} at its worst moment, the baseline on the left and this run on the right`;
    details.append(image);
  }
  const frame = document.createElement("iframe");
  frame.src = address;
  frame.title = `what differs in ${name}`;
  details.append(frame);
}

function fits(row, words, verdict, group, severity, tag) {
  const [name, , of, how, cause, message, , tags] = row;
  if (verdict === "failing" ? data.verdicts[of][2] : verdict !== "all" && data.verdicts[of][0] !== verdict) return false;
  if (group !== "" && cause !== Number(group)) return false;
  if (severity !== "" && (data.verdicts[of][2] || how !== Number(severity))) return false;
  if (tag !== "" && !tags.includes(Number(tag))) return false;
  const text = `${name} ${message}`.toLowerCase();
  return words.every((word) => text.includes(word));
}

function update() {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  const verdict = document.querySelector("input[name=show]:checked").id.slice(5);
  const chosen = selects.map((select) => select.value);
  matching = data.rows.filter((row) => fits(row, words, verdict, ...chosen));
  list.replaceChildren();
  shown = 0;
  extend(FIRST);
}

function extend(step = STEP) {
  list.append(...matching.slice(shown, shown + step).map(element));
  shown = Math.min(shown + step, matching.length);
  more.hidden = shown >= matching.length;
  status.textContent = `${matching.length} of ${data.rows.length} scenarios${more.hidden ? "" : `, ${shown} shown`}`;
}

function move(step) {
  const rows = [...list.querySelectorAll(":scope > details > summary")];
  const at = rows.indexOf(document.activeElement);
  if (step > 0 && at === rows.length - 1 && !more.hidden) {
    extend();
    move(step);
    return;
  }
  const next = rows[at < 0 ? (step > 0 ? 0 : rows.length - 1) : Math.min(Math.max(at + step, 0), rows.length - 1)];
  if (next) next.focus();
}

function key(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const typing = event.target === search;
  if (event.key === "/" && !typing) {
    event.preventDefault();
    search.focus();
  } else if (event.key === "Escape" && typing) {
    search.value = "";
    update();
    search.blur();
  } else if (!typing && (event.key === "j" || event.key === "k")) {
    move(event.key === "j" ? 1 : -1);
  }
}

async function begin() {
  data = await unpack();
  document.getElementById("tools").hidden = false;
  update();
  search.addEventListener("input", update);
  for (const input of [...selects, ...document.querySelectorAll("input[name=show]")]) input.addEventListener("change", update);
  for (const button of document.querySelectorAll("button[data-group]")) {
    button.addEventListener("click", () => {
      selects[0].value = button.dataset.group;
      update();
      list.scrollIntoView();
    });
  }
  more.addEventListener("click", () => extend());
  new IntersectionObserver((seen) => seen.some((one) => one.isIntersecting) && !more.hidden && extend()).observe(more);
  document.addEventListener("keydown", key);
  document.documentElement.dataset.ready = Math.round(performance.now());
}

begin();
