// Drop, see what was recognised, set what is missing, score, compare. Texts enter as text only, never as markup.
"use strict";

const find = (selector, within = document) => within.querySelector(selector);
const results = []; // { id, label }

function element(tag, text, attributes = {}) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  Object.entries(attributes).forEach(([name, value]) => made.setAttribute(name, value));
  return made;
}

// Answers of the server: JSON, or an error in one line.
async function ask(address, options) {
  let answer;
  try {
    answer = await fetch(address, options);
  } catch {
    throw new Error("The server does not answer. Is reba app still running?");
  }
  const content = await answer.json().catch(() => ({ error: `The server answered ${answer.status}.` }));
  if (!answer.ok) throw new Error(content.error || `The server answered ${answer.status}.`);
  return content;
}

function alarm(place, error) {
  place.replaceChildren(element("p", error.message, { class: "alarm" }));
}

function seconds(value) {
  return value === null || value === undefined ? "" : `${value.toFixed(1)} s`;
}

// As the report writes shares (reba/analysis/wording.py).
function percent(share) {
  if (share > 0 && share < 0.001) return "<0.1 %";
  return `${(100 * share + 1e-6).toFixed(share && share < 0.0995 ? 1 : 0)} %`;
}

function list(title, items) {
  const box = element("details");
  box.append(element("summary", `${title} (${items.length})`));
  const rows = element("ul");
  items.forEach((item) => rows.append(element("li", item)));
  box.append(rows);
  return box;
}

function table(head, rows) {
  const made = element("table");
  const top = element("tr");
  head.forEach((text) => top.append(element("th", text, { scope: "col" })));
  made.append(element("thead"), element("tbody"));
  made.tHead.append(top);
  rows.forEach((cells) => {
    const row = element("tr");
    cells.forEach((cell, number) => row.append(element(number ? "td" : "th", cell, number ? {} : { scope: "row" })));
    made.tBodies[0].append(row);
  });
  return made;
}

async function add(file) {
  const card = find("#recording").content.cloneNode(true).firstElementChild;
  find("h2", card).textContent = file.name;
  find("#recordings").append(card);
  const place = find(".about", card);
  place.textContent = "Reading …";
  find(".remove", card).addEventListener("click", () => card.remove());
  try {
    const { id } = await ask(`recordings?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
    card.dataset.recording = id;
    connect(card, id);
    await describe(card, id);
  } catch (error) {
    alarm(place, error);
  }
}

// What was recognised, with the neutral posture and the person that are chosen.
async function describe(card, id) {
  const form = find("form", card);
  const place = find(".about", card);
  let about;
  try {
    about = await ask(`recordings/${id}?${new URLSearchParams(reading(form))}`);
  } catch (error) {
    alarm(place, error);
    return;
  }
  const choice = find("[name=topic]", form);
  if (choice.options.length === 1) choice.append(...about.topics.map((name) => element("option", name)));
  choice.parentElement.hidden = !about.topics.length;
  form.hidden = !about.usable && !about.topics.length;
  if (!about.usable) {
    alarm(place, { message: about.recognised });
    return;
  }
  const counted = `${about.frames} frames, ${seconds(about.seconds)}, ${about.measured.length} of 22 angles measured`;
  const lines = [element("p", about.recognised), element("p", counted)];
  const missing = Object.entries(about.unmeasured).map(([name, why]) => `${name.replaceAll("_", " ")}: ${why}`);
  if (missing.length) lines.push(list("Not measured: the scores show the range that is left open", missing));
  if (about.assumed.length) lines.push(list("Assumed", about.assumed));
  if (about.warnings.length) lines.push(list("Warnings", about.warnings));
  place.replaceChildren(...lines);
}

function connect(card, id) {
  const form = find("form", card);
  find(".add", form).addEventListener("click", () => {
    const row = element("tr");
    const parts = [["name", "text", "Name"], ["start", "number", "From [s]"], ["end", "number", "To [s]"]];
    for (const [name, type, label] of parts) {
      const cell = element("td");
      cell.append(element("input", undefined, { type, "data-part": name, step: "any", "aria-label": label }));
      row.append(cell);
    }
    find(".tasks tbody", form).append(row);
    find("input", row).focus();
  });
  find(".remove", card).addEventListener("click", () => ask(`recordings/${id}`, { method: "DELETE" }).catch(() => {}));
  find(".reading", form).addEventListener("change", () => describe(card, id));
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const place = find(".results", card);
    const button = find("button[type=submit]", form);
    button.disabled = true;
    place.replaceChildren(element("p", "Scoring …"));
    try {
      show(place, await ask(`recordings/${id}/scores`, { method: "POST", body: JSON.stringify(settings(form)) }));
    } catch (error) {
      alarm(place, error);
    }
    button.disabled = false;
  });
}

function reading(form) {
  const [neutral, topic] = ["neutral", "topic"].map((name) => find(`[name=${name}]`, form).value);
  return { ...(neutral && { neutral: `first:${neutral}s` }), ...(topic && { topic }) };
}

function settings(form) {
  const given = {};
  for (const [name, value] of new FormData(form)) if (value !== "") given[name] = value === "on" ? true : value;
  Object.assign(given, reading(form));
  if (given.load !== undefined) given.load = Number(given.load);
  given.tasks = [...form.querySelectorAll(".tasks tbody tr")].map((row) => {
    const task = {};
    row.querySelectorAll("input").forEach((input) => {
      if (input.value !== "") task[input.dataset.part] = input.type === "number" ? Number(input.value) : input.value;
    });
    return task;
  });
  return given;
}

function show(place, result) {
  // Both ends that unmeasured angles leave.
  const high = (row) => [...new Set(row.high_seconds.map((time) => percent(time / (row.seconds || 1))))].join(" to ");
  const range = (row, name) =>
    row.range[`${name}_low`] === row.range[`${name}_high`]
      ? `${row.range[`${name}_low`]}`
      : `${row.range[`${name}_low`]} to ${row.range[`${name}_high`]}`;
  const rows = result.rows.map((row) => [
    row.name, seconds(row.seconds), range(row, "p90"), range(row, "max"), high(row), percent(row.undetermined),
    row.worst.map((one) => seconds(one.time)).join(", "),
  ]);
  const head = ["Task", "Length", "90th percentile", "Highest", "High risk or more", "Undetermined", "Worst at"];
  const scroll = element("div", undefined, { class: "scroll" });
  scroll.append(table(head, rows));
  const verdicts = result.rows.map((row) => verdict(result.rows.length > 1 ? row.name : "", row.verdict));
  const links = element("p");
  const label = { "report.html": "Open the report", "scores.csv": "Table (CSV)", "scores.xlsx": "Workbook (Excel)" };
  result.files.forEach((name) => {
    const link = element("a", label[name], { href: `results/${result.id}/${name}` });
    if (name.endsWith(".html")) link.target = "_blank";
    else link.download = name;
    links.append(link);
  });
  links.append(saved(result.id, "report"));
  place.replaceChildren(...verdicts, scroll, links);
  results.push({ id: result.id, label: `${result.name}, result ${results.length + 1}` });
  offerComparison();
}

function verdict(name, text) {
  const line = element("p", undefined, { class: "verdict" });
  if (name) line.append(element("b", `${name}: `));
  line.append(text);
  return line;
}

function saved(id, what) {
  return element("a", `Save the ${what}`, { href: `results/${id}/report.html`, download: `${what}.html` });
}

function offerComparison() {
  find("#comparison").hidden = results.length < 2;
  for (const [place, chosen] of [["#first", results.length - 2], ["#second", results.length - 1]]) {
    const select = find(place);
    select.replaceChildren(...results.map(({ id, label }) => element("option", label, { value: id })));
    select.selectedIndex = chosen;
  }
}

find("#compare").addEventListener("click", async () => {
  const place = find("#compared");
  const body = JSON.stringify({ first: find("#first").value, second: find("#second").value });
  try {
    const { id, verdicts, rows, notes } = await ask("comparison", { method: "POST", body });
    const links = element("p", undefined, { class: "results" });
    links.append(element("a", "Open the comparison", { href: `results/${id}/report.html`, target: "_blank" }));
    links.append(saved(id, "comparison"));
    place.replaceChildren(
      ...["Before", "After"].map((when, number) => verdict(`${when}, ${verdicts[number][0]}`, verdicts[number][1])),
      table(["", "Before", "After", "Difference"], rows),
      ...notes.map((note) => element("p", note)),
      links,
    );
  } catch (error) {
    alarm(place, error);
  }
});

async function addAll(files) {
  const busy = find("#busy");
  for (const [number, file] of [...files].entries()) {
    busy.textContent = files.length > 1 ? `Recording ${number + 1} of ${files.length}` : "";
    await add(file);
  }
  busy.textContent = "";
}

const zone = find("#zone");
find("#files").addEventListener("change", ({ target }) => {
  const chosen = [...target.files];
  target.value = ""; // so that the same file can be chosen again
  addAll(chosen);
});
for (const kind of ["dragover", "dragleave", "drop"]) {
  document.addEventListener(kind, (event) => {
    event.preventDefault();
    zone.classList.toggle("over", kind === "dragover");
    if (kind === "drop") addAll(event.dataTransfer.files);
  });
}
