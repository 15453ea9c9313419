"use strict";
// Starts the timelines and the tables of assumptions, and follows links to moments.
(() => {
  const json = (id) => JSON.parse(document.getElementById(id).textContent);
  const common = document.getElementById("explorer-model") ? json("explorer-model") : null;
  const explorers = {};
  if (common) Timeline.join(common.with_unit);
  // No line ends between a number and its unit; the file keeps plain spaces, for those who search in it.
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const text = texts.currentNode;
    if (!text.parentElement.closest("script, style, pre, textarea")) text.data = Timeline.joined(text.data);
  }

  for (const root of document.querySelectorAll(".explorer")) {
    root.hidden = false;
    root.parentElement.querySelectorAll(".still").forEach((still) => still.classList.add("replaced"));
    const explorer = new Timeline.Explorer(root, json(`${root.dataset.recording}-explorer`), common.skeleton, common.levels, common.parts);
    explorers[root.dataset.recording] = explorer;
  }
  window.explorers = explorers;
  const longest = Math.max(...Object.values(explorers).map(({ time, until }) => until[until.length - 1] - time[0]));
  for (const canvas of document.querySelectorAll("canvas.shared")) {
    const explorer = explorers[canvas.dataset.recording];
    if (!explorer) continue;
    canvas.hidden = false;
    canvas.previousElementSibling.classList.add("replaced");
    explorer.shared = { canvas, length: longest };
  }

  const follow = () => {
    const [, recording, time] = location.hash.match(/^#(r\d+)-at-([\d.-]+)$/) || [];
    const explorer = explorers[recording];
    if (!explorer) return;
    const seconds = Number(time);
    const interval = explorer.intervals.find(([, start, end]) => start <= seconds + 1e-6 && seconds <= end + 1e-6);
    const [start, end] = interval ? [interval[1], interval[2]] : [seconds, seconds];
    const margin = Math.max(end - start, 2);
    explorer.go(seconds, [start - margin, end + margin]);
    explorer.root.scrollIntoView({ block: "start" });
    explorer.slider.focus({ preventScroll: true });
  };
  window.addEventListener("hashchange", follow);
  for (const link of document.querySelectorAll("a.moment")) {
    link.addEventListener("click", (event) => {
      event.preventDefault();
      history.replaceState(null, "", link.getAttribute("href"));
      follow();
    });
  }

  for (const root of document.querySelectorAll(".what-if")) {
    root.hidden = false;
    const { settings, one, shares, seconds } = json(`${root.dataset.recording}-what-if`);
    const table = new Uint32Array(Timeline.bytes(shares).buffer);
    const inputs = [...root.querySelectorAll("input[type=range]")];
    const rows = [...root.querySelectorAll("tbody tr")];
    const bar = root.querySelector(".bar");
    const segments = rows.map((row) => {
      const segment = document.createElement("i");
      segment.className = row.dataset.level === "open" ? "open" : `l${row.dataset.level}`;
      return segment;
    });
    bar.replaceChildren(...[...segments].reverse()); // lowest level first, as in the other bars
    const at = (choice) => settings.reduce((index, [, values], k) => index * values.length + choice[k], 0) * 8;
    // As the report writes durations and shares (reba/analysis/wording.py).
    const two = (number) => String(number).padStart(2, "0");
    const lasting = (exact) => {
      const time = exact + 1e-4, whole = Math.floor(time), minutes = Math.floor(whole / 60);
      if (time < 60) return `${time.toFixed(1)} s`;
      return time < 7200 ? `${minutes} min ${two(whole % 60)} s` : `${Math.floor(minutes / 60)} h ${two(minutes % 60)} min`;
    };
    const percent = (share) => (share > 0 && share < 0.001 ? "<0.1" : (100 * share + 1e-6).toFixed(share && share < 0.0995 ? 1 : 0));
    const cells = (share) => Timeline.joined(`${lasting(share * seconds)} (${percent(share)}\u00a0%)`);
    const show = () => {
      const choice = inputs.map((input) => Number(input.value));
      inputs.forEach((input, k) => {
        const text = settings[k][1][choice[k]];
        input.nextElementSibling.textContent = text;
        input.setAttribute("aria-valuetext", text);
      });
      const now = at(choice), before = at(choice.map(() => 0));
      rows.forEach((row, k) => {
        const level = row.dataset.level === "open" ? 5 : Number(row.dataset.level);
        const [was, is] = [table[before + level] / one, table[now + level] / one];
        row.children[1].textContent = cells(was);
        row.children[2].textContent = cells(is);
        segments[k].style.width = `${100 * is}%`;
      });
      const high = (from) => [...new Set([6, 7].map((end) => cells(table[from + end] / one)))].join(" to ");
      root.querySelector(".outcome").textContent = Timeline.joined(`REBA 8 or more: ${high(now)}; as recorded ${high(before)}.`);
    };
    inputs.forEach((input) => input.addEventListener("input", show));
    root.querySelector("button").addEventListener("click", () => {
      inputs.forEach((input) => { input.value = 0; });
      show();
    });
    show();
  }

  // Tables are sorted by the values of their cells: numbers the largest first, texts from a to z, and back.
  for (const table of document.querySelectorAll("table.sortable")) {
    table.querySelectorAll(".sorts").forEach((hint) => { hint.hidden = false; });
    const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
    const value = (row, column) => {
      const text = row.cells[column] ? row.cells[column].dataset.sort : undefined;
      return text === undefined || text === "" ? null : Number.isNaN(Number(text)) ? text : Number(text);
    };
    const compare = (a, b) => (typeof a === "string" || typeof b === "string" ? String(a).localeCompare(String(b)) : b - a);
    heads.forEach((head, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const values = new Map([...body.rows].map((row) => [row, value(row, column)]));
        const texts = [...values.values()].some((one) => typeof one === "string");
        const back = head.hasAttribute("data-sorted") && head.dataset.sorted !== "back";
        heads.forEach((other) => { other.removeAttribute("aria-sort"); delete other.dataset.sorted; });
        head.dataset.sorted = back ? "back" : "";
        head.setAttribute("aria-sort", texts !== back ? "ascending" : "descending");
        const rows = [...body.rows].sort((first, second) => {
          const [a, b] = [values.get(first), values.get(second)];
          return a === null || b === null ? (a === null) - (b === null) : (back ? -1 : 1) * compare(a, b);
        });
        body.append(...rows);
      });
    });
  }

  // On paper, collapsed details cannot be opened.
  window.addEventListener("beforeprint", () => {
    for (const details of document.querySelectorAll("details")) details.open = true;
  });
  follow();
  requestAnimationFrame(() => requestAnimationFrame(() => {
    document.documentElement.setAttribute("data-drawn", String(Object.keys(explorers).length));
  }));
})();
