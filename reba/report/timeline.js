"use strict";
// The timeline: one cursor and one zoom over REBA, the part scores and the angles of the chosen part.
const Timeline = (() => {
  const LEFT = 138, RIGHT = 10, ROW = 20, MISSING = -32768, NO_SCORE = 255;
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const unpack = {
    reals: (text) => new Float64Array(bytes(text).buffer),
    shorts: (text) => new Int16Array(bytes(text).buffer),
    small: bytes,
  };
  const ends = (packed) => {
    const low = unpack.small(packed.low);
    return { low, high: packed.high ? unpack.small(packed.high) : low };
  };
  // As the report writes times of a recording, with hundredths.
  const moment = (time) => {
    if (time < 120) return `${time.toFixed(2)} s`;
    const [hours, minutes] = [Math.floor(time / 3600), Math.floor(time / 60) % 60];
    return `${hours ? `${hours} h ` : ""}${minutes} min ${(time % 60).toFixed(2).padStart(5, "0")} s`;
  };
  // A space between a number and its unit, at which no line ends (as on the rest of the page).
  let withUnit = null;
  const joined = (text) => (withUnit ? text.replace(withUnit, "\u00a0") : text);
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  class Explorer {
    constructor(root, data, model, levels, partColors) {
      Object.assign(this, { root, model, levels, partColors, full: data.range, gaps: data.gaps, intervals: data.intervals });
      this.time = unpack.reals(data.time);
      this.until = unpack.reals(data.until);
      this.totals = Object.fromEntries(Object.entries(data.totals).map(([name, value]) => [name, ends(value)]));
      this.means = { range: data.means.range };
      for (const name of Object.keys(this.totals)) this.means[name] = ends(data.means[name]);
      this.parts = data.parts.map((part) => ({ ...part, ...ends(part) }));
      this.angles = data.angles.map((angle) => ({ ...angle, values: unpack.shorts(angle.values) }));
      this.sitting = unpack.small(data.sitting);
      this.activity = unpack.small(data.activity);
      this.pictures = data.pictures;
      this.camera = root.querySelector(".camera.at-cursor");
      this.shown = [...this.full];
      this.total = "reba";
      this.degrees = 45;
      const first = this.intervals[0];
      this.at = first ? this.nearest(first[3]) : 0;
      for (const name of ["scores", "parts", "angles", "figure"]) this[`${name}Canvas`] = root.querySelector(`canvas.${name}`);
      this.readout = root.querySelector(".readout");
      this.legend = root.querySelector(".angle-legend");
      this.tracks = root.querySelector(".tracks");
      this.slider = root.querySelector("[role=slider]");
      this.busyNote = root.querySelector(".busy");
      this.buttons = [...root.querySelectorAll(".part-names button")];
      this.pick(data.first);
      this.listen();
      this.draw();
    }

    nearest(seconds) {
      let low = 0, high = this.time.length - 1;
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (this.time[middle] <= seconds + 1e-6) low = middle; else high = middle - 1;
      }
      return low;
    }

    x(seconds, width) {
      return LEFT + ((seconds - this.shown[0]) / (this.shown[1] - this.shown[0])) * (width - LEFT - RIGHT);
    }

    seconds(x, width) {
      return this.shown[0] + ((x - LEFT) / (width - LEFT - RIGHT)) * (this.shown[1] - this.shown[0]);
    }

    // Frames of the shown interval, with one more on either side.
    visible() {
      return [Math.max(this.nearest(this.shown[0]) - 1, 0), Math.min(this.nearest(this.shown[1]) + 1, this.time.length - 1)];
    }

    go(seconds, around = null) {
      this.at = this.nearest(seconds);
      if (around) this.zoomTo(around[0], around[1]);
      else this.follow();
      this.draw();
    }

    step(frames) {
      this.at = clamp(this.at + frames, 0, this.time.length - 1);
      this.follow();
      this.draw();
    }

    // Moves the shown interval so that it holds the cursor.
    follow() {
      const now = this.time[this.at], length = this.shown[1] - this.shown[0];
      if (now < this.shown[0] || now > this.shown[1]) this.zoomTo(now - length / 2, now + length / 2);
    }

    zoomTo(start, end) {
      const whole = this.full[1] - this.full[0];
      const length = clamp(end - start, Math.min(0.5, whole), whole);
      const first = clamp((start + end - length) / 2, this.full[0], this.full[1] - length);
      this.shown = [first, first + length];
    }

    zoom(factor, around = this.time[this.at]) {
      const [start, end] = this.shown;
      this.zoomTo(around - (around - start) * factor, around + (end - around) * factor);
      this.draw();
    }

    pick(name) {
      this.part = name;
      for (const button of this.buttons) button.setAttribute("aria-pressed", String(button.dataset.part === name));
    }

    listen() {
      const { root, slider, tracks } = this;
      const on = (selector, action) => root.querySelectorAll(selector).forEach((one) => one.addEventListener("click", () => action(one)));
      on("[data-zoom]", (one) => (one.dataset.zoom === "all" ? ((this.shown = [...this.full]), this.draw()) : this.zoom(Number(one.dataset.zoom))));
      on("[data-turn]", (one) => { this.degrees = Number(one.dataset.turn); this.draw(); });
      on(".part-names button", (one) => { this.pick(one.dataset.part); this.draw(); });
      for (const choice of root.querySelectorAll("input[type=radio]")) {
        choice.addEventListener("change", () => { this.total = choice.value; this.draw(); });
      }
      tracks.addEventListener("keydown", (event) => {
        const moves = { ArrowLeft: -1, ArrowRight: 1, PageUp: -25, PageDown: 25 };
        const { key } = event;
        if (key in moves) this.step(moves[key] * (event.shiftKey ? 10 : 1));
        else if (key === "Home") this.step(-this.time.length);
        else if (key === "End") this.step(this.time.length);
        else if (key === "+" || key === "=") this.zoom(0.5);
        else if (key === "-") this.zoom(2);
        else if (key === "0" || key === "Escape") { this.shown = [...this.full]; this.draw(); }
        else return;
        event.preventDefault();
      });
      const touching = new Map();
      let spread = 0;
      for (const canvas of [this.scoresCanvas, this.partsCanvas, this.anglesCanvas]) {
        const move = (event) => {
          const box = canvas.getBoundingClientRect();
          const at = this.seconds(event.clientX - box.left, box.width);
          if (touching.size === 2) {
            const [a, b] = [...touching.values()].map((one) => one.clientX);
            if (spread) this.zoom(clamp(spread / Math.max(Math.abs(a - b), 1), 0.5, 2), at);
            spread = Math.abs(a - b);
          } else if (event.pointerType === "mouse" || touching.size) {
            this.at = this.nearest(clamp(at, this.time[0], this.time[this.time.length - 1]));
            this.draw();
          }
        };
        canvas.addEventListener("pointerdown", (event) => { touching.set(event.pointerId, event); spread = 0; slider.focus({ preventScroll: true }); move(event); });
        canvas.addEventListener("pointermove", (event) => { if (touching.has(event.pointerId)) touching.set(event.pointerId, event); move(event); });
        for (const end of ["pointerup", "pointercancel", "pointerleave"]) canvas.addEventListener(end, (event) => touching.delete(event.pointerId));
        canvas.addEventListener("wheel", (event) => {
          if (!event.ctrlKey && !event.shiftKey) return;
          event.preventDefault();
          const box = canvas.getBoundingClientRect();
          this.zoom(event.deltaY + event.deltaX > 0 ? 1.25 : 0.8, this.seconds(event.clientX - box.left, box.width));
        }, { passive: false });
        canvas.addEventListener("dblclick", (event) => {
          const box = canvas.getBoundingClientRect();
          this.zoom(0.4, this.seconds(event.clientX - box.left, box.width));
        });
      }
      const turning = (event) => { if (event.buttons) { this.degrees = (this.degrees - event.movementX + 360) % 360; this.draw(); } };
      this.figureCanvas.addEventListener("pointermove", turning);
      this.figureCanvas.addEventListener("pointerdown", (event) => this.figureCanvas.setPointerCapture(event.pointerId));
      new ResizeObserver(() => this.draw()).observe(root);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    }

    draw() {
      if (this.waiting) return;
      this.waiting = true;
      requestAnimationFrame(() => {
        this.waiting = false;
        this.drawScores();
        if (this.shared) this.drawShared();
        this.drawParts();
        this.drawAngles();
        this.drawFigure();
        this.showPicture();
        this.say();
      });
    }

    // Shows the picture of the camera that is nearest to the cursor, and says how far from it.
    showPicture() {
      if (!this.camera || !this.pictures) return;
      const { times, pictures, pixelated } = this.pictures, now = this.time[this.at];
      let nearest = 0;
      times.forEach((time, k) => { if (Math.abs(time - now) < Math.abs(times[nearest] - now)) nearest = k; });
      const image = this.camera.querySelector("img"), after = times[nearest] - now;
      if (image.dataset.shown !== String(nearest)) image.src = pictures[nearest];
      image.dataset.shown = String(nearest);
      image.alt = `Picture of the camera at ${times[nearest].toFixed(1)} s${pixelated ? ", pixelated" : ""}`;
      const when = Math.abs(after) < 0.005 ? "at the cursor" : `${Math.abs(after).toFixed(2)} s ${after > 0 ? "after" : "before"} the cursor`;
      this.camera.querySelector("figcaption").textContent = joined(`Camera ${when}${pixelated ? ", pixelated" : ""}.`);
    }

    // Draws a line of values in the shown interval: steps if they `hold`; `value` is null where there is none.
    line(pen, width, y, value, hold) {
      const [first, last] = this.visible();
      pen.beginPath();
      let open = false;
      for (let i = first; i <= last; i += 1) {
        const here = value(i);
        if (here === null) { open = false; continue; }
        const a = this.x(this.time[i], width), b = this.x(this.until[i], width);
        if (open) pen.lineTo(a, y(here)); else pen.moveTo(a, y(here));
        open = i < last && Math.abs(this.time[i + 1] - this.until[i]) < 1e-6;
        if (hold || !open) pen.lineTo(b, y(here));
      }
      pen.stroke();
    }

    // The last frame that follows a frame without a gap and with the same range: they are one rectangle.
    alike(i, last, low, high) {
      let j = i;
      while (j < last && low[j + 1] === low[i] && high[j + 1] === high[i] && this.time[j + 1] - this.until[j] < 1e-6) j += 1;
      return j;
    }

    frame(canvas) {
      const area = Person.surface(canvas);
      area.pen.font = "12px system-ui, sans-serif";
      area.pen.save();
      area.inside = () => { area.pen.beginPath(); area.pen.rect(LEFT, 0, area.width - LEFT - RIGHT, area.height); area.pen.clip(); };
      return area;
    }

    gapsAndCursor({ pen, width, height, ink }, bottom = 0, top = 0) {
      pen.fillStyle = "rgba(110, 118, 130, 0.3)";
      for (const [a, b] of this.gaps) pen.fillRect(this.x(a, width), 0, Math.max(this.x(b, width) - this.x(a, width), 1), height - bottom);
      const now = this.x(this.time[this.at], width);
      pen.strokeStyle = ink;
      pen.lineWidth = 1.5;
      pen.beginPath();
      pen.moveTo(now, top);
      pen.lineTo(now, height - bottom);
      pen.stroke();
    }

    drawParts() {
      const area = this.frame(this.partsCanvas), { pen, width } = area;
      area.inside();
      const [first, last] = this.visible();
      this.parts.forEach((part, row) => {
        for (let i = first; i <= last; ) {
          const j = this.alike(i, last, part.low, part.high);
          const a = this.x(this.time[i], width), b = this.x(this.until[j], width);
          const open = part.low[i] < part.high[i];
          pen.fillStyle = open ? "#8f98a5" : this.partColors[part.low[i]];
          pen.fillRect(a, row * ROW + 2, Math.max(b - a, 0.6), open ? 6 : ROW - 4);
          i = j + 1;
        }
      });
      this.gapsAndCursor(area);
      pen.restore();
    }

    drawAngles() {
      const area = this.frame(this.anglesCanvas), { pen, width, height, ink, soft } = area;
      const listed = this.angles.filter((angle) => angle.part === this.part);
      const [first, last] = this.visible();
      let low = 0, high = 10;
      for (const angle of listed) for (let i = first; i <= last; i += 1) {
        const value = angle.values[i];
        if (value !== MISSING) { low = Math.min(low, value / 10); high = Math.max(high, value / 10); }
      }
      low -= 5; high += 5;
      const y = (value) => height - 6 - ((value - low) / (high - low)) * (height - 12);
      pen.fillStyle = ink;
      pen.textAlign = "right";
      const edges = [...new Set(listed.flatMap((angle) => angle.edges))].filter((edge) => edge > low && edge < high).sort((a, b) => a - b);
      let written = Infinity;
      for (const value of edges) {
        if (written - y(value) < 13) continue;
        written = y(value);
        pen.fillText(`${Math.round(value)} deg`, LEFT - 8, y(value) + 4);
      }
      area.inside();
      pen.strokeStyle = Person.color("--edge");
      pen.setLineDash([4, 4]);
      for (const edge of edges) { pen.beginPath(); pen.moveTo(LEFT, y(edge)); pen.lineTo(width, y(edge)); pen.stroke(); }
      pen.setLineDash([]);
      listed.forEach((angle, number) => {
        pen.strokeStyle = number ? soft : ink;
        pen.setLineDash(number === 2 ? [2, 2] : []);
        pen.lineWidth = 1.6;
        this.line(pen, width, y, (i) => (angle.values[i] === MISSING ? null : angle.values[i] / 10), false);
      });
      pen.setLineDash([]);
      this.gapsAndCursor(area);
      pen.restore();
      const value = (angle) => (angle.values[this.at] === MISSING ? "not measured" : `${(angle.values[this.at] / 10).toFixed(1)} deg`);
      const strokes = ["line", "grey line", "dotted line"];
      this.legend.textContent = listed.length
        ? joined(listed.map((angle, number) => `${angle.name} ${value(angle)} (${strokes[number]})`).join(", "))
        : "No measured angle counts for this part.";
    }

    drawFigure() {
      const angles = new Array(this.model.columns.length).fill(NaN);
      for (const angle of this.angles) if (angle.values[this.at] !== MISSING) angles[angle.column] = angle.values[this.at] / 10;
      const marks = this.parts
        .filter((part) => part.name in this.model.spots && part.low[this.at] > 1)
        .map((part) => [part.name, `${part.low[this.at]}${part.low[this.at] < part.high[this.at] ? "+" : ""}`, (part.low[this.at] - 1) / (part.highest - 1)]);
      this.posture = angles;
      Person.draw(this.figureCanvas, this.model, angles, this.sitting[this.at] === 1, marks, this.degrees);
    }

    say() {
      const i = this.at, span = ({ low, high }) => (low[i] === high[i] ? String(low[i]) : `${low[i]} to ${high[i]}`);
      const now = this.time[i];
      const level = this.levels.find(([low, high]) => this.totals.reba.low[i] >= low && this.totals.reba.low[i] <= high);
      const top = this.levels.find(([low, high]) => this.totals.reba.high[i] >= low && this.totals.reba.high[i] <= high);
      const risk = level === top ? level[3] : `${level[3]} to ${top[3]}`;
      const text = `${moment(now)}: REBA ${span(this.totals.reba)} (${risk.toLowerCase()}), left ${span(this.totals.reba_left)}, right ${span(this.totals.reba_right)}`;
      this.readout.textContent = joined(text);
      this.slider.setAttribute("aria-valuenow", now.toFixed(2));
      this.slider.setAttribute("aria-valuetext", text);
      for (const button of this.buttons) {
        const part = this.parts.find((one) => one.name === button.dataset.part);
        button.querySelector("b").textContent = part.low[i] === part.high[i] ? part.low[i] : `${part.low[i]}-${part.high[i]}`;
      }
    }
  }
  return { Explorer, LEFT, RIGHT, NO_SCORE, clamp, bytes, joined, join: (pattern) => { withUnit = new RegExp(pattern, "g"); } };
})();
