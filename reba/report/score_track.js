"use strict";
// REBA over time: every score, or the means of scores that change too often to be seen.
{
  const { LEFT, RIGHT, NO_SCORE, clamp } = Timeline;

  Object.assign(Timeline.Explorer.prototype, {
    // Draws REBA on the axis that the recordings of a comparison share.
    drawShared() {
      const own = this.shown;
      const { length } = this.shared, [start] = this.time;
      this.shown = [start - 0.01 * length, start + 1.01 * length];
      this.drawScores(this.shared.canvas);
      this.shown = own;
    },

    drawScores(canvas = this.scoresCanvas) {
      const area = this.frame(canvas), { pen, width, height, ink } = area;
      const top = 20, bottom = height - 26;
      const y = (score) => bottom - ((score - 0.5) / 15.1) * (bottom - top);
      pen.textAlign = "right";
      for (const [low, high, fill, name] of this.levels) {
        pen.globalAlpha = Number(Person.color("--band"));
        pen.fillStyle = fill;
        pen.fillRect(LEFT, y(high), width - LEFT - RIGHT, y(low) - y(high));
        pen.globalAlpha = 1;
        pen.fillStyle = ink;
        const first = Math.ceil(low), last = Math.floor(high);
        pen.fillText(`${name} ${first === last ? first : `${first}-${last}`}`, LEFT - 8, y((low + high) / 2) + 4);
      }
      pen.textAlign = "center";
      for (const tick of this.ticks(Math.max(Math.floor((width - LEFT) / 80), 2))) {
        const minutes = this.shown[1] - this.shown[0] > 900;
        pen.fillText(minutes ? `${+(tick / 60).toFixed(2)} min` : `${tick} s`, clamp(this.x(tick, width), LEFT + 12, width - RIGHT - 14), height - 8);
      }
      area.inside();
      const { low, high } = this.totals[this.total];
      const [first, last] = this.visible();
      const busy = this.changes(first, last, low, high) > (width - LEFT - RIGHT) / 2;
      if (canvas === this.scoresCanvas) this.busyNote.hidden = !busy;
      if (busy) this.drawMeans(area, y, low, high, first, last);
      else this.drawSteps(area, y, low, high, first, last);
      for (const [number, a, b, middle] of this.numbered(width)) {
        pen.lineWidth = 1;
        pen.setLineDash([2, 3]);
        pen.strokeRect(a, top, Math.max(b - a, 1), bottom - top);
        pen.setLineDash([]);
        pen.fillStyle = ink;
        pen.fillRect(middle - 8, 1, 16, 16);
        pen.fillStyle = Person.color("--card");
        pen.font = "700 12px system-ui, sans-serif";
        pen.fillText(String(number), middle, 13.5);
      }
      this.gapsAndCursor(area, 26, 18);
      pen.restore();
    },

    // The intervals in view: number, both ends, and the middle of the number, which is whole and covers no other.
    numbered(width) {
      const seen = this.intervals
        .map(([number, start, end]) => [number, this.x(start, width), this.x(end, width)])
        .filter(([, a, b]) => b >= LEFT && a <= width - RIGHT)
        .sort((one, two) => one[1] - two[1])
        .map(([number, a, b]) => [number, a, b, (a + b) / 2]);
      let free = LEFT + 8;
      for (const one of seen) free = (one[3] = Math.max(one[3], free)) + 18;
      free = width - RIGHT - 8;
      for (const one of seen.reverse()) free = (one[3] = Math.min(one[3], free)) - 18;
      return seen;
    },

    changes(first, last, low, high) {
      let changes = 0;
      for (let i = first; i < last; i += 1) changes += low[i + 1] !== low[i] || high[i + 1] !== high[i];
      return changes;
    },

    // Draws every score: steps where it is known, and areas where it is a range.
    drawSteps({ pen, width, ink }, y, low, high, first, last) {
      pen.fillStyle = Person.color("--range");
      for (let i = first; i <= last; ) {
        const j = this.alike(i, last, low, high), a = this.x(this.time[i], width);
        if (low[i] < high[i]) pen.fillRect(a, y(high[i]), Math.max(this.x(this.until[j], width) - a, 0.6), y(low[i]) - y(high[i]));
        i = j + 1;
      }
      pen.strokeStyle = ink;
      pen.lineWidth = 1.6;
      this.line(pen, width, y, (i) => (low[i] === high[i] ? low[i] : null), true);
    },

    // Draws scores that change too often to be seen: from the lowest to the highest of each pixel, and means over time.
    drawMeans({ pen, width, ink }, y, low, high, first, last) {
      const lowest = new Float64Array(Math.ceil(width)).fill(Infinity), highest = new Float64Array(lowest.length).fill(-Infinity);
      for (let i = first; i <= last; i += 1) {
        const end = Math.min(this.x(this.until[i], width), lowest.length);
        for (let x = Math.max(Math.floor(this.x(this.time[i], width)), 0); x < end; x += 1) {
          lowest[x] = Math.min(lowest[x], low[i]);
          highest[x] = Math.max(highest[x], high[i]);
        }
      }
      pen.fillStyle = ink;
      pen.globalAlpha = 0.22;
      lowest.forEach((score, x) => { if (score < Infinity) pen.fillRect(x, y(highest[x] + 0.1), 1, y(score - 0.1) - y(highest[x] + 0.1)); });
      pen.globalAlpha = 1;
      const { range: [start, end] } = this.means, mean = this.means[this.total], parts = mean.low.length;
      const at = (k) => this.x(start + (k / parts) * (end - start), width);
      pen.fillStyle = Person.color("--range");
      pen.strokeStyle = ink;
      pen.lineWidth = 1.8;
      pen.beginPath();
      for (let k = 0; k < parts; k += 1) {
        if (mean.low[k] === NO_SCORE) continue;
        const [a, b] = [mean.low[k] / 10, mean.high[k] / 10];
        if (a < b) pen.fillRect(at(k), y(b), at(k + 1) - at(k), y(a) - y(b));
        else if (k && mean.low[k - 1] !== NO_SCORE && mean.low[k - 1] === mean.high[k - 1]) pen.lineTo(at(k), y(a));
        else pen.moveTo(at(k), y(a));
        if (a === b) pen.lineTo(at(k + 1), y(a));
      }
      pen.stroke();
    },

    ticks(count) {
      const unit = this.shown[1] - this.shown[0] > 900 ? 60 : 1;
      const rough = (this.shown[1] - this.shown[0]) / count / unit;
      const power = 10 ** Math.floor(Math.log10(rough));
      const step = [1, 2, 5, 10].map((factor) => factor * power).find((value) => value >= rough) * unit;
      const ticks = [];
      for (let tick = Math.ceil(this.shown[0] / step) * step; tick < this.shown[1]; tick += step) ticks.push(Number(tick.toFixed(3)) + 0);
      return ticks;
    },
  });
}
